"""What the controllers command of the thrusters, and what the thrusters give."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenarios.experiment import Figure
from scenarios.plotting import COLOURS, figure
from scenarios.record import Record

_BEYOND = 2.0
"""How far the axes reach beyond what the thrusters give at most: a command may be twenty times as much."""


def draw_thrust(record: Record, controllers: Sequence[str], folder: Path) -> Figure:
    """Draw force and torque in B over time; commands of several controllers are added, as the thrusters do.

    The axes show what the thrusters give; commands run out of them.
    """
    t = record.time
    with figure(folder / "thrust", 2, size=(8.0, 5.0)) as axes:
        for axis, (what, unit) in zip(axes, (("f", "force (N)"), ("tau", "torque (N m)")), strict=True):
            commanded = np.sum([record[f"{name}.{what}_cmd"] for name in controllers], axis=0)
            given = record[f"thrusters.{what}_B"]
            for i, name in enumerate("xyz"):
                axis.plot(t, commanded[:, i], color=COLOURS[i], lw=0.9, alpha=0.45)
                axis.plot(t, given[:, i], color=COLOURS[i], lw=1.2, label=name)
            limit = _BEYOND * float(np.abs(given).max())
            if float(np.abs(commanded).max()) > limit > 0.0:
                axis.set_ylim(-limit, limit)
            axis.set(ylabel=unit, xlim=(t[0], t[-1]))
        axes[1].set_xlabel("time (s)")
        axes[0].legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    caption = (
        "Force and torque on the robot in B; pale: as commanded, where the thrusters give less, cut off far beyond."
    )
    return Figure("thrust", caption)
