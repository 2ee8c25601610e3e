"""What the report draws over time of the wrench that is commanded and of the one that the thrusters give."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, TimePlot

BEYOND = 2.0
"""How far plots reach beyond what the thrusters give at most: a command may be twenty times as much."""

QUANTITIES = (("f", "Force", "N"), ("tau", "Torque", "N·m"))


def commanded_wrench(record: Record, controllers: Sequence[str], what: str) -> Floats:
    """Return the sum of commands, as the thrusters take it, in B, shape (rows, 3); `what` is `f` or `tau`."""
    return np.sum([record[f"{name}.{what}_cmd"] for name in controllers], axis=0)


def plot_thrust(record: Record, controllers: Sequence[str], phases: str = "") -> list[TimePlot]:
    """Return force and torque on the robot in B; commands far beyond what the thrusters give are left out."""
    plots: list[TimePlot] = []
    for what, name, unit in QUANTITIES:
        given, commanded = record[f"thrusters.{what}_B"], commanded_wrench(record, controllers, what)
        limit = BEYOND * float(np.abs(given).max(initial=0.0))
        if limit > 0.0:
            commanded = np.where(np.abs(commanded) <= limit, commanded, np.nan)
        curves: list[Curve] = []
        for i, axis in enumerate("xyz"):
            curves.append(Curve(label=f"{axis}, given", values=given[:, i], group=axis))
            told = f"{axis}, commanded"
            curves.append(Curve(label=told, values=commanded[:, i], held=True, faint=True, group=axis))
        title = f"{name} of the thrusters in B"
        plots.append(TimePlot(title=title, quantity=name.lower(), unit=unit, curves=curves, phases=phases))
    return plots
