"""The section of a page that shows the CPU time of each unit of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from markupsafe import Markup

from handover.scenarios.runs.reporting.html import plot_html
from handover.scenarios.runs.reporting.page import Section, template

_MAX_BARS = 24
"""Units that have a bar of their own; of more, the cheapest share one."""

_REST = "master, recording and other"


@dataclass(frozen=True, kw_only=True)
class _Bar:
    label: str
    seconds: float
    colour: str = "var(--c0)"


def cpu_section(summary: Mapping[str, Any]) -> Section | None:
    """Return CPU seconds by unit, and the master's beside them; None where they are unknown.

    Args:
        summary: what is in `summary.json`.
    """
    units = [u for u in summary.get("units", ()) if u.get("cpu_seconds") is not None]
    of_process = summary.get("cpu_seconds")
    if not units or of_process is None:
        return None
    rest = max(0.0, of_process - sum(u["cpu_seconds"] for u in units))
    total = sum(u["cpu_seconds"] for u in units) + rest
    if total <= 0.0:
        return None
    bars = [*_bars(units), _Bar(label=_REST, seconds=rest, colour="var(--soft)")]
    html = template("cpu.html").render(
        plot=_plot(bars, total),
        rows=[(u, _per_step(u), _share(u["cpu_seconds"], total)) for u in units],
        rest=(_REST, rest, _share(rest, total)),
        total=total,
        simulated=summary["simulated_seconds"],
    )
    return Section(anchor="cpu", title="CPU time", html=Markup(html))


def _bars(units: Sequence[Mapping[str, Any]]) -> list[_Bar]:
    """Return bars of the units, the most expensive first."""
    ordered = sorted(units, key=lambda u: -u["cpu_seconds"])
    bars = [_Bar(label=u["name"], seconds=u["cpu_seconds"]) for u in ordered[:_MAX_BARS]]
    if others := ordered[_MAX_BARS:]:
        bars.append(_Bar(label=f"{len(others)} other units", seconds=sum(u["cpu_seconds"] for u in others)))
    return bars


def _plot(bars: Sequence[_Bar], total: float) -> Markup:
    seconds = [b.seconds for b in bars]
    texts = [f"{s:.3g} s, {_share(s, total)}" for s in seconds]
    bar = go.Bar(
        x=seconds,
        y=[_in_two_lines(b.label) for b in bars],
        orientation="h",
        marker={"color": [b.colour for b in bars]},
        text=texts,
        textposition="auto",
        insidetextanchor="end",
        insidetextfont={"color": "var(--page)"},
        textangle=0,
        hovertemplate="%{y}: %{text}<extra></extra>",
    )
    figure = go.Figure(
        [bar],
        {
            "xaxis": {"title": {"text": "CPU time (s)"}, "rangemode": "tozero"},
            "yaxis": {"autorange": "reversed", "type": "category", "dtick": 1, "fixedrange": True, "showgrid": False},
            "bargap": 0.3,
            "showlegend": False,
        },
    )
    return plot_html(figure, height=80 + 32 * len(bars), label="CPU time by unit: " + "; ".join(
        f"{b.label} {text}" for b, text in zip(bars, texts, strict=True)
    ))  # fmt: skip


def _in_two_lines(label: str) -> str:
    return label.replace(", ", ",<br>", 1)


def _share(seconds: float, total: float) -> str:
    percent = 100.0 * seconds / total
    return f"{percent:.0f} %" if percent >= 9.95 else f"{percent:.1f} %"


def _per_step(unit: Mapping[str, Any]) -> float | None:
    """Return the mean CPU time of a step, ms."""
    return 1000.0 * unit["cpu_seconds"] / unit["steps"] if unit.get("steps") else None
