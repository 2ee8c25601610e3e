"""Evaluates a push on a robot whose arm moves: by the impedance model with joints, and by what base and joints do.

The gripper's errors are compared with those by [Fernandes2020] eqs. (3.26), (4.4), with B_x and C_x x' for a Jacobian
that is not square, by the controllers' model of the robot.
"""

import itertools
import math
from collections.abc import Mapping

import numpy as np

from handover.controllers.free_flyer.arm_model import (
    Chain,
    OperationalSpace,
    coriolis_matrix,
    mass_matrix,
    operational_bias,
)
from handover.cosim.blocks.geometry import rotation_angle, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.robots.free_flyer.push.arm_parameters import ArmPushParameters, ArmTarget
from handover.scenarios.robots.free_flyer.push.hand_push import HAND_SIGNALS, HandPush
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import (
    Errors,
    PushEvaluator,
    agreement_bound,
    mean_between,
    steps_of_period,
)

SIGNALS = (
    *(f"robot.{name}" for name in ("p_WG", "q_WG", "v_WG", "w_WG", "p_WB", "q_WB", "v_WB", "w_WB", "q_J", "v_J")),
    "push.f_G",
    "push.tau_G",
    "thrusters.f_B",
)
"""Signals of which a motion is made, in the order of its columns after time."""

_TURNED = 1e-9
"""Radians by which a joint has turned."""


Columns = Mapping[str, Floats]


def columns_of(record: Record) -> Columns:
    """Return a record's motion by signal, and its time as `t`."""
    names = [*SIGNALS, *(name for name in HAND_SIGNALS if name in record)]
    return {"t": record.time, **{name: record[name] for name in names}}


def errors_with_arm(motion: Columns, target: ArmTarget) -> Errors:
    """Return the errors, actual and by k_D xt' = B_x x'' + C_x x' + k_B x' - f_ext, one row a period of the controller.

    x'' is the mean over a period and B_x, C_x x' those of its middle; damping and actual error are of its beginning,
    when the controller measured. f_ext is Jbar^T u_ext, u_ext of the push and what somebody does by hand. Where units
    step in parallel, thrust and push act some steps later: by how many is seen in the motion, as in
    `impedance_evaluation.errors_of`.
    """
    steps, t = steps_of_period(motion["t"]), motion["t"]
    by_hand = HandPush.of(motion, len(t))
    wrenches = by_hand.wrenches(t, *(motion[f"robot.{name}"] for name in ("q_WB", "w_WB", "q_WG")))
    delays = (0,) if by_hand.is_none else (0, 1)
    found = [
        _errors(motion, steps, late, np.hstack(wrenches), target)
        for late in itertools.product(range(steps), (0, 1), delays)
    ]
    return min(found, key=lambda errors: sum(errors.disagreement))


def _errors(motion: Columns, steps: int, delays: tuple[int, int, int], by_hand: Floats, target: ArmTarget) -> Errors:
    """Return the errors with thrust, push and pushes by hand that act so many steps later than they were asked for."""
    late, push_delay, hand_delay = delays
    held = np.arange(late, len(motion["t"]), steps)
    seen, R_WD, g = (held - late)[:-1], target.R_WG, target.gains
    push = mean_between(motion["t"], np.hstack([motion["push.f_G"], motion["push.tau_G"]]), held, push_delay)
    hand = mean_between(motion["t"], by_hand, held, hand_delay)
    actual, calculated = np.zeros((len(seen), 6)), np.zeros((len(seen), 6))
    for k, row in enumerate(seen):
        inertial, to_gripper = _inertial_wrench(motion, held[k], held[k + 1], target)
        wrench = inertial - push[k] - hand[k, 6:] - to_gripper @ hand[k, :6]
        v_D, w_D = np.transpose(R_WD) @ motion["robot.v_WG"][row], np.transpose(R_WD) @ motion["robot.w_WG"][row]
        pull = np.transpose(R_WD) @ wrench[:3] + g.damping_translation @ v_D
        twist = np.transpose(R_WD) @ wrench[3:] + g.damping_rotation @ w_D
        calculated[k, :3] = R_WD @ np.linalg.solve(g.stiffness_translation, pull)
        calculated[k, 3:] = R_WD @ np.linalg.solve(g.stiffness_rotation, twist)
    from scipy.spatial.transform import Rotation  # slow to import, and needed only after a run

    R_WG = Rotation.from_quat(motion["robot.q_WG"][seen], scalar_first=True)
    actual[:, :3] = target.p_WG - motion["robot.p_WG"][seen]
    actual[:, 3:] = -(R_WG * Rotation.from_matrix(R_WD).inv()).as_rotvec()
    return Errors(motion["t"][seen], actual[:, :3], calculated[:, :3], actual[:, 3:], calculated[:, 3:])


def _inertial_wrench(motion: Columns, first: int, last: int, target: ArmTarget) -> tuple[Floats, Floats]:
    """Return B_x x'' + C_x x' in the middle between two rows, (6,), in W, and the base's part of J_bar^T, (6, 6)."""

    def middle(name: str) -> Floats:
        return (motion[name][first] + motion[name][last]) / 2.0

    n, dt = target.model.joints, float(motion["t"][last] - motion["t"][first])
    q_J, v_J = middle("robot.q_J")[:n], middle("robot.v_J")[:n]
    chain = Chain(target.model, rotation_of(middle("robot.q_WB")), middle("robot.w_WB"), q_J, v_J)
    size = 6 if target.fixed else 6 + n
    J, J_rate = chain.jacobian(-1)[:, :size], chain.jacobian_rate(-1)[:, :size]
    B, C = mass_matrix(chain)[:size, :size], coriolis_matrix(chain)[:size, :size]
    xi_dot = np.concatenate([middle("robot.v_WB"), middle("robot.w_WB"), v_J])[:size]
    x_2 = np.concatenate([motion[f"robot.{v}_WG"][last] - motion[f"robot.{v}_WG"][first] for v in ("v", "w")]) / dt
    space = OperationalSpace.of(J, B)
    wrench = space.B_x @ x_2 + operational_bias(J, J_rate, B, C, xi_dot)
    return wrench, np.transpose(space.J_bar)[:, :6]


class ArmImpedanceEvaluator(PushEvaluator[ArmPushParameters]):
    """Follows one push of a robot whose arm gives way."""

    signals = SIGNALS

    def __init__(self, parameters: ArmPushParameters) -> None:
        super().__init__(parameters)
        target = parameters.target()
        self._p_WG, self._R_WG = target.p_WG, target.R_WG

    def _away(self, signals: Signals) -> tuple[float, float]:
        away = float(np.linalg.norm(signals["robot.p_WG"] - self._p_WG))
        return away, rotation_angle(np.transpose(self._R_WG) @ rotation_of(signals["robot.q_WG"]))

    def _errors(self, motion: Mapping[str, Floats]) -> Errors:
        return errors_with_arm(motion, self.parameters.target())

    def _reason(self, motion: Mapping[str, Floats], by: tuple[float, float], *, agrees: bool) -> str:
        back = (
            f"the gripper was back at rest {self._settled:.1f} s after the push"
            if self._at_rest
            else f"the gripper was not back at rest at {self._t:.1f} s"
        )
        verb = "agreed with" if agrees else "departed from"
        joined = "and" if agrees is self._at_rest else "but"
        extent = f"{'within' if agrees else 'by'} {1000 * by[0]:.1f} mm and {math.degrees(by[1]):.2f}°"
        bound = "" if agrees else f", {agreement_bound()}"
        return f"{back}, {joined} {verb} the impedance model {extent}{bound}{self._stopped_joints(motion)}"

    def _stopped_joints(self, motion: Columns) -> str:
        """Return which free joints were held away from where they began, as a clause; one that turns is never at 0."""
        stopped = list[str]()
        for j in range(0 if self.parameters.target().fixed else self.parameters.target().model.joints):
            q, v = motion["robot.q_J"][:, j], motion["robot.v_J"][:, j]
            held = np.flatnonzero((v == 0.0) & (np.abs(q - q[0]) > _TURNED))
            if len(held):
                k = int(held[0])
                where = f"{math.degrees(q[k]):.0f}° at {motion['t'][k]:.1f} s"
                stopped.append(f"joint {j + 1} was held at {where}, by its end stop or its lock")
        return "".join(f"; {text}" for text in stopped)

    def _metrics(self, motion: Columns, by: tuple[float, float]) -> dict[str, Metric]:
        base = np.linalg.norm(motion["robot.p_WB"] - motion["robot.p_WB"][0], axis=1)
        turn = 2.0 * np.arccos(np.minimum(1.0, np.abs(motion["robot.q_WB"] @ motion["robot.q_WB"][0])))
        joints = np.abs(motion["robot.q_J"] - motion["robot.q_J"][0])
        impulse = np.diff(motion["t"]) @ np.linalg.norm(motion["thrusters.f_B"][1:], axis=1)
        own = {
            "base_displacement": Metric(float(base.max()), "m", "base from where it was at most"),
            "base_turn": Metric(float(turn.max()), "rad", "base from its first attitude at most"),
            "joint_motion": Metric(float(joints.max()), "rad", "a joint from its first angle at most"),
            "thrust_impulse": Metric(float(impulse), "N.s", "impulse of the thrusters, whatever its direction"),
        }
        return self._push_metrics(by, "[Fernandes2020] eq. (4.4) with joints", "at rest", own)
