"""What the robot's controllers found out about their own closed loops at the start."""

import math
from collections.abc import Sequence

from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Metric

_SLOWEST = {"pose": "the slowest mode, the integrator's"}
_PERIOD = 2 / 125
"""Period of the controllers, s."""


def stability_metrics(signals: Signals, controllers: Sequence[str]) -> dict[str, Metric]:
    """Return the outermost pole's margin and decay, and the least damping ratio, of each controller's closed loop."""
    made: dict[str, Metric] = {}
    for name in controllers:
        radius, damping, frequency = (
            float(signals[f"{name}.{what}"]) for what in ("pole_radius", "damping_ratio", "pole_frequency")
        )
        told = f"{name} control, by its own model"
        made[f"pole_margin_{name}"] = Metric(
            1.0 - radius, "1", f"outermost pole to unit circle, 1 - |z|, above 0 if stable: {told}"
        )
        slowest = -_PERIOD / math.log(radius) if 0.0 < radius < 1.0 else math.inf
        made[f"slowest_decay_{name}"] = Metric(
            slowest, "s", f"time constant of {_SLOWEST.get(name, 'the slowest mode')}: {told}"
        )
        made[f"damping_ratio_{name}"] = Metric(damping, "1", f"least damping ratio: {told}")
        made[f"frequency_{name}"] = Metric(frequency, "rad/s", f"frequency of the least damped poles: {told}")
    return made
