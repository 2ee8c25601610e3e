"""The section of a page that animates a run in space, with a slider over its time.

The page holds a limited number of frames, picked from the record's rows; its script interpolates between them.
"""

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.replay import Body, Line, Replay, ball
from handover.scenarios.experiment.time_plot import Phase, phases_of
from handover.scenarios.runs.reporting.html import json_html
from handover.scenarios.runs.reporting.page import Section, asset

MAX_FRAMES = 240
"""Frames of a replay; the page interpolates poses between them."""


def frame_rows(time: NDArray[np.float64], frames: int = MAX_FRAMES) -> NDArray[np.int64]:
    """Return ascending rows of a record that are about evenly spaced in time, with the first and the last."""
    last = len(time) - 1
    wanted: Floats = np.linspace(float(time[0]), float(time[-1]), min(frames, len(time)))
    after = np.clip(np.searchsorted(time, wanted), min(1, last), last)
    nearest = after - (wanted - time[after - 1] < time[after] - wanted)
    return np.unique([0, *nearest.tolist(), last]).astype(np.int64)


def phase_changes(record: Record, phases: str | Sequence[Phase]) -> list[tuple[float, str]]:
    """Return when each phase begins, s, and its name in words; nothing for the signal ""."""
    if isinstance(phases, str):
        phases = phases_of(record, phases) if phases else ()
    return [(p.begin, p.name) for p in phases]


SCENE_SCRIPTS = tuple(
    f"scene/{name}"
    for name in ("three.min.js", "replay_shapes.js", "scene_objects.js", "scene.js", "viewport.js", "recorder.js")
)
"""What a page needs to draw a scene."""
_MARGIN = 0.04
"""Margin around what is drawn, as a share of its longest side."""
_RESOLUTION = 1.0 / 20_000
"""The coarsest step of a place that is stored in 16 bits, as a share of the scene's longest side: a twentieth of a
pixel of a large scene."""
_FEW = 32
"""Numbers that are not worth a scale of their own."""
_SPEEDS = ("0.2", "0.5", "1", "2", "5")
_VIEWS = ("start", "front", "side", "top")

Drawn = Line | Body


def replay_section(replay: Replay, record: Record) -> Section:
    """Return a scene that can be turned, with play button, slider, time and phase, speeds and a legend.

    It holds at most some `MAX_FRAMES` moments of the run; rigid bodies are stored once, with their poses over time.

    Raises:
        ValueError: a line or a body has neither one row nor as many as the record.
    """
    rows = frame_rows(record.time)
    drawn = _drawn(replay, record, rows)
    return Section(
        anchor="replay",
        title="Replay",
        html=_html(json_html(scene_content(replay, record)), drawn, len(rows), replay),
        scripts=(*SCENE_SCRIPTS, "scene/replay.js"),
    )


def scene_content(replay: Replay, record: Record, frames: int = MAX_FRAMES, *, room: float = 0.0) -> dict[str, Any]:
    """Return a scene and where everything is at some `frames` moments of the record, as `scene.js` takes it.

    Args:
        replay: the scene.
        record: the run, or the part of it that is known.
        frames: of it, about.
        room: how much the views show around what is there, as a share of its longest side.

    Raises:
        ValueError: a line or a body has neither one row nor as many as the record, or nothing has a place.
    """
    rows = frame_rows(record.time, frames)
    drawn = _drawn(replay, record, rows)
    lowest, highest, seen = _extent(drawn)
    held = _with_room(seen if replay.window is None else replay.window, room)
    low, high = (lowest, highest) if replay.window is None else (held.min(axis=0), held.max(axis=0))
    step = _RESOLUTION * float(np.max(high - low))
    return {
        "time": _packed(record.time[rows]),
        "phases": phase_changes(record, replay.phases),
        "eye": list(replay.eye),
        "low": np.round(low, 4).tolist(),
        "high": np.round(high, 4).tolist(),
        "held": None if len(held) == 2 else np.round(_outermost(held), 4).tolist(),
        "weightless": replay.weightless,
        "floor": round(float(lowest[2]) if replay.floor is None else replay.floor, 4),
        "follow": replay.follow,
        "traces": [_trace(group, step) for group in _grouped(drawn)],
    }


def drawn_groups(replay: Replay, record: Record) -> list[list[Drawn]]:
    """Return what is drawn, in groups: each is a trace of `scene_content`, in its order."""
    return _grouped(_drawn(replay, record, frame_rows(record.time)))


def _drawn(replay: Replay, record: Record, rows: NDArray[np.int64]) -> list[Drawn]:
    return [_at(d, rows, len(record.time)) for d in (*replay.bodies, *replay.lines, *replay.fixed)]


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


def _trace(group: Sequence[Drawn], step: float) -> dict[str, Any]:
    first = group[0]
    look: dict[str, Any] = {"label": first.label, "colour": first.colour, "opacity": first.opacity}
    if isinstance(first, Line) and first.radii is None:
        line = {"width": first.width, "markers": first.markers, "trail": first.trail}
        return {**look, **line, "points": _packed_track(first.points, step), "n": first.points.shape[1]}
    return {**look, "parts": [_part(d, step) for d in group]}


def _part(solid: Drawn, step: float) -> dict[str, Any]:
    if isinstance(solid, Line):
        assert solid.radii is not None
        return {"points": _packed_track(solid.points, step), "radii": np.round(solid.radii, 5).tolist()}
    return {
        "vertices": _packed(solid.mesh.vertices),
        "triangles": _packed(solid.mesh.triangles, "u2"),
        "p": _packed_track(solid.p_WB, step),
        "q": None if solid.q_WB is None else _packed_track(_continuous(solid.q_WB), _RESOLUTION),
    }


def _continuous(q: Floats) -> Floats:
    """Return the same orientations with signs such that the page can interpolate from each quaternion to the next."""
    signs = np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(signs)])[:, None]


def _packed_track(values: Floats, step: float) -> dict[str, Any]:
    """Return numbers over time as 16-bit multiples of a step that is at most the given one, above the lowest of them.

    They take half of what single precision does, which is what they get where they range too far for such a step. 65535
    stands for what is not finite.
    """
    finite = values[np.isfinite(values)]
    if values.size <= _FEW or not finite.size:
        return _packed(values)
    low, span = float(finite.min()), float(np.ptp(finite))
    if span > 65534 * step:
        return _packed(values)
    step = span / 65534 or step
    multiples = np.rint((np.nan_to_num(values, nan=low, posinf=low, neginf=low) - low) / step)
    return {**_packed(np.where(np.isfinite(values), multiples, 65535), "u2"), "low": low, "step": step}


def _packed(values: NDArray[Any], dtype: str = "f4") -> dict[str, Any]:
    """Return values as the page's scripts unpack them, in single precision: 0.1 um at 1 m."""
    data = np.ascontiguousarray(values, dtype=f"<{dtype}").tobytes()
    return {"dtype": dtype, "bdata": base64.b64encode(data).decode()}


def _extent(drawn: Sequence[Drawn]) -> tuple[Floats, Floats, Floats]:
    """Return minimum and maximum corner of all that is drawn at any time, with a margin, and its outermost points."""
    outermost = [_outermost(points) for points in map(_points, drawn) if len(points)]
    if not outermost:
        raise ValueError("nothing in it has a place at any time")
    seen = _outermost(np.vstack(outermost))
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = max(_MARGIN * float(np.max(high - low)), 1e-3)
    return low - margin, high + margin, seen


def _with_room(points: Floats, share: float) -> Floats:
    """Return points, shape (n, 3), pushed outwards along each axis, the outermost by a share of the longest side."""
    low, high = points.min(axis=0), points.max(axis=0)
    outwards = (points - (low + high) / 2.0) / np.maximum((high - low) / 2.0, 1e-9)
    return points + share * float(np.max(high - low)) * outwards


def _outermost(points: Floats) -> Floats:
    """Return those of points, shape (n, 3), that lie farthest out along the axes and in directions all around."""
    directions = np.vstack([np.eye(3), -np.eye(3), ball(1.0, finer=1).vertices])
    return points[np.unique(np.argmax(points @ np.transpose(directions), axis=0))]


def _points(drawn: Drawn) -> Floats:
    """Return points around all that is drawn at any time, shape (n, 3), m; none while it is hidden."""
    if isinstance(drawn, Line):
        radii = np.zeros(1) if drawn.radii is None else drawn.radii
        points = np.concatenate([drawn.points + r * radii[:, None] for r in np.vstack([np.eye(3), -np.eye(3)])])
    else:
        R_WB = np.eye(3)[None] if drawn.q_WB is None else _rotations(drawn.q_WB)
        points = drawn.p_WB[:, None] + np.einsum("rij,nj->rni", R_WB, drawn.mesh.vertices)
    points = points.reshape(-1, 3)
    return points[np.isfinite(points).all(axis=1)]


def _rotations(q_WB: Floats) -> Floats:
    """Return rotation matrices, shape (n, 3, 3), of quaternions, shape (n, 4); NaN where one has no direction."""
    has_direction = np.linalg.norm(q_WB, axis=1) > 0.0
    R_WB = np.full((len(q_WB), 3, 3), np.nan)
    R_WB[has_direction] = Rotation.from_quat(q_WB[has_direction], scalar_first=True).as_matrix()
    return R_WB


def _seen_colour(drawn: Drawn) -> str:
    return drawn.colour if drawn.opacity >= 1.0 else f"{drawn.colour}{round(255 * drawn.opacity):02x}"


def _chip(drawn: Sequence[Drawn], label: str) -> str:
    """Return the background of a legend's chip: stripes of all colours that its label has in the scene."""
    colours = list(dict.fromkeys(_seen_colour(d) for d in drawn if d.label == label))
    ends = [f"{100 * k / len(colours):.4g}% {100 * (k + 1) / len(colours):.4g}%" for k in range(len(colours))]
    stripes = ", ".join(f"{colour} {end}" for colour, end in zip(colours, ends, strict=True))
    return colours[0] if len(colours) == 1 else f"linear-gradient(90deg, {stripes})"


def legend_html(drawn: Sequence[Drawn]) -> Markup:
    """Return a chip with its colours for each label in a scene, which shows and hides what it names."""
    chips = [
        f'<button type="button" aria-pressed="true" data-label="{escape(name)}">'
        f'<i style="background: {escape(_chip(drawn, name))}"></i>{escape(name)}</button>'
        for name in dict.fromkeys(d.label for d in drawn)
    ]
    return Markup("<div class='replay-legend' role='group' aria-label='what is shown'>{}</div>").format(
        Markup("").join(Markup(c) for c in chips)
    )


def views_html(replay: Replay) -> Markup:
    """Return buttons for the views of a scene."""
    views = [f'<button type="button" data-view="{v}">{v}</button>' for v in _VIEWS]
    if replay.follow:
        pressed = 'aria-pressed="false" data-view="follow"'
        views.append(f'<button type="button" {pressed}>follow {escape(replay.follow)}</button>')
    return Markup(f'<div class="replay-views" role="group" aria-label="view">{"".join(views)}</div>')


VIEWPORT_HTML = Markup(
    '<div class="replay-viewport"><div class="replay-scene" role="img" aria-label="the scene in space"></div>'
    '<button type="button" class="replay-wake"><span>Tap to turn and zoom</span></button></div>'
)
"""Where a scene is drawn."""
FILM_HTML = Markup('<button type="button" class="replay-film" hidden>record a video</button>')
"""The button that records a scene, where the browser can."""


def _html(data: Markup, drawn: Sequence[Drawn], frames: int, replay: Replay) -> Markup:
    speeds = [f'<option value="{s}"{" selected" if s == "1" else ""}>{s}&times;</option>' for s in _SPEEDS]
    paragraphs = [f'<p class="soft">{escape(note)}</p>' for note in replay.notes]
    return Markup(
        f"<style>{asset('scene/replay.css')}</style>"
        f'<div class="replay">{data}'
        '<p class="replay-missing" hidden>The replay needs WebGL, which this browser does not offer.</p>'
        f'<div class="replay-shown">{VIEWPORT_HTML}'
        '<div class="replay-controls"><button type="button" class="replay-play" aria-label="play">&#9654;&#xFE0E;'
        '</button><input type="range" class="replay-time" aria-label="time in the run" min="0" '
        f'max="{frames - 1}" step="1" value="0"><output class="replay-told"></output>'
        f'<select class="replay-speed" aria-label="speed of the replay">{"".join(speeds)}</select>'
        f'{views_html(replay)}<button type="button" class="replay-full">full screen</button></div>'
        f'<div class="replay-foot">{legend_html(drawn)}{FILM_HTML}</div></div>{"".join(paragraphs)}</div>'
    )
