"""The arm of `TendonArm` by kernels of its own, some ten times as fast: for campaigns, sweeps and learning."""

from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import (
    R_WB,
    TERMINALS,
    Inputs,
    Outputs,
    SolverFailure,
    closed_towards,
    internal_steps,
    outputs_of,
)


class TendonArmFast:
    """The arm of `TendonArm`: same ports, parameters, discs, elements, tendons and motors, without Exudyn.

    The laws are those of `TendonArm`, and so are its frames and signs. Each element's force and moment are K (log - l0)
    + D (rate), log the logarithm in SE(3) of the motion from one disc to the next, as in Exudyn's connector. The steps
    are those of the generalized-alpha method with the same spectral radius. So both arms differ only by where Newton's
    method stops, which is micrometres.

    With Numba its kernels are compiled, once for each version of their sources and of Numba; the machine code stays in
    this project's cache. Without Numba the same kernels run as plain Python, hundreds of times as slow.

    Quaternions start at (0, 1, 0, 0) and are continuous in time.

    Raises:
        InvalidArmParameters: by the constructor, for parameters of which no arm can be built.
        StepSizeError: by `step`, for steps that are no multiple of `internal_step`.
        SolverFailure: by `step`, if there is no solution; the arm stays where it was.
        InvalidState: by `set_state`, for a state of an arm with other disc counts.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = TERMINALS
    period: ClassVar[Fraction | None] = None
    variable_step: ClassVar[bool] = False
    deferred: ClassVar[tuple[str, ...]] = ("handover.plants.helix.arm.fast_chain",)

    def __init__(self, params: Params) -> None:
        # imported here, since Numba takes long to load, and ports are read without it
        from handover.plants.helix.arm.fast_chain import FastChain

        self._params = params
        self._chain = FastChain(params)
        self._grip = 0.0

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where the arm is; no time passes."""
        p_B = self._chain.motion.p
        q: Floats = self._chain.motion.q
        w, x, y, z = q[:, 0], q[:, 1], q[:, 2], q[:, 3]
        z_B: Floats = np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        q_WR = np.array([-x[-1], w[-1], -z[-1], y[-1]]) + 0.0  # (0, 1, 0, 0) times q_B, without negative zeros
        return outputs_of(p_B, z_B, q_WR, self._params.d_gripper, self._chain.tensions(), self._grip)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        steps = internal_steps(dt, self._params.internal_step, "TendonArmFast")
        failure = self._chain.advance(np.clip(u.dl_t, *self._params.end_stops), R_WB @ (u.f_G + u.f_P), steps)
        if failure is not None:
            raise SolverFailure("TendonArmFast", t + failure, "Newton's method does not converge")
        self._grip = closed_towards(self._grip, u.closure, dt / self._params.closing_time)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return positions, orientations, motors and rates, and the grip; accelerations follow from them."""
        return pack_state((*self._chain.motion, self._grip))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this arm or of one with equal parameters."""
        *parts, grip = unpack_state(state)
        if [np.shape(part) for part in parts] != [part.shape for part in self._chain.motion]:
            raise InvalidState("TendonArmFast: the state is of an arm with other disc counts, or of another unit")
        self._chain.restore(parts)
        self._grip = grip
