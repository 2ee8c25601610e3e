"""Arms that are no good to learn from."""

from plants.vsl_arm import Inputs, Outputs, VslArm


class BreakingArm(VslArm):
    """Breaks after three seconds."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > 3.0:
            raise RuntimeError("the arm broke")
        return super().step(t, dt, u)
