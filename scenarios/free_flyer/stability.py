"""What the robot's controllers found out about their own closed loops at the start."""

import math
from collections.abc import Sequence

from cosim.signals import Signals
from scenarios.experiment import Metric

_PERIOD = 2 / 125
"""Period of the controllers, s."""


def stability_metrics(signals: Signals, controllers: Sequence[str]) -> dict[str, Metric]:
    """Return size of the outermost pole, least damping ratio, and frequency of each controller's closed loop."""
    made: dict[str, Metric] = {}
    for name in controllers:
        radius, damping, frequency = (
            float(signals[f"{name}.{what}"]) for what in ("pole_radius", "damping_ratio", "pole_frequency")
        )
        told = f"{name} control, by its own model"
        made[f"pole_radius_{name}"] = Metric(radius, "1", f"outermost pole, below 1 if stable: {told}")
        slowest = -_PERIOD / math.log(radius) if 0.0 < radius < 1.0 else math.inf
        made[f"slowest_decay_{name}"] = Metric(slowest, "s", f"time constant of the outermost pole: {told}")
        made[f"damping_ratio_{name}"] = Metric(damping, "1", f"least damping ratio: {told}")
        made[f"frequency_{name}"] = Metric(frequency, "rad/s", f"frequency of the least damped poles: {told}")
    return made
