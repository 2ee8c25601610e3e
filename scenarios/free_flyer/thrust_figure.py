"""What the controllers command of the thrusters, and what the thrusters give."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, leave_room
from handover.scenarios.free_flyer.thrust_plots import BEYOND, QUANTITIES, commanded_wrench


def draw_thrust(
    record: Record, controllers: Sequence[str], folder: Path, shade: Callable[[Axes, bool], None]
) -> Figure:
    """Draw force and torque in B over time; commands of several controllers are added, as the thrusters do.

    The axes show what the thrusters give; commands run out of them. `shade` marks times in given axes,
    with names if so told.
    """
    t = record.time
    with figure(folder / "thrust", 2, size=(9.0, 6.2)) as axes:
        for axis, (what, quantity, unit) in zip(axes, QUANTITIES, strict=True):
            commanded = commanded_wrench(record, controllers, what)
            given = record[f"thrusters.{what}_B"]
            for i, name in enumerate("xyz"):
                axis.plot(t, commanded[:, i], color=COLOURS[i], lw=0.9, alpha=0.45, label=f"{name}, commanded")
                axis.plot(t, given[:, i], color=COLOURS[i], lw=1.2, label=f"{name}, given")
            limit = BEYOND * float(np.abs(given).max())
            if float(np.abs(commanded).max()) > limit > 0.0:
                axis.set_ylim(-limit, limit)
            axis.set(ylabel=f"{quantity.lower()} ({unit})", xlim=(t[0], t[-1]))
            shade(axis, axis is axes[0])
            leave_room(axis)
        axes[1].set_xlabel("time (s)")
        handles, labels = axes[0].get_legend_handles_labels()
        axes[0].figure.legend(handles, labels, ncols=(len(labels) + 1) // 2, loc="outside lower center")
    caption = (
        "Force and torque on the robot in B; pale: as commanded, where the thrusters give less, cut off far beyond."
    )
    return Figure("thrust", caption)
