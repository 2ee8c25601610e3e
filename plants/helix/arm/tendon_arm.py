"""Soft arm of three tendon-driven segments with a gripper, after [Vervloet2025] sec. 3.1."""

from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import (
    R_WB,
    TERMINALS,
    Inputs,
    Outputs,
    closed_towards,
    internal_steps,
    outputs_of,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


class TendonArm:
    """Chain of rigid discs and elastic elements, pulled by nine tendons, after [Vervloet2025] sec. 2.1, 3.1.

    Each element obeys N = EA eps, Q = GA gamma, M = EI kappa, M_z = GJ tau, with damping on all but shear. A tendon is
    a spring through the discs of its segment that goes slack; it pulls with k L_c (L - L_0) / L_0, L_c its calibrated
    length. Motors follow dl_t as critically damped systems of second order, between end stops. The gripper closes at a
    constant rate.

    The arm hangs from the world's origin. It starts at rest for dl_t = 0, with p_WG at z = -(sum of tendon_length +
    d_gripper). A shortened tendon bends its segment towards its own angle s_k = 0, 120, 240 degrees in the base frame B
    (z down, R_WB = diag(1, -1, -1)). With l_ik = l_i - d (Dx cos s_k + Dy sin s_k), positive Dx bends towards +x of B
    and W. Positive Dy bends towards +y of B, which is -y of W.

    Quaternions are continuous: they start at (0, 1, 0, 0) and do not flip however far the arm bends.

    Raises:
        InvalidArmParameters: by the constructor, for parameters of which no arm can be built.
        StepSizeError: by `step`, for steps that are no multiple of `internal_step`.
        SolverFailure: by `step`, if there is no solution; the arm stays where it was.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = TERMINALS
    period: ClassVar[Fraction | None] = None
    variable_step: ClassVar[bool] = False
    deferred: ClassVar[tuple[str, ...]] = ("handover.plants.helix.arm.tendon_chain",)

    def __init__(self, params: Params) -> None:
        # imported here, since Exudyn takes long to load, and ports are read without it
        from handover.plants.helix.arm.tendon_chain import TendonChain
        from handover.plants.helix.arm.tendon_design import TendonDesign

        self._params = params
        self._chain = TendonChain(TendonDesign(params, "TendonArm"))
        self._grip = 0.0

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where the arm is; no time passes."""
        p_B, rotations = self._chain.poses()
        z_B = rotations.as_matrix()[:, :, 2]
        return outputs_of(
            p_B, z_B, _world_quaternion(rotations), self._params.d_gripper, self._chain.edge.tensions, self._grip
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        steps = internal_steps(dt, self._params.internal_step, "TendonArm")
        self._chain.pull(np.clip(u.dl_t, *self._params.end_stops), R_WB @ (u.f_G + u.f_P))
        self._chain.edge.advance(t, steps)
        self._grip = closed_towards(self._grip, u.closure, dt / self._params.closing_time)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return coordinates and rates of discs and motors, and the grip."""
        return pack_state((self._chain.edge.get_state(), self._grip))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this arm or of one with equal parameters."""
        system, self._grip = unpack_state(state)
        self._chain.edge.set_state(system)


def _world_quaternion(rotations: "Rotation") -> Floats:
    """Return q_W of the last of rotations in B that start at the identity and turn little from one to the next."""
    q_B = rotations.as_quat(scalar_first=True)
    flips = np.count_nonzero(np.sum(q_B[1:] * q_B[:-1], axis=1) < 0.0)
    w, x, y, z = q_B[-1] if flips % 2 == 0 else -q_B[-1]
    return np.array([-x, w, -z, y]) + 0.0  # q_WB = (0, 1, 0, 0) times q_B, without negative zeros
