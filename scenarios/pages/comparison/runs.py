"""Runs beside each other: their metrics, and the same curves of each in one plot."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import nearest
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.parameters import parameters_of
from handover.scenarios.experiment.time_plot import Curve, TimePlot
from handover.scenarios.pages.comparison.entries import NotComparable, RunEntry
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.run_facts import elements_of
from handover.scenarios.runs.results.summary import metric_of
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_MAX_PLOTS = 6
"""Of a scenario's curves, where no signals are named."""

_MAX_ELEMENTS = 9
"""Of a signal that is an array, each of which is a plot."""

_ALIKE, _HIDDEN = 0.004, 0.2
"""Of a plot's range: curves that are nearer lie on each other; of a curve: how much of it another one may hide so."""

_HELD = 0.7
"""Of a signal's steps: one that changes in fewer is held between them, as a sampled unit's output."""

_LINE = 18
"""Letters that fit along a vertical axis."""


@dataclass(frozen=True)
class MetricRow:
    """A metric of several runs: name, unit, description, and the values by the runs' names, NaN where one has none."""

    name: str
    unit: str
    description: str
    values: Mapping[str, float]


def metric_rows(entries: Sequence[RunEntry]) -> list[MetricRow]:
    """Return the metrics that any run has, those of the headline first and those of the cost last.

    Raises:
        NotComparable: a metric has different units in two runs.
    """
    metrics = {
        e.name: {n: metric_of({"description": "", **m}) for n, m in e.facts.summary["metrics"].items()} for e in entries
    }
    names = list(dict.fromkeys(n for known in metrics.values() for n in known))
    headline = list(dict.fromkeys(n for e in entries for n in e.facts.headline))

    def place(name: str) -> tuple[int, int]:
        if name.startswith(("cpu_", "pace_", "peak_memory")):
            return 2, 0
        return (0, headline.index(name)) if name in headline else (1, 0)

    rows: list[MetricRow] = []
    faults: list[str] = []
    for name in sorted(names, key=place):
        having = {e: known[name] for e, known in metrics.items() if name in known}
        first = next(iter(having.values()))
        faults += [
            f"{e.folder}: its metric {name} is in {having[e.name].unit}, not in {first.unit}"
            for e in entries
            if e.name in having and having[e.name].unit != first.unit
        ]
        values = {e: having[e].value if e in having else np.nan for e in metrics}
        rows.append(MetricRow(name, first.unit, _description(name, [m.description for m in having.values()]), values))
    if faults:
        raise NotComparable(faults)
    return rows


def _description(name: str, descriptions: Sequence[str]) -> str:
    """Return what a metric is in all runs.

    Some add what is so in one run: in brackets, as "(sees nothing)", or, of a number that is a choice, after a colon.
    """
    shortest = min(descriptions, key=len)
    if any(not d.startswith(shortest) for d in descriptions):
        shortest = re.sub(r" \([^()]*\)$", "", shortest)
    if shortest and all(d.startswith(shortest) for d in descriptions):
        return shortest
    topics, choices = zip(*(d.split(": ", 1) if ": " in d else (d, "") for d in descriptions), strict=True)
    if len(set(topics)) == 1 and all(choices):
        return f"{topics[0]}: {'; '.join(dict.fromkeys(choices))}"
    return name.replace("_", " ")


@dataclass(frozen=True)
class Overlay:
    """Plots in which each run has its curve, over a time, s, that they share; `left_out` says what some do not have."""

    plots: Sequence[TimePlot]
    time: Floats
    left_out: Sequence[str] = ()


def overlaid(entries: Sequence[RunEntry], signals: Sequence[str] = ()) -> Overlay:
    """Return the same curves of all runs: of the signals that are named, else the first of the scenario's own plots.

    Args:
        entries: the runs.
        signals: names such as "arm.p_WG", each of whose elements is a plot, or "arm.p_WG[3]" for one of them.

    Raises:
        NotComparable: no run has a signal, it has too many elements, or its unit differs between runs.
    """
    with_record = [(e, e.record) for e in entries if e.record is not None]
    left_out = [
        f"{e.name} has no curves: its record is missing, or has less than two rows" for e in entries if not e.record
    ]
    if not with_record:
        if signals:
            raise NotComparable(["no run has a record, so there are no signals to be drawn"])
        return Overlay((), np.zeros(0), left_out)
    panels = _named(with_record, signals) if signals else _of_scenario(with_record, left_out)
    time = _common_time([record.time for _, record in with_record])
    plots = [_resampled(panel, {e.name: r.time for e, r in with_record}, time) for panel in panels]
    if signals:
        missing = [(e.name, s) for e, r in with_record for s in signals if _split(r, s) is None]
        left_out += [f"{name} has no signal {signal}" for name, signal in missing]
    return Overlay(_with_strokes(plots), time, left_out)


Panel = tuple[TimePlot, Mapping[str, Curve]]
"""A plot without curves, and the curve of each run by its name, over that run's own time."""


def _of_scenario(entries: Sequence[tuple[RunEntry, Record]], left_out: list[str]) -> Sequence[Panel]:
    """Return the main curves of the scenario's plots, each in a plot of its own, in which all runs have one."""
    panels: dict[tuple[str, str], tuple[TimePlot, dict[str, Curve]]] = {}
    for entry, record in entries:
        for plot in _plots_of(entry, record, left_out):
            main = [c for c in plot.curves if c.stroke == "solid"] or plot.curves
            for curve in main:
                key = plot.title, curve.label
                panel, curves = panels.get(key, (_panel(plot, curve, len(main)), {}))
                panels[key] = replace(panel, limits=_both_limits(panel, plot)), {**curves, entry.name: curve}
    if panels:
        return [*panels.values()][:_MAX_PLOTS]
    first = entries[0][1]
    scalars = [s for s in first.signals if first[s].dtype.kind == "f" and first[s].ndim == 1]
    return _named(entries, scalars[:_MAX_PLOTS])


def _plots_of(entry: RunEntry, record: Record, left_out: list[str]) -> Sequence[TimePlot]:
    """Return the plots that the scenario makes of a run, without what the run's units do not give."""
    experiment = entry.facts.experiment
    if experiment is None:
        left_out += [f"{entry.name} lacks {line}" for line in entry.facts.not_drawn]
        return ()
    faults, known, plots = ToleratedFaults(), LackingRecord(record, experiment.units), list[TimePlot]()
    with faults.tolerated(f"{entry.name} has no curves of the scenario's plots"):
        parameters = parameters_of(type(experiment), entry.facts.run["parameters"])
        plots += known.drawable_plots(experiment.plots(parameters, known))
    left_out += [*faults.lines, *(f"{entry.name} lacks {line}" for line in known.lines)]
    return plots


def _both_limits(panel: TimePlot, plot: TimePlot) -> tuple[float | None, float | None]:
    """Return limits of an axis within which the curves of both plots are; None where one of them sets none."""
    (low, high), (other_low, other_high) = panel.limits, plot.limits
    return (
        None if low is None or other_low is None else min(low, other_low),
        None if high is None or other_high is None else max(high, other_high),
    )


def _panel(plot: TimePlot, curve: Curve, curves: int) -> TimePlot:
    title, quantity = plot.title, plot.quantity
    if curves > 1:
        title, quantity = f"{title}: {curve.label}", f"{quantity}, {curve.label}"
    quantity = textwrap.fill(quantity, _LINE)
    return replace(plot, title=title, quantity=quantity, curves=(), levels=(), phases=(), palette=())


def _named(entries: Sequence[tuple[RunEntry, Record]], signals: Sequence[str]) -> list[Panel]:
    panels: list[Panel] = []
    faults: list[str] = []
    for signal in dict.fromkeys(signals):
        having = {e.name: (r, split) for e, r in entries if (split := _split(r, signal)) is not None}
        if not having:
            known = dict.fromkeys(s for _, r in entries for s in r.signals)
            faults.append(f"no run has a signal {signal!r}; {nearest(signal, known)}")
            continue
        units = {r.unit(name) for r, (name, _) in having.values()}
        if len(units) > 1:
            faults.append(f"signal {signal} is in {' and in '.join(sorted(units))}: it cannot be drawn along one axis")
            continue
        columns = {name: _columns(r, *split) for name, (r, split) in having.items()}
        elements = list(dict.fromkeys(title for known in columns.values() for title in known))
        if len(elements) > _MAX_ELEMENTS:
            faults.append(f"signal {signal} has {len(elements)} elements; name some of them, such as {elements[0]}")
            continue
        record, (name, _) = next(iter(having.values()))
        panels += [_panel_of(record, name, title, columns) for title in elements]
    if faults:
        raise NotComparable(faults)
    return panels


def _panel_of(record: Record, signal: str, title: str, columns: Mapping[str, Mapping[str, Floats]]) -> Panel:
    values = {name: known[title] for name, known in columns.items() if title in known}
    unit = display_unit(record.unit(signal), np.concatenate(list(values.values())))
    held = record[signal].dtype.kind != "f" or any(_is_held(v) for v in values.values())
    plot = TimePlot(title=title, quantity=title, unit=unit.symbol, curves=())
    return plot, {n: Curve(label=n, values=v * unit.factor, held=held) for n, v in values.items()}


def _is_held(values: Floats) -> bool:
    """Return whether a signal keeps its value over most steps, as a sampled unit's output does."""
    changes = np.count_nonzero(np.diff(values))
    return bool(0 < changes < _HELD * (len(values) - 1))


def _split(record: Record, signal: str) -> tuple[str, str] | None:
    """Return a signal's name and the subscript of an element, "" for all of it; None if the record does not have it."""
    if signal in record.signals:
        return signal, ""
    name, bracket, rest = signal.partition("[")
    if not bracket or name not in record.signals or signal not in _columns(record, name, ""):
        return None
    return name, f"[{rest}"


def _columns(record: Record, signal: str, subscript: str) -> dict[str, Floats]:
    """Return a signal's elements as numbers by their names; with a subscript only the one that it names."""
    columns = {name: values.astype(np.float64) for name, values in elements_of(signal, record[signal]).items()}
    return {signal + subscript: columns[signal + subscript]} if subscript else columns


def _common_time(times: Sequence[Floats]) -> Floats:
    """Return the times of all records; those of one, with events' two rows at one time, where all have the same."""
    if all(np.array_equal(t, times[0]) for t in times):
        return times[0]
    return np.unique(np.concatenate(times))


def _resampled(panel: Panel, times: Mapping[str, Floats], time: Floats) -> TimePlot:
    plot, curves = panel
    own = [Curve(label=n, values=at_times(c, times[n], time), held=c.held, group=n) for n, c in curves.items()]
    return replace(plot, curves=own, palette=list(times))


def at_times(curve: Curve, own: Floats, time: Floats) -> Floats:
    """Return a curve's values at other times: on lines, or held; NaN beyond its last time, and beside its gaps."""
    values = np.asarray(curve.values, dtype=np.float64)
    last = values[np.maximum(np.searchsorted(own, time, side="right") - 1, 0)]  # of an event's two rows the second
    is_exact = curve.held | np.isin(time, own)
    inside = (time >= own[0]) & (time <= own[-1])
    return np.where(inside, np.where(is_exact, last, np.interp(time, own, values)), np.nan)


def _with_strokes(plots: Sequence[TimePlot]) -> list[TimePlot]:
    """Dash the curves of runs that elsewhere lie on those of a run before them, so that both are seen."""
    dashed = {c.label for plot in plots for k, c in enumerate(plot.curves) if _is_hidden(c, plot.curves[:k])}
    return [
        replace(p, curves=[replace(c, stroke="dashed") if c.label in dashed else c for c in p.curves]) for p in plots
    ]


def _is_hidden(curve: Curve, below: Sequence[Curve]) -> bool:
    drawn = np.isfinite(curve.values)
    if not drawn.any():
        return False
    for other in below:
        both = np.concatenate([curve.values, other.values])
        tolerance = _ALIKE * float(np.nanmax(both) - np.nanmin(both))
        with np.errstate(invalid="ignore"):
            near = np.abs(curve.values - other.values) <= tolerance
        if np.count_nonzero(near) > _HIDDEN * np.count_nonzero(drawn):
            return True
    return False
