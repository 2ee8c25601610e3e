"""The record of a run whose units lack outputs that the scenario's figures and replay show.

Another unit may stand in the place of a scenario's own, with fewer outputs. What they would have been is unknown, so
they are NaN: curves of them are left out, marks in space are hidden, and the rest of the report is as ever.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Kind, Variable
from handover.cosim.record.reader import Record
from handover.fmus.catalog import UnknownBlock, UnknownUnit, find_unit, import_class
from handover.scenarios.experiment.replay import Body, Replay
from handover.scenarios.experiment.returned_types import WrongType, described
from handover.scenarios.experiment.time_plot import SERIES, TimeFigure, TimePlot


class LackingRecord(Record):
    """A record of which an output that a scenario's own unit has, and the run's unit lacks, is NaN at all times.

    Args:
        record: what was recorded.
        units: the scenario's: the unit, or the path of its block, by name in the system.

    Attributes:
        lacking: the outputs that were asked for and are not there, in the order of asking.
    """

    def __init__(self, record: Record, units: Mapping[str, str]) -> None:
        vars(self).update(vars(record))
        self.lacking: list[str] = []
        self._units = units

    def __getitem__(self, signal: str) -> NDArray[Any]:
        """Return a signal over time; NaN, in the shape of the scenario's own unit's, if it was not recorded.

        Raises:
            KeyError: it was not recorded, and no unit of the scenario has it.
        """
        if signal in self.signals or signal == "time":
            return super().__getitem__(signal)
        declared = self._declared(signal)
        if declared is None:
            return super().__getitem__(signal)
        if signal not in self.lacking:
            self.lacking.append(signal)
        return np.full((len(self.time), *declared.shape), np.nan)

    def _metadata(self, signal: str) -> dict[bytes, bytes]:
        return super()._metadata(signal) if signal in self else {}

    def _declared(self, signal: str) -> Variable | None:
        """Return the output as the scenario's own unit declares it; None if there is none, or it is never recorded."""
        unit, _, port = signal.partition(".")
        try:
            block = import_class(find_unit(self._units.get(unit, "")).block)
            outputs = {v.name: v for v in describe(block).outputs}
        except (UnknownUnit, UnknownBlock, DeclarationError):
            return None
        found = outputs.get(port)
        return None if found is None or found.kind in (Kind.STRING, Kind.BINARY) else found

    @property
    def lines(self) -> list[str]:
        """What is left out for want of outputs: a line, or none."""
        if not self.lacking:
            return []
        return [f"what is drawn from {', '.join(sorted(self.lacking))}, which the run's units do not have"]

    def drawable(self, figures: Sequence[TimeFigure]) -> Sequence[TimeFigure]:
        """Return time figures without curves of which nothing is known, nor plots and figures that have no other."""
        kept = [replace(f, plots=self.drawable_plots(f.plots)) for f in figures]
        return [f for f in kept if f.plots]

    def drawable_plots(self, plots: Sequence[TimePlot]) -> Sequence[TimePlot]:
        """Return plots with the curves that have values, each in its colour; a plot without any is left out.

        Raises:
            WrongType: a curve has more or fewer values than the record has rows.
        """
        for plot in plots:
            self._check_rows(plot)
        if not self.lacking:
            return plots
        kept: list[TimePlot] = []
        for plot in plots:
            curves = [c for c in plot.curves if np.isfinite(c.values).any()]
            if curves:
                palette = tuple(dict.fromkeys([*plot.palette, *(c.group or c.label for c in plot.curves)]))
                kept.append(replace(plot, curves=curves, palette=palette))
        return kept

    def _check_rows(self, plot: TimePlot) -> None:
        for curve in plot.curves:
            if len(curve.values) != len(self.time):
                what = f"the values of Curve {curve.label!r} in TimePlot {plot.title!r} are"
                raise WrongType(what, described(curve.values), f"{SERIES.right}, here {len(self.time)}", SERIES.example)

    def drawable_replay(self, replay: Replay) -> Replay | None:
        """Return a replay without what has no place at any time; None if nothing has one."""
        if not self.lacking:
            return replay
        lines = [line for line in replay.lines if np.isfinite(line.points).any()]
        bodies = [b for b in replay.bodies if _has_place(b)]
        return replace(replay, lines=lines, bodies=bodies) if lines or bodies else None


def _has_place(body: Body) -> bool:
    known = np.isfinite(body.p_WB).all(axis=1)
    return bool((known if body.q_WB is None else known & np.isfinite(body.q_WB).all(axis=1)).any())
