"""What a page shows of a run under way: its scene once, then where everything is, and its plots until now."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.growing_record import GrowingRecord
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.live_inputs import HandHint, LedHand, Pushable
from handover.scenarios.experiment.replay import Body, Line, Replay
from handover.scenarios.experiment.time_plot import Curve, TimePlot, phases_of
from handover.scenarios.live.hand_messages import HandSample
from handover.scenarios.runs.reporting.replay_section import (
    Drawn,
    drawn_groups,
    legend_html,
    scene_content,
    views_html,
)
from handover.scenarios.runs.results.run_facts import elements_of
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_AROUND = 0.25
"""Room around what is drawn at first, as a share of its longest side: things move."""
_MAX_CURVES = 9
_MAX_ROWS = 4000
"""Rows of the past that are kept: what is computed of one row and the one before it, as the mean of a step, has errors
where rows between them are left out."""

Row = tuple[float, list[NDArray[Any]]]
"""Time in s, and the values of a row of a growing record."""


class ThinnedRows:
    """Of rows that come one after the other every n-th and the newest, n such that they are no more than so many.

    Args:
        most: rows that are kept, and the newest besides.
    """

    def __init__(self, most: int) -> None:
        self._most, self._every, self._count = most, 1, 0
        self._kept: list[Row] = []
        self._newest: list[Row] = []

    def add(self, rows: Sequence[Row]) -> None:
        """Add the rows that have come."""
        for row in rows:
            self._newest = [row]
            if self._count % self._every == 0:
                self._kept.append(row)
                self._newest = []
                if len(self._kept) > self._most:
                    self._newest = self._kept[-1:] if len(self._kept) % 2 == 0 else []
                    del self._kept[1::2]
                    self._every *= 2
            self._count += 1

    @property
    def rows(self) -> Sequence[Row]:
        """What is kept, in the order in which it came."""
        return [*self._kept, *self._newest]


class History(Record):
    """The rows of a growing record until now, evenly thinned, as a record over time: plots are made of them.

    Those are left out that came while nobody looked, and were flushed to the disk meanwhile.
    """

    def __init__(self, record: GrowingRecord) -> None:
        vars(self).update(vars(record))
        self._record, self._thinned = record, ThinnedRows(_MAX_ROWS)
        self._stacked: dict[str, NDArray[Any]] = {}
        self.add()

    def add(self) -> None:
        """Add the growing record's newest row, and those that came since the one before."""
        self._thinned.add(self._record.unseen)
        self._rows = self._thinned.rows
        self._stacked.clear()
        self.time = np.array([t for t, _ in self._rows])

    def _metadata(self, signal: str) -> dict[bytes, bytes]:
        return self._record.metadata(signal)

    def _values(self, name: str) -> NDArray[Any]:
        if name == "time":
            return self.time
        if name not in self._stacked:
            part, index = self._record.places[name]
            self._stacked[name] = np.array([row[part][index] for _, row in self._rows])
        return self._stacked[name]


class LiveScene:
    """The scene of a growing record, and plots of what was seen of it.

    Args:
        experiment: whose replay and plots are shown; None for a system without.
        parameters: of the run.
        record: whose newest row is shown; `refresh` reads it.
    """

    def __init__(self, experiment: Experiment[Any] | None, parameters: Any, record: GrowingRecord) -> None:
        self._growing = record
        self._past = History(record)
        self._show(experiment, parameters, record, self._past)

    def _show(self, experiment: Experiment[Any] | None, parameters: Any, row: Record, history: Record) -> None:
        self._experiment, self._parameters = experiment, parameters
        self._record, self._history = row, history
        self._faults = ToleratedFaults()
        self._shown = self._replay()

    def refresh(self) -> bool:
        """Take the newest row; return whether there is one."""
        if not self._growing.refresh():
            return False
        self._past.add()
        self._shown = self._replay()
        return True

    def complete(self, record: Record) -> None:
        """Show the end of a run that is over, and plots of all its rows."""
        self._history, self._record = record, record.row(-1)
        self._shown = self._replay()

    @property
    def time(self) -> float:
        """Simulated time of the newest row, s."""
        return float(self._record.time[0])

    @property
    def pushes(self) -> Sequence[Pushable]:
        """What can be pushed in the scene."""
        with self._faults.tolerated("pushes"):
            return () if self._experiment is None else self._experiment.pushes(self._parameters)
        return ()

    @property
    def hand_hint(self) -> HandHint | None:
        """What helps who leads a hand; None where nothing does."""
        with self._faults.tolerated("hints for the hand"):
            return None if self._experiment is None else self._experiment.hand_hint(self._parameters, self._record)
        return None

    @property
    def newest(self) -> Record:
        """The newest row."""
        return self._record

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals that can be plotted."""
        return self._record.signals

    def content(self) -> dict[str, Any] | None:
        """Return the scene with everything where it is now; None where the scenario has none."""
        return None if self._shown is None else scene_content(self._shown, self._record, room=_AROUND)

    def content_for_person(self, fixed: Sequence[Line] = ()) -> dict[str, Any] | None:
        """Return the scene as the person in it sees it, above a floor on which shadows tell how near things are.

        Args:
            fixed: what is drawn besides, after all else; the page moves it.
        """
        if self._shown is None:
            return None
        seen = replace(self._shown, fixed=[*self._shown.fixed, *fixed], weightless=False)
        view = seen.person_view
        if view is not None:
            seen = replace(seen, eye=view.eye, window=view.window, floor=float(view.window[0, 2]))
        return scene_content(seen, self._record)

    def surroundings(self) -> dict[str, Markup]:
        """Return legend and views of the scene, as HTML."""
        if self._shown is None:
            return {}
        drawn = [d for group in drawn_groups(self._shown, self._record) for d in group]
        return {"legend": legend_html(drawn), "views": views_html(self._shown)}

    def places(self) -> Floats:
        """Return where all that is drawn is, in the order of the scene's traces and their parts."""
        if self._shown is None:
            return np.zeros(0)
        numbers = [n for group in drawn_groups(self._shown, self._record) for d in group for n in _numbers(d)]
        return np.concatenate([n.astype(np.float64) for n in numbers])

    @property
    def phase(self) -> str:
        """What the run is doing, in words; "" where its scene names no phase."""
        if self._shown is None or not self._shown.phases:
            return ""
        named = self._shown.phases
        phases = phases_of(self._record, named) if isinstance(named, str) else named
        begun = [p for p in phases if p.begin <= self.time and (p.end > p.begin or len(phases) == 1)]
        return begun[-1].name if begun else ""

    def plots(self, chosen: Sequence[str] = ()) -> list[TimePlot]:
        """Return plots of what was seen until now: those of chosen signals, then the scenario's."""
        if len(self._history.time) < 2:
            return []
        own: list[TimePlot] = []
        with self._faults.tolerated("plots"):  # some need more than what was seen until now
            own += self._own_plots()
        return [self._plot_of(signal) for signal in chosen if signal in self._history] + own

    def _own_plots(self) -> Sequence[TimePlot]:
        """Return the scenario's plots; where it has none, or there is no scenario, those of the units' outputs."""
        own = () if self._experiment is None else self._experiment.plots(self._parameters, self._history)
        if own:
            return own
        from handover.scenarios.runs.reporting.run_figures import figures_of_outputs  # matplotlib is slow to import

        units = dict.fromkeys(signal.rpartition(".")[0] for signal in self._history.signals)
        return [plot for figure in figures_of_outputs(units, self._history) for plot in figure.plots]

    @property
    def history(self) -> Record:
        """What was seen until now."""
        return self._history

    def wanted_hand(self, led: LedHand) -> HandSample:
        """Return where a hand is wanted in the newest row; at its rest, open, where the record does not tell."""
        names = [f"{led.unit}.{name}" for name in ("p_WH_goal", "q_WH_goal", "finger_goal", "closed_goal")]
        if not all(name in self._record for name in names):
            return HandSample.at_rest(led, self.time)
        p, q_WH, angles = (tuple(self._record[name][-1].tolist()) for name in names[:3])
        return HandSample(p, q_WH, angles, closed=bool(self._record[names[3]][-1]), stamp=self.time)

    def _plot_of(self, signal: str) -> TimePlot:
        values, is_named = self._history[signal], bool(self._history.items(signal))
        held, phases = values.dtype.kind != "f", phases_of(self._history, signal) if is_named else ()
        elements = list(elements_of(signal, values.astype(np.float64)).items())[:_MAX_CURVES]
        curves = [Curve(label=name, values=element, held=held) for name, element in elements]
        quantity = self._history.description(signal) or signal
        unit = unit_symbol(self._history.unit(signal))
        return TimePlot(title=signal, quantity=quantity, unit=unit, curves=curves, phases=phases)

    def _replay(self) -> Replay | None:
        with self._faults.tolerated("the scene"):
            return None if self._experiment is None else self._experiment.replay(self._parameters, self._record)
        return None


class RecordedScene(LiveScene):
    """The scene of a run that is over, at any time of its record, and its plots."""

    def __init__(self, experiment: Experiment[Any] | None, parameters: Any, record: Record) -> None:
        self._show(experiment, parameters, record.row(0), record)

    def refresh(self) -> bool:
        """Return False: there is no newer row."""
        return False

    @property
    def begin(self) -> float:
        """Time of the first row, s."""
        return float(self._history.time[0])

    @property
    def end(self) -> float:
        """Time of the last row, s."""
        return float(self._history.time[-1])

    def after(self, t: float) -> float:
        """Return the time of the row after the one at t, s."""
        later = self._history.time[self._history.time > t]
        return float(later[0]) if len(later) else self.end

    def go_to(self, t: float) -> None:
        """Show the last row at or before a time, s."""
        row = int(np.searchsorted(self._history.time, t, side="right")) - 1
        self._record = self._history.row(max(row, 0))
        self._shown = self._replay()


def _numbers(drawn: Drawn) -> Sequence[Floats]:
    if isinstance(drawn, Body):
        return (drawn.p_WB[-1],) if drawn.q_WB is None else (drawn.p_WB[-1], drawn.q_WB[-1])
    return (drawn.points[-1].ravel(),)
