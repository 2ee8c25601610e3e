"""Arms that are no good to learn from."""

from dataclasses import replace

import numpy as np

from handover.plants.vsl.arm import Inputs, Outputs, VslArm


class BreakingArm(VslArm):
    """Breaks after three seconds."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > 3.0:
            raise RuntimeError("the arm broke")
        return super().step(t, dt, u)


class DistantArm(VslArm):
    """Has its tip far away."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        y = super().step(t, dt, u)
        return replace(y, p_WG_meas=y.p_WG_meas + 1.0)


class ArmWithoutGauges(VslArm):
    """Does not measure its pressures."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return replace(super().step(t, dt, u), p_meas=np.zeros(2))
