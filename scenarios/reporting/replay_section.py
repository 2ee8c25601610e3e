"""The section of a page that animates a run in space, with a slider over its time.

The page holds a limited number of frames, picked from the record's rows; its script interpolates between them.
"""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.replay import Body, Line, Replay
from handover.scenarios.experiment.time_plot import Phase, phases_of
from handover.scenarios.reporting.html import json_html
from handover.scenarios.reporting.page import Section, asset

MAX_FRAMES = 240
"""Frames of a replay; the page interpolates poses between them."""


def frame_rows(time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return ascending rows of a record that are about evenly spaced in time, with the first and the last."""
    last = len(time) - 1
    wanted: Floats = np.linspace(float(time[0]), float(time[-1]), min(MAX_FRAMES, len(time)))
    after = np.clip(np.searchsorted(time, wanted), min(1, last), last)
    nearest = after - (wanted - time[after - 1] < time[after] - wanted)
    return np.unique([0, *nearest.tolist(), last]).astype(np.int64)


def phase_changes(record: Record, phases: str | Sequence[Phase]) -> list[tuple[float, str]]:
    """Return when each phase begins, s, and its name in words; nothing for the signal ""."""
    if isinstance(phases, str):
        phases = phases_of(record, phases) if phases else ()
    return [(p.begin, p.name) for p in phases]


_MARGIN = 0.04
"""Margin around what is drawn, as a share of its longest side."""
_SPEEDS = ("0.5", "1", "2", "5")

Drawn = Line | Body


def replay_section(replay: Replay, record: Record) -> Section:
    """Return a scene that can be turned, with play button, slider, time and phase, speeds and a legend.

    It holds at most some `MAX_FRAMES` moments of the run; rigid bodies are stored once, with their poses over time.

    Raises:
        ValueError: a line or a body has neither one row nor as many as the record.
    """
    rows = frame_rows(record.time)
    drawn: list[Drawn] = [_at(d, rows, len(record.time)) for d in (*replay.bodies, *replay.lines, *replay.fixed)]
    low, high = _window(drawn) if replay.window is None else replay.window
    content = {
        "time": _packed(record.time[rows]),
        "phases": phase_changes(record, replay.phases),
        "eye": list(replay.eye),
        "low": np.round(low, 4).tolist(),
        "high": np.round(high, 4).tolist(),
        "traces": [_trace(group) for group in _grouped(drawn)],
    }
    return Section(
        anchor="replay",
        title="Replay",
        html=_html(json_html(content), drawn, len(rows), replay.notes),
        scripts=("replay_shapes.js", "replay.js"),
    )


def _at(drawn: Drawn, rows: NDArray[np.int64], all_rows: int) -> Drawn:
    """Return what is drawn with some rows of the record only; with one row if it does not move."""
    if isinstance(drawn, Line):
        return replace(drawn, points=_downsampled(drawn.label, drawn.points, rows, all_rows, keep=drawn.trail))
    q_WB = None if drawn.q_WB is None else _downsampled(drawn.label, drawn.q_WB, rows, all_rows)
    return replace(drawn, p_WB=_downsampled(drawn.label, drawn.p_WB, rows, all_rows), q_WB=q_WB)


def _downsampled(label: str, values: Floats, rows: NDArray[np.int64], all_rows: int, keep: bool = False) -> Floats:
    if len(values) == 1:
        return values
    if len(values) != all_rows:
        raise ValueError(f"replay: {label!r} has {len(values)} rows, the record {all_rows}; it needs as many, or one")
    frames: Floats = np.asarray(values[rows], dtype=np.float64)
    stays = not keep and np.array_equal(frames, np.broadcast_to(frames[:1], frames.shape), equal_nan=True)
    return frames[:1] if stays else frames


def _grouped(drawn: Sequence[Drawn]) -> list[list[Drawn]]:
    """Return groups that one trace can show: tubes and bodies that look alike together, each line alone."""
    groups: dict[Any, list[Drawn]] = {}
    for d in drawn:
        solid = isinstance(d, Body) or d.radii is not None
        groups.setdefault((d.label, d.colour, d.opacity) if solid else id(d), []).append(d)
    return list(groups.values())


def _trace(group: Sequence[Drawn]) -> dict[str, Any]:
    first = group[0]
    look: dict[str, Any] = {"label": first.label, "colour": first.colour, "opacity": first.opacity}
    if isinstance(first, Line) and first.radii is None:
        line = {"width": first.width, "markers": first.markers, "trail": first.trail}
        return {**look, **line, "points": _packed(first.points), "n": first.points.shape[1]}
    return {**look, "parts": [_part(d) for d in group]}


def _part(solid: Drawn) -> dict[str, Any]:
    if isinstance(solid, Line):
        assert solid.radii is not None
        return {"points": _packed(solid.points), "radii": np.round(solid.radii, 5).tolist()}
    return {
        "vertices": _packed(solid.mesh.vertices),
        "triangles": _packed(solid.mesh.triangles, "u2"),
        "p": _packed(solid.p_WB),
        "q": None if solid.q_WB is None else _packed(_continuous(solid.q_WB)),
    }


def _continuous(q: Floats) -> Floats:
    """Return the same orientations with signs such that the page can interpolate from each quaternion to the next."""
    signs = np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(signs)])[:, None]


def _packed(values: NDArray[Any], dtype: str = "f4") -> Mapping[str, str]:
    """Return values as the page's scripts unpack them, in single precision: 0.1 um at 1 m."""
    data = np.ascontiguousarray(values, dtype=f"<{dtype}").tobytes()
    return {"dtype": dtype, "bdata": base64.b64encode(data).decode()}


def _window(drawn: Sequence[Drawn]) -> tuple[Floats, Floats]:
    """Return minimum and maximum corner of all that is drawn at any time, with a margin around it."""
    with np.errstate(invalid="ignore"):
        corners = np.array([c for d in drawn for c in _corners(d)])
    low, high = np.nanmin(corners, axis=0), np.nanmax(corners, axis=0)
    margin = max(_MARGIN * float(np.max(high - low)), 1e-3)
    return low - margin, high + margin


def _corners(drawn: Drawn) -> tuple[Floats, Floats]:
    if isinstance(drawn, Line):
        radii = np.zeros(1) if drawn.radii is None else drawn.radii
        points = np.concatenate([drawn.points - radii[:, None], drawn.points + radii[:, None]]).reshape(-1, 3)
    else:
        R_WB = np.eye(3)[None] if drawn.q_WB is None else Rotation.from_quat(drawn.q_WB, scalar_first=True).as_matrix()
        p_BV_W = np.einsum("rij,nj->rni", R_WB, drawn.mesh.vertices)
        points = np.concatenate([drawn.p_WB + extent for extent in (p_BV_W.min(axis=1), p_BV_W.max(axis=1))])
    shown = points[np.isfinite(points).all(axis=1)]
    if not len(shown):
        return np.full(3, np.nan), np.full(3, np.nan)
    return shown.min(axis=0), shown.max(axis=0)


def _seen_colour(drawn: Drawn) -> str:
    return drawn.colour if drawn.opacity >= 1.0 else f"{drawn.colour}{round(255 * drawn.opacity):02x}"


def _chip(drawn: Sequence[Drawn], label: str) -> str:
    """Return the background of a legend's chip: stripes of all colours that its label has in the scene."""
    colours = list(dict.fromkeys(_seen_colour(d) for d in drawn if d.label == label))
    ends = [f"{100 * k / len(colours):.4g}% {100 * (k + 1) / len(colours):.4g}%" for k in range(len(colours))]
    stripes = ", ".join(f"{colour} {end}" for colour, end in zip(colours, ends, strict=True))
    return colours[0] if len(colours) == 1 else f"linear-gradient(90deg, {stripes})"


def _html(data: Markup, drawn: Sequence[Drawn], frames: int, notes: Sequence[str]) -> Markup:
    chips = [
        f'<button type="button" aria-pressed="true" data-label="{escape(name)}">'
        f'<i style="background: {escape(_chip(drawn, name))}"></i>{escape(name)}</button>'
        for name in dict.fromkeys(d.label for d in drawn)
    ]
    speeds = [f'<option value="{s}"{" selected" if s == "1" else ""}>{s}&times;</option>' for s in _SPEEDS]
    paragraphs = [f'<p class="soft">{escape(note)}</p>' for note in notes]
    return Markup(
        f"<style>{asset('replay.css')}</style>"
        f'<div class="replay">{data}'
        '<p class="replay-missing" hidden>The replay needs WebGL, which this browser does not offer.</p>'
        '<div class="replay-shown"><div class="replay-stage">'
        '<div class="replay-scene" role="img" aria-label="the scene in space"></div>'
        '<button type="button" class="replay-wake">Tap to turn and zoom</button></div>'
        '<div class="replay-controls"><button type="button" class="replay-play" aria-label="play">&#9654;&#xFE0E;'
        '</button><input type="range" class="replay-time" aria-label="time in the run" min="0" '
        f'max="{frames - 1}" step="1" value="0"><output class="replay-told"></output>'
        f'<select class="replay-speed" aria-label="speed of the replay">{"".join(speeds)}</select>'
        '<button type="button" class="replay-reset">reset view</button></div>'
        f'<div class="replay-legend" role="group" aria-label="what is shown">{"".join(chips)}</div>'
        f"</div>{''.join(paragraphs)}</div>"
    )
