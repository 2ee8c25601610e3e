"""The sections of a page with curves over time: a scenario's own plots, and an explorer of all recorded signals.

Both downsample: a page holds few rows of a signal, which look like all of them (`rows_of_curve`, `rows_of_steps`).
"""

import base64
from collections.abc import Mapping, Sequence
from itertools import cycle, product
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup
from numpy.typing import NDArray
from tsdownsample import MinMaxLTTBDownsampler

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.time_plot import Curve, Phase, TimePlot
from handover.scenarios.runs.reporting.html import json_html, plot_html
from handover.scenarios.runs.reporting.page import Section, template

Rows = NDArray[np.int64]


def rows_of_curve(values: Floats, max_rows: int) -> Rows:
    """Return rows of a curve, shape (rows,), between which straight lines look like it; about `max_rows` at most.

    Gaps (NaN) stay gaps. Rows are selected by MinMaxLTTB: extremes first, then the largest triangles.
    """
    if len(values) <= max_rows:
        return np.arange(len(values))
    finite = np.isfinite(values)
    rows = np.flatnonzero(finite)
    if len(rows) > max_rows:
        selected = MinMaxLTTBDownsampler().downsample(np.ascontiguousarray(values[rows]), n_out=max_rows)
        rows = rows[selected.astype(np.int64)]
    gaps = np.flatnonzero(~finite & np.concatenate(([True], finite[:-1])))  # the first row of each
    return np.union1d(rows, gaps[:max_rows])


def rows_of_steps(values: Floats, max_rows: int) -> Rows:
    """Return the rows where a held value changes, the first and the last; `rows_of_curve` if they are too many.

    The row before a gap (NaN) is among them: the value is drawn until there.
    """
    if len(values) == 0:
        return np.zeros(0, np.int64)
    changes = changes_of(values)
    if len(changes) > max_rows:
        return rows_of_curve(values, max_rows)
    before_gaps = changes[np.isnan(values[changes])] - 1
    return np.unique(np.concatenate((changes, before_gaps, [0, len(values) - 1])))


def changes_of(values: Floats) -> Rows:
    """Return the rows whose value differs from the one before; NaN after NaN is not a change."""
    before, after = values[:-1], values[1:]
    return np.flatnonzero((before != after) & ~(np.isnan(before) & np.isnan(after))) + 1


TIME_AXIS = "time (s)"
_MAX_ROWS = 900
"""Points of a curve: more than a plot has pixels for."""
_MAX_PHASES = 200
_STROKES: dict[str, dict[str, Any]] = {
    "solid": {"width": 1.8},
    "dashed": {"width": 1.8, "dash": "dash"},
    "dotted": {"width": 1.2, "dash": "dot"},
}
_LEVELS = ("longdash", "longdashdot")
_MAX_PANELS = 6
_HEIGHT, _PANEL, _GAP, _MARGINS = 280, 180, 40, 74
"""Heights of a figure of one plot, of each panel more, between two panels, and above and below all axes, px."""


def time_plots_section(plots: Sequence[TimePlot], time: Floats) -> Section | None:
    """Return plots below each other, over the record's time, s; None where there are none.

    Plots that follow each other with the same legend and phases are panels of one figure. Names of phases that do not
    fit over them take room above the first figure of these phases only.
    """
    html, named = Markup(), list[Sequence[Phase]]()
    for first, *below in _panels(plots):
        figure = time_figure(first, time, below, brief=first.phases in named)
        label, height = "; ".join(p.title for p in (first, *below)), _HEIGHT + _PANEL * len(below)
        html += Markup("<h3>{}</h3>").format(first.title) + plot_html(figure, height=height, label=label)
        named.append(first.phases)
    return Section(anchor="time", title="Over time", html=html, scripts=("phases.js",)) if plots else None


def _panels(plots: Sequence[TimePlot]) -> list[list[TimePlot]]:
    """Return the plots of each figure."""
    figures: list[list[TimePlot]] = []
    for plot in plots:
        last = figures[-1] if figures else []
        if last and len(last) < _MAX_PANELS and plot.phases == last[0].phases and _legend(plot) == _legend(last[0]):
            last.append(plot)
        else:
            figures.append([plot])
    return figures


def _legend(plot: TimePlot) -> Sequence[object]:
    entries = [(c.label, colour, c.stroke) for c, colour in zip(plot.curves, plot.colours, strict=True)]
    return (*entries, *plot.level_labels) if plot.has_legend else ()


def time_figure(plot: TimePlot, time: Floats, below: Sequence[TimePlot] = (), *, brief: bool = False) -> go.Figure:
    """Return a plot as a Plotly figure, with its unit at the axis and in tooltips; the page's script adds phases.

    Args:
        plot: what is drawn.
        time: the record's, s.
        below: plots of the same phases and legend, which are drawn as panels below it.
        brief: whether names of phases that do not fit over them are left out.
    """
    meta: dict[str, Any] = {"time": True}
    if plot.phases:
        meta |= {"phases": _phases(plot.phases), "brief": brief}
    panels = (plot, *below)
    gap = _GAP / (_HEIGHT + _PANEL * len(below) - _MARGINS) if below else 0.0
    high = (1.0 - gap * len(below)) / len(panels)
    tops = [1.0 - k * (high + gap) for k in range(len(panels))]
    axes = {
        _axis_name(k).replace("y", "yaxis"): _axis(p, top - high, top)
        for k, (p, top) in enumerate(zip(panels, tops, strict=True))
    }
    return go.Figure(
        [trace for k, panel in enumerate(panels) for trace in _traces(panel, time, k)],
        {
            "meta": meta,
            "hovermode": "x unified",
            "showlegend": plot.has_legend,
            "legend": {"traceorder": "normal"},
            "xaxis": {
                "title": {"text": TIME_AXIS},
                "unifiedhovertitle": {"text": "%{x:.4~f} s"},
                "anchor": _axis_name(len(below)),
            },
            **axes,
            "annotations": [_title(p.title, top) for p, top in zip(below, tops[1:], strict=True)],
        },
    )


def _axis_name(k: int) -> str:
    """Return the vertical axis of a panel, by its number from the top, as Plotly's traces name it."""
    return f"y{k + 1}" if k else "y"


def _axis(plot: TimePlot, bottom: float, top: float) -> dict[str, Any]:
    kind = {"type": "log", "dtick": 1} if plot.logarithmic else {"type": "linear"}
    shown = {} if plot.shown_range is None else {"range": plot.shown_range}
    return {
        "title": {"text": plot.axis_label.replace("\n", "<br>")},
        "exponentformat": "power",
        "domain": [max(bottom, 0.0), top],
        **kind,
        **shown,
    }


def _title(text: str, top: float) -> dict[str, Any]:
    """Return the title of a panel, which looks like the heading above the first one."""
    place = {"x": 0, "xref": "paper", "xanchor": "left", "y": top, "yref": "paper", "yanchor": "bottom"}
    font = {"size": 15, "color": "var(--ink)", "weight": "bold"}
    return {"text": text, **place, "yshift": 4, "showarrow": False, "font": font}


def _traces(plot: TimePlot, time: Floats, panel: int) -> list[Any]:
    """Return the curves and levels of a panel; the legend has those of the first, for all."""
    curves = (_trace(c, time, plot.unit_after_value, n) for c, n in zip(plot.curves, plot.colours, strict=True))
    levels = (
        _level(level.value, label, time, dash)
        for level, label, dash in zip(plot.levels, plot.level_labels, cycle(_LEVELS))
    )
    traces = [*curves, *levels]
    for trace in traces:
        trace.update(yaxis=_axis_name(panel), legendgroup=trace.name, showlegend=panel == 0)
    return traces


def _trace(curve: Curve, time: Floats, unit: str, colour: int) -> Any:
    values = np.asarray(curve.values, dtype=np.float64)
    rows = rows_of_steps(values, _MAX_ROWS) if curve.held else rows_of_curve(values, _MAX_ROWS)
    shape = "hv" if curve.held else "linear"
    return go.Scatter(
        x=time[rows].astype(np.float32),
        y=values[rows].astype(np.float32),
        name=curve.label,
        mode="lines",
        line={**_STROKES[curve.stroke], "color": f"var(--c{colour})", "shape": shape},
        hovertemplate="%{y:.4~g}" + unit,
        connectgaps=False,
    )


def _level(value: float, label: str, time: Floats, dash: str) -> Any:
    return go.Scatter(
        x=[float(time[0]), float(time[-1])],
        y=[value, value],
        name=label,
        mode="lines",
        line={"color": "var(--soft)", "width": 1.2, "dash": dash},
        hoverinfo="skip",
    )


def _phases(phases: Sequence[Phase]) -> list[dict[str, Any]]:
    """Return the phases as the page's script takes them; only the longest where there are too many to be seen."""
    longest = sorted(phases, key=lambda phase: phase.begin - phase.end)[:_MAX_PHASES]
    return [{"from": p.begin, "to": p.end, "name": p.name} for p in sorted(longest, key=lambda p: p.begin)]


_MAX_BYTES = 1_400_000
"""Approximate size of all signals together in the page."""
_MIN_ROWS, _MAX_EXPLORED_ROWS = 60, 800
"""Limits of the number of points of a scalar signal."""
_BYTES_PER_POINT = 8 * 4 / 3
"""Time and value as float32, in base64."""


def explorer_section(record: Record) -> Section | None:
    """Return a section in which any signals of a record can be selected and drawn; None where nothing was recorded.

    A held value is kept exactly, unless it changes too often; curves are downsampled.
    """
    if len(record.time) < 2 or not record.signals:
        return None
    columns = sum(int(np.prod(record[name].shape[1:])) for name in record.signals)
    max_rows = int(np.clip(_MAX_BYTES / (_BYTES_PER_POINT * columns), _MIN_ROWS, _MAX_EXPLORED_ROWS))
    time = record.time.astype(np.float32)
    data = {
        "span": [float(time[0]), float(time[-1])],
        "signals": [_signal(record, name, time, max_rows) for name in record.signals],
    }
    html = template("explorer.html").render(data=json_html(data), scalars=columns, rows=len(time), max_rows=max_rows)
    return Section(anchor="signals", title="All signals", html=Markup(html), scripts=("explorer.js",))


def _signal(record: Record, name: str, time: NDArray[np.float32], max_rows: int) -> dict[str, Any]:
    values = record[name]
    flat = values.reshape(len(values), -1).astype(np.float64)
    return {
        "name": name,
        "unit": unit_symbol(record.unit(name)),
        "about": record.description(name),
        "items": record.items(name) or ({0: "false", 1: "true"} if values.dtype == np.bool_ else {}),
        "columns": [
            {"of": of, **_column(flat[:, k], time, max_rows)} for k, of in enumerate(_subscripts(values.shape[1:]))
        ],
    }


def _subscripts(shape: tuple[int, ...]) -> list[str]:
    """Return the subscripts of an array's elements, counted from 1 as in a record; [""] for a scalar."""
    return [",".join(str(i + 1) for i in index) for index in product(*map(range, shape))]


def _column(values: Floats, time: NDArray[np.float32], max_rows: int) -> Mapping[str, Any]:
    """Return a scalar signal as the page draws it: one value, steps, or a curve."""
    changes = changes_of(values)
    if len(changes) == 0:
        return {"value": float(values[0]) if np.isfinite(values[0]) else None}
    held = len(changes) < 0.7 * len(values)
    rows = rows_of_steps(values, max_rows) if held else rows_of_curve(values, max_rows)
    return {"t": _packed(time[rows]), "y": _packed(values[rows].astype(np.float32)), "held": held}


def _packed(values: NDArray[np.float32]) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode()
