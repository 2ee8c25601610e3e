"""An arm that fails during a run, to test how the run ends."""

from handover.plants.helix.arm.tendon_arm import Inputs, Outputs, TendonArm


class FailingArm(TendonArm):
    """The Helix until a tendon tears."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > 0.29:
            raise RuntimeError("a tendon tore")
        return super().step(t, dt, u)
