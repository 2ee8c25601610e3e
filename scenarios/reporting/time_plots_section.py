"""Draws what a scenario gives to be drawn over time."""

from collections.abc import Sequence
from itertools import cycle, pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.reporting.plot_html import COLOURS, plot_html
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.thinned import changes_of, rows_of_curve, rows_of_steps

TIME_AXIS = "time (s)"
_MOST = 900
"""Points of a curve: more than a plot has pixels for."""
_MOST_PHASES = 200
_DASHES = ("dash", "longdashdot")
"""Of a plot's levels."""


def time_plots_section(plots: Sequence[TimePlot], record: Record) -> Section | None:
    """Return the plots below each other; None where there are none.

    Raises:
        KeyError: the record has no signal that a plot names.
    """
    if not plots:
        return None
    html = Markup("").join(
        Markup("<h3>{}</h3>").format(p.title) + plot_html(time_figure(p, record), height=280, label=p.title)
        for p in plots
    )
    return Section(anchor="time", title="Over time", html=html, scripts=("phases.js",))


def time_figure(plot: TimePlot, record: Record) -> go.Figure:
    """Return a plot as a figure, with its unit at the axis and at each value told; the page draws the phases."""
    colours = _colours(plot.curves)
    meta: dict[str, Any] = {"time": True}
    if plot.phases:
        meta["phases"] = _phases(record, plot.phases)
    return go.Figure(
        [
            *(_trace(c, record.time, plot.unit, colour) for c, colour in zip(plot.curves, colours, strict=True)),
            *(_level(level, record.time, plot.unit, dash) for level, dash in zip(plot.levels, cycle(_DASHES))),
        ],
        {
            "meta": meta,
            "hovermode": "x unified",
            "showlegend": len(plot.curves) + len(plot.levels) > 1
            or bool(plot.curves[:1] and plot.curves[0].label != plot.quantity),
            "xaxis": {"title": {"text": TIME_AXIS}, "unifiedhovertitle": {"text": "%{x:.4~f} s"}},
            "yaxis": {"title": {"text": _with_unit(plot)}, "exponentformat": "power",
                      **({"type": "log", "dtick": 1} if plot.logarithmic else {"type": "linear"})},
        },
    )  # fmt: skip


def _with_unit(plot: TimePlot) -> str:
    return f"{plot.quantity} ({plot.unit})" if plot.unit else plot.quantity


def _colours(curves: Sequence[Curve]) -> list[str]:
    groups = list(dict.fromkeys(c.group or c.label for c in curves))
    return [f"var(--c{groups.index(c.group or c.label) % COLOURS})" for c in curves]


def _trace(curve: Curve, time: Floats, unit: str, colour: str) -> Any:
    values = np.asarray(curve.values, dtype=np.float64)
    rows = rows_of_steps(values, _MOST) if curve.held else rows_of_curve(values, _MOST)
    drawn: dict[str, Any] = {"width": 1.2, "dash": "dot"} if curve.faint else {"width": 1.8}
    return go.Scatter(
        x=time[rows].astype(np.float32),
        y=values[rows].astype(np.float32),
        name=curve.label,
        mode="lines",
        line={**drawn, "color": colour, "shape": "hv" if curve.held else "linear"},
        hovertemplate="%{y:.4~g}" + (f" {unit}" if unit else ""),
        connectgaps=False,
    )


def _level(level: Level, time: Floats, unit: str, dash: str) -> Any:
    return go.Scatter(
        x=[float(time[0]), float(time[-1])],
        y=[level.value, level.value],
        name=f"{level.label}: {level.value:.4g} {unit}".rstrip(),
        mode="lines",
        line={"color": "var(--soft)", "width": 1.2, "dash": dash},
        hoverinfo="skip",
    )


def _phases(record: Record, signal: str) -> list[dict[str, Any]]:
    """Return when each phase began and ended, s, and its name; the longest ones where there are too many to be seen."""
    values, names, time = record[signal], record.items(signal), record.time
    edges = [0, *changes_of(values.astype(np.float64)).tolist(), len(time) - 1]
    longest = sorted(pairwise(edges), key=lambda span: float(time[span[0]] - time[span[1]]))[:_MOST_PHASES]
    return [
        {"from": float(time[a]), "to": float(time[b]), "name": _told(names, int(values[a]))} for a, b in sorted(longest)
    ]


def _told(names: dict[int, str], value: int) -> str:
    return names.get(value, str(value)).replace("_", " ").lower()
