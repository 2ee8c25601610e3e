"""The chain of `TendonArmFast`: the design's numbers as its kernels take them, and the motion that they advance."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.fast_forces import Chain
from handover.plants.helix.arm.fast_motion import Motion, advance
from handover.plants.helix.arm.tendon_design import TendonDesign
from handover.plants.helix.arm.tendon_parameters import Params


class FastChain:
    """Discs joined by constant-strain beam elements and pulled by nine tendons, in the base frame B (z down).

    It starts at rest, hanging straight. Loading this module loads the compiled kernels, too.

    Raises:
        InvalidArmParameters: there is no such chain.
    """

    def __init__(self, params: Params) -> None:
        design = TendonDesign(params, "TendonArmFast")
        n = design.count
        self._internal_step = params.internal_step
        self._motor_stiffness = design.motor_stiffness
        self._chain = chain_of(design)
        self._numbers = np.array(self._chain[5:])
        p, q, motors = np.zeros((n + 1, 3)), np.zeros((n + 1, 4)), np.array(design.rest_motor)
        p[:, 2] = design.rest_z
        q[:, 0] = 1.0
        self._tensions: Floats | None = None
        self.motion = Motion(p, q, motors, np.zeros(6 * n + 15))

    def advance(self, dl_t: Floats, f_G: Floats, steps: int) -> float | None:
        """Advance by internal steps with tendon length changes, (9,), in m, and a force on the gripper in B, in N.

        Returns:
            None, or after how many seconds there is no solution; then the motion is as before.
        """
        before: list[Floats] = [np.array(part) for part in self.motion]
        failure, tensions = self._call(self._motor_stiffness * dl_t, f_G, steps)
        if failure < 0.0:
            self._tensions = tensions
            return None
        self.restore(before)
        return failure

    def restore(self, motion: Sequence[Floats]) -> None:
        """Take over a motion of the same shapes."""
        for part, value in zip(self.motion, motion, strict=True):
            part[:] = value
        self._tensions = None

    def tensions(self) -> Floats:
        """Return the forces in the tendons, (9,), in N; negative in a slack one."""
        if self._tensions is None:
            self._tensions = self._call(np.zeros(9), np.zeros(3), 0)[1]
        return self._tensions

    def _call(self, command: Floats, f_G: Floats, steps: int) -> tuple[float, Floats]:
        tension = np.zeros(9)
        h = self._internal_step
        return advance(*self._chain[:5], self._numbers, *self.motion, command, f_G, h, steps, tension), tension


def chain_of(design: TendonDesign) -> Chain:
    """Return a design as the kernels take it."""
    p = design.params
    stiffness = design.section_stiffness / design.natural[:, None]
    return Chain(
        nodes=np.column_stack([design.mass, design.transverse_inertia, design.axial_inertia, design.centre]),
        beams=np.column_stack([design.natural, stiffness, design.damping_times * stiffness]),
        ends=np.array(design.ends, dtype=np.int64),
        holes=np.array(design.holes),
        tendons=np.column_stack([design.tendon_EA, design.tendon_DA, design.reference_length]),
        slack_force=p.slack_force,
        motor_mass=design.motor_mass,
        motor_rate=2.0 * np.pi * p.motor_frequency,
        gravity=p.gravity,
        gripper=p.d_gripper,
    )


FastChain(Params()).tensions()  # loads the machine code, or makes it: hosts grant loading more time than a step
