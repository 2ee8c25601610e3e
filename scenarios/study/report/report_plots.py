"""Plots of a study's page: what each participant rated, and shifts with their intervals."""

from collections.abc import Mapping, Sequence

import plotly.graph_objects as go

from handover.scenarios.study.statistics.analysis import RatingTest, StudyAnalysis

_APART = 2.6
"""Places from a task to the next, whose two behaviours are 1 apart."""
_BAR = 0.16


def ratings_figure(analysis: StudyAnalysis, task_names: Mapping[str, str], statement: str) -> go.Figure:
    """Return the means of a statement of each participant, with a line between the behaviours, and those of all."""
    tasks, (low, high) = analysis.plan.tasks, analysis.plan.scale
    who = {s.session.pseudonym: k for k, s in enumerate(analysis.sessions)}
    aside = {name: 0.3 * ((k + 0.5) / len(who) - 0.5) for name, k in who.items()}
    rated = [m for m in analysis.means if m.statement == statement]
    start = [_APART * tasks.index(m.task) + aside[m.participant] for m in rated]
    lines_x = [x for a in start for x in (a, a + 1.0, None)]
    lines_y = [y for m in rated for y in (m.first, m.second, None)]
    figure = go.Figure()
    thin = {"width": 1, "color": "var(--soft)"}
    figure.add_trace(
        go.Scatter(x=lines_x, y=lines_y, mode="lines", line=thin, opacity=0.5, hoverinfo="skip", showlegend=False)
    )
    for k, side in enumerate(analysis.plan.behaviours):
        figure.add_trace(
            go.Scatter(
                x=[x + k for x in start],
                y=[(m.first, m.second)[k] for m in rated],
                mode="markers",
                marker={"size": 8, "color": f"var(--c{k})", "symbol": ("circle", "diamond")[k]},
                name=side,
                customdata=[m.participant for m in rated],
                hovertemplate="%{customdata}: %{y:.3~g}<extra></extra>",
            )
        )
        figure.add_trace(_bars_of_means(analysis, statement, k))
    ticks = [_APART * k + 0.5 for k in range(len(tasks))]
    names = [task_names[t].replace(" ", "<br>", 1) for t in tasks]
    figure.update_layout(
        {
            "xaxis": {"tickmode": "array", "tickvals": ticks, "ticktext": names, "range": [-0.6, ticks[-1] + 1.1]},
            "yaxis": {"range": [low - 0.3, high + 0.3], "title": {"text": "mean rating"}, "tick0": low, "dtick": 2},
            "hovermode": "closest",
        }
    )
    return figure


def _bars_of_means(analysis: StudyAnalysis, statement: str, k: int) -> go.Scatter:
    """Return a short bar at the mean of all participants in each task, of a behaviour."""
    x: list[float | None] = []
    y: list[float | None] = []
    for place, task in enumerate(analysis.plan.tasks):
        found = next(t for t in analysis.rating_tests if (t.task, t.statement) == (task, statement))
        mean = (found.first, found.second)[k]
        x += [_APART * place + k - 1.6 * _BAR, _APART * place + k + 1.6 * _BAR, None]
        y += [mean, mean, None]
    line = {"width": 4, "color": f"var(--c{k})"}
    return go.Scatter(x=x, y=y, mode="lines", line=line, hovertemplate="mean %{y:.2f}<extra></extra>", showlegend=False)


def shifts_figure(tests: Sequence[RatingTest], task_names: Mapping[str, str], axis: str) -> go.Figure:
    """Return the shifts of tests with their intervals, below each other."""
    found = [(k, t, t.test) for k, t in enumerate(reversed(tests)) if t.test is not None]
    bars = {
        "type": "data",
        "array": [x.high - x.estimate for _, _, x in found],
        "arrayminus": [x.estimate - x.low for _, _, x in found],
        "thickness": 1.6,
        "width": 4,
    }
    figure = go.Figure(
        go.Scatter(
            x=[x.estimate for _, _, x in found],
            y=[k for k, _, _ in found],
            error_x=bars,
            mode="markers",
            marker={"size": 9, "color": "var(--c0)"},
            hovertemplate="%{x:+.2f}<extra></extra>",
            showlegend=False,
        )
    )
    names = [f"{t.statement} · {task_names[t.task]}" for _, t, _ in found]
    zero = {"type": "line", "x0": 0, "x1": 0, "y0": 0, "y1": 1, "yref": "paper", "line": {"color": "var(--soft)"}}
    figure.update_layout(
        {
            "xaxis": {"title": {"text": axis}},
            "yaxis": {
                "tickmode": "array",
                "tickvals": [k for k, _, _ in found],
                "ticktext": names,
                "range": [-0.6, len(found) - 0.4],
                "showgrid": False,
            },
            "shapes": [zero],
        }
    )
    return figure
