"""What a person's push by hand, in a live page, does to a free-flyer beside the push that is judged.

It belongs to f_ext of [Fernandes2020] eq. (3.26): left out, the robot would depart from its impedance model by it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals

HAND_SIGNALS = ("robot.f_P", "robot.p_BP", "robot.f_Q", "robot.p_GQ")
"""Inputs of the robot, in the order of the fields of `HandPush`."""


@dataclass(frozen=True)
class HandPush:
    """Forces by hand at communication points, one row each: on the body at P, and on the gripper at Q.

    A row holds from its instant on where a page gave it, and until its instant where a program set it in a session.

    Attributes:
        f_P, f_Q: in W, N.
        p_BP: place of P, seen from B in the robot's frame, m; p_GQ: of Q, seen from G in the gripper's.
    """

    f_P: Floats
    p_BP: Floats
    f_Q: Floats
    p_GQ: Floats

    @classmethod
    def of(cls, signals: Record | Mapping[str, Floats], rows: int) -> "HandPush":
        """Return what signals over time hold of it; inputs that nobody could give are zero."""
        return cls(*(signals[name] if name in signals else np.zeros((rows, 3)) for name in HAND_SIGNALS))

    @property
    def is_none(self) -> bool:
        """Whether nobody pushed."""
        return not (self.f_P.any() or self.f_Q.any())

    def wrenches(self, t: Floats, q_WB: Floats, w_WB: Floats, q_WG: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return force and torque on the body, about B, and on the gripper, about G, in W.

        Each is the mean over the step from its row on. During a step the plant holds the force on the body in the
        robot's frame, so its mean is turned by half the step's turn, and the one on the gripper in W.
        """
        from scipy.spatial.transform import Rotation  # slow to import, and needed only after a run

        half_turn = Rotation.from_rotvec(w_WB * np.diff(t, append=t[-1])[:, np.newaxis] / 2)
        r_BP = Rotation.from_quat(q_WB, scalar_first=True).apply(self.p_BP)
        r_GQ = Rotation.from_quat(q_WG, scalar_first=True).apply(self.p_GQ)
        on_body = half_turn.apply(self.f_P), half_turn.apply(np.cross(r_BP, self.f_P))
        return *on_body, self.f_Q, np.cross(r_GQ, self.f_Q)


def hand_push_at(signals: Signals) -> list[Floats]:
    """Return the values of `HAND_SIGNALS` at an instant; of inputs that nobody can give, zeros."""
    return [signals[name] if name in signals else np.zeros(3) for name in HAND_SIGNALS]
