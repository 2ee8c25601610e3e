"""Figures of a run along a path: error, joints, currents, pressures over time; path, arm and errors in space."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.experiment.time_plot import (
    COLOURS,
    Curve,
    Level,
    Phase,
    Stroke,
    TimeFigure,
    TimePlot,
    phases_of,
)
from handover.scenarios.robots.vsl.evaluation import PathEvaluator, distance
from handover.scenarios.robots.vsl.parameters import BAR, Parameters

SERVOS, TIP = "tip by the servos, links taken as rigid", "tip by the tracker"
_PALETTE = ("servos", "tip", "desired", "estimate")
SERVO_COLOUR, TIP_COLOUR, DESIRED_COLOUR, ESTIMATE_COLOUR = COLOURS[: len(_PALETTE)]
_LINKS: tuple[Stroke, ...] = ("solid", "dashed")
"""Strokes of the links' pressures, which often coincide."""
_FLAT = 1e-6
"""Distance from the plane XZ below which a path lies in it, m."""


def phases_of_path(record: Record) -> tuple[Phase, ...]:
    """Return the path's segments, as plots and replay name them."""
    segment = record["planner.segment"]
    segments = np.unique(segment[np.isfinite(segment)]).astype(int).tolist()
    return phases_of(record, "planner.segment", {n: f"segment {n}" if n else "before" for n in segments})


def figures_of_path(parameters: Parameters, record: Record, *, hybrid: bool) -> list[TimeFigure]:
    """Return the figures of the tip's error and position, and of joints, currents and pressures."""
    phases = phases_of_path(record)
    off_plane = bool(np.any(np.abs(record["planner.p_WG_goal"][:, 1]) > _FLAT))
    return [
        TimeFigure(
            name="error",
            caption="Distance to the desired point over time, on the path, with the tolerance for its mean, and the "
            "tip's place.",
            plots=[
                _error(parameters, record, phases, hybrid=hybrid),
                *(_position(record, axis, phases) for axis in range(3) if axis != 1 or off_plane),
            ],
        ),
        TimeFigure(
            name="signals",
            caption="Joints (desired: those of rigid links, the planner's), currents, pressures, over time.",
            plots=[_joints(record, phases), _currents(record, phases), _pressures(record, phases)],
        ),
    ]


def _error(parameters: Parameters, record: Record, phases: Sequence[Phase], *, hybrid: bool) -> TimePlot:
    goal, tip = record["planner.p_WG_goal"], record["arm.p_WG_meas"]
    compared = [(SERVOS, "servos", record["kinematics.p_WG_model"], goal), (TIP, "tip", tip, goal)]
    if hybrid:
        estimate = record["kinematics.p_WG_est"]
        compared.append(("hybrid forward model, to the true tip", "estimate", estimate, record["arm.p_WG"]))
    moving = record["planner.moving"]
    return TimePlot(
        title="Error of the tip, on the path",
        quantity="error",
        unit="mm",
        curves=[
            Curve(label=label, values=np.where(moving, 1000 * np.linalg.norm(p - q, axis=1), np.nan), group=group)
            for label, group, p, q in compared
        ],
        levels=(Level(label="tolerance for the mean", value=1000 * parameters.tolerance),),
        phases=phases,
        limits=(0.0, None),
        palette=_PALETTE,
    )


def _position(record: Record, axis: int, phases: Sequence[Phase]) -> TimePlot:
    servos, tip, desired = (
        1000 * record[signal][:, axis] for signal in ("kinematics.p_WG_model", "arm.p_WG_meas", "planner.p_WG_goal")
    )
    name = "xyz"[axis]
    return TimePlot(
        title=f"Tip along {name} of W",
        quantity=f"{name} in W",
        unit="mm",
        curves=(
            Curve(label=SERVOS, values=servos, group="servos"),
            Curve(label=TIP, values=tip, group="tip"),
            Curve(label="desired", values=desired, held=True, stroke="dashed", group="desired"),
        ),
        phases=phases,
        palette=_PALETTE,
    )


def _joints(record: Record, phases: Sequence[Phase]) -> TimePlot:
    measured, commanded, desired = (
        np.degrees(record[signal]) for signal in ("arm.q_meas", "kinematics.q_cmd", "planner.q_ref")
    )
    curves: list[Curve] = []
    for k, name in enumerate(("J1", "J2", "J3")):
        curves.append(Curve(label=f"{name}, measured", values=measured[:, k], group=name))
        curves.append(Curve(label=f"{name}, commanded", values=commanded[:, k], held=True, stroke="dashed", group=name))
        curves.append(Curve(label=f"{name}, desired", values=desired[:, k], held=True, stroke="dotted", group=name))
    return TimePlot(title="Joints", quantity="angle", unit="°", curves=curves, phases=phases)


def _currents(record: Record, phases: Sequence[Phase]) -> TimePlot:
    current = record["arm.i_meas"]
    curves = [Curve(label=f"J{k + 1}", values=current[:, k]) for k in range(3)]
    return TimePlot(title="Servos' currents", quantity="current", unit="A", curves=curves, phases=phases)


def _pressures(record: Record, phases: Sequence[Phase]) -> TimePlot:
    commanded, measured = (record[signal] / BAR for signal in ("planner.p_cmd", "arm.p_meas"))
    curves: list[Curve] = []
    for k, stroke in enumerate(_LINKS):
        name = f"link {k + 2}"
        curves.append(Curve(label=f"{name}, measured", values=measured[:, k], stroke=stroke, group=name))
        curves.append(Curve(label=f"{name}, commanded", values=commanded[:, k], held=True, stroke="dotted", group=name))
    title = "Pressures inside the links"
    return TimePlot(title=title, quantity="pressure", unit="bar", curves=curves, phases=phases, limits=(0.0, None))


_ARM_LINES: tuple[dict[str, Any], ...] = ({"lw": 3.6}, {"lw": 2.4}, {"lw": 1.6, "ls": "--"})
"""Line styles of the arm at three moments, such that all are seen where they overlap."""

_DISTANCE = "horizontal distance from the base (mm)"

_APART = 0.01
"""Distance below which two points are shown as one, m (assumed)."""


def draw_path_run(parameters: Parameters, evaluator: PathEvaluator, record: Record, folder: Path) -> list[Figure]:
    """Draw path, shapes of the arm and errors into a folder; nothing of a run that reached no point of the path."""
    if not evaluator.points:
        return []
    return [_path(evaluator, folder), _shapes(parameters, evaluator, record, folder), _errors(evaluator, folder)]


def _path(evaluator: PathEvaluator, folder: Path) -> Figure:
    points = evaluator.points
    lines: list[tuple[Sequence[Floats], dict[str, Any]]] = [
        (list(evaluator.path), {"color": DESIRED_COLOUR, "lw": 3.0, "alpha": 0.35, "label": "desired"}),
        (
            [p.servo for p in points],
            {"color": SERVO_COLOUR, "ls": "--", "lw": 1.3, "label": SERVOS},
        ),
        ([p.tracked for p in points], {"color": TIP_COLOUR, "lw": 1.3, "label": TIP}),
    ]
    if evaluator.hybrid:
        label = "tip by the hybrid forward model"
        lines.append(([p.estimated for p in points], {"color": ESTIMATE_COLOUR, "ls": ":", "lw": 1.8, "label": label}))
    places = [_in_plane(np.array(positions), evaluator) for positions, _ in lines]
    xlim, zlim = _limits(np.hstack([np.array(place) for place in places]))
    size = (6.4, min(1.5 + 5.6 * (zlim[1] - zlim[0]) / (xlim[1] - xlim[0]), 7.6))
    with figure(folder / "path", 1, size=size) as (axes,):
        for place, (_, style) in zip(places, lines, strict=True):
            axes.plot(*place, **style)
        axes.plot(*_in_plane(evaluator.path[:1], evaluator), "o", ms=6, color=DESIRED_COLOUR, label="start")
        axes.set(xlabel=_horizontal(evaluator), ylabel="z in W (mm)", aspect="equal", xlim=xlim, ylim=zlim)
        axes.figure.legend(ncols=2, loc="outside lower center")
    return Figure("path", "The path: desired, by the servos' encoders, and of the tip. Equal scales.")


def _shapes(parameters: Parameters, evaluator: PathEvaluator, record: Record, folder: Path) -> Figure:
    shapes = record["arm.shape"]
    masses = " or ".join(f"{1000 * mass:.0f}" for mass in parameters.masses)
    with figure(folder / "shape", 1, size=(8.0, 5.2)) as (axes,):
        axes.plot(*_in_plane(evaluator.path, evaluator), color=DESIRED_COLOUR, lw=3.0, alpha=0.35, label="desired path")
        for k, (role, t) in enumerate(_moments(evaluator).items()):
            arm_x, arm_z = _along_tip(shapes[np.searchsorted(record.time, t - 1e-9)], evaluator)
            axes.plot(arm_x, arm_z, color=COLOURS[k], label=f"{role}, {t:.1f} s", **_ARM_LINES[k])
            if float(parameters.load_at(np.array([t]))[0]) > 0.0:
                axes.plot(arm_x[-1], arm_z[-1] - 8.0, "s", ms=9, color=COLOURS[k])
        if parameters.masses:
            axes.plot([], [], "s", ms=9, color="#9aa3af", label=f"load, {masses} g")
        axes.axhspan(-30.0, 0.0, color="#d8dde4", lw=0, zorder=0)
        axes.set(xlabel=_horizontal(evaluator), ylabel="z in W (mm)", aspect="equal")
        axes.figure.legend(ncols=5, loc="outside lower center", columnspacing=1.2, handlelength=1.6)
    load = f" with its load of {masses} g (squares)" if masses else ""
    return Figure("shape", f"Centre line of the arm{load} at three moments, above the ground. Equal scales.")


def _errors(evaluator: PathEvaluator, folder: Path) -> Figure:
    groups = {
        "tip by servos,\nto desired": [distance(p.servo, p.desired) for p in evaluator.points],
        "tip by tracker,\nto desired": [p.error for p in evaluator.points],
        "tip by servos,\nto true tip": [distance(p.servo, p.true) for p in evaluator.points],
    }
    by = "by the tracker"
    if evaluator.hybrid:
        by += ", or by the hybrid model"
        groups["hybrid model,\nto true tip"] = [distance(p.estimated, p.true) for p in evaluator.points]
    colours = (SERVO_COLOUR, TIP_COLOUR, COLOURS[4], ESTIMATE_COLOUR)
    with figure(folder / "errors", 1, 2, size=(9.0, 3.8)) as (boxes, reach):
        for k, (values, colour) in enumerate(zip(groups.values(), colours, strict=False)):
            draw_box(boxes, k, np.array(values) * 1000, colour)
        boxes.set_xticks(range(len(groups)), list(groups), fontsize="small")
        boxes.set(ylabel="error (mm)", ylim=(0.0, None))
        boxes.grid(visible=False, axis="x")
        where, label = _spread(evaluator)
        reach.plot(where, [p.error * 1000 for p in evaluator.points], ".", color=TIP_COLOUR)
        reach.set(xlabel=label, ylabel="error of the tip (mm)", ylim=(0.0, None))
    caption = (
        f"Left: distances to the desired points or to the true tip, by the servos' encoders and rigid links, {by}. "
        "Boxes: 25th to 75th percentile; lines: median and range; dots: mean. Right: error of the tip over the desired "
        "point's place."
    )
    return Figure("errors", caption)


def _moments(evaluator: PathEvaluator) -> dict[str, float]:
    """Return three moments by their names; if the reach is greatest at an end of the path, the second is half way."""
    first, last = evaluator.points[0], evaluator.points[-1]
    role, second = "farthest reach", max(evaluator.points, key=lambda p: p.reach)
    if min(distance(second.desired, end.desired) for end in (first, last)) < _APART:
        role, second = "half way", evaluator.points[len(evaluator.points) // 2]
    return {"start": first.t, role: second.t, "end": last.t}


def _spread(evaluator: PathEvaluator) -> tuple[Floats, str]:
    """Return the points' reach, mm, and what it is; their height for a path that reaches equally far throughout."""
    r, z = (
        1000 * np.array(values) for values in zip(*((p.reach, p.desired[2]) for p in evaluator.points), strict=True)
    )
    return (z, "z in W (mm)") if np.ptp(r) < 1000 * _APART else (r, _DISTANCE)


def _limits(places: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return limits of both axes around points, shape (2, n), mm, with a margin."""
    low, high = places.min(axis=1), places.max(axis=1)
    margin = 0.06 * float(np.max(high - low))
    x, z = ((float(a) - margin, float(b) + margin) for a, b in zip(low, high, strict=True))
    return _widened(x, z), _widened(z, x)


def _widened(limits: tuple[float, float], others: tuple[float, float]) -> tuple[float, float]:
    """Return an axis's limits, at least half as far apart as the other axis's."""
    middle = (limits[0] + limits[1]) / 2.0
    half = max(limits[1] - limits[0], (others[1] - others[0]) / 2.0) / 2.0
    return middle - half, middle + half


def draw_box(axes: Axes, x: float, values: Floats, colour: str) -> None:
    """Draw values at x: the 25th to the 75th percentile as a box, range and median as lines, the mean as a dot."""
    low, q1, median, q3, high = np.percentile(values, (0, 25, 50, 75, 100))
    axes.vlines(x, low, high, color=colour, lw=1.2)
    axes.bar(x, q3 - q1, width=0.5, bottom=q1, color=colour, alpha=0.35, edgecolor=colour)
    axes.hlines(median, x - 0.25, x + 0.25, color=colour, lw=2.0)
    axes.plot(x, np.mean(values), "o", ms=4, color=colour)


def _in_plane(positions: Floats, evaluator: PathEvaluator) -> tuple[Floats, Floats]:
    """Return x of a path in the plane XZ, else the distance from the first joint's axis, and the height, mm."""
    mm = positions * 1000
    return (mm[:, 0] if _flat(evaluator) else np.hypot(mm[:, 0], mm[:, 1])), mm[:, 2]


def _along_tip(shape: Floats, evaluator: PathEvaluator) -> tuple[Floats, Floats]:
    """Return the same of the arm; off the plane XZ what points away from its tip is negative."""
    mm, tip = shape * 1000, shape[-1, :2]
    return (mm[:, 0] if _flat(evaluator) else mm[:, :2] @ (tip / np.linalg.norm(tip))), mm[:, 2]


def _flat(evaluator: PathEvaluator) -> bool:
    return bool(np.all(np.abs(evaluator.path[:, 1]) < _FLAT))


def _horizontal(evaluator: PathEvaluator) -> str:
    return "x in W (mm)" if _flat(evaluator) else _DISTANCE
