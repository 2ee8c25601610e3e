"""Figures of an infrared grasp: distances, cost and commands over time, and the scene from above at three moments."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import FINGERS, finger_points, palm_outline, sensor_rays
from handover.plants.ir_grasp.objects import placed
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.experiment.time_plot import (
    COLOURS,
    Curve,
    Level,
    Phase,
    TimeFigure,
    TimePlot,
    phases_of,
)
from handover.scenarios.robots.ir_grasp.evaluation import IN_COST
from handover.scenarios.robots.ir_grasp.parameters import Parameters

FINGER_NAMES = ("thumb", "index", "ring")
FINGER_COLOURS = COLOURS[:3]
"""Colours of the fingers' curves, of the fingers in the scene and in the replay."""
_PHASE_NAMES = {
    0: "reach",
    1: "check",
    2: "check",
    3: "check",
    4: "probe",
    5: "step",
    6: "close",
    7: "pull",
    8: "shake",
    9: "done",
    10: "check",
    11: "track",
}
"""Phase names as plotted and in the replay: a check may include approaching and recovering motions."""
_MIN_COST = 0.1
"""Smaller costs are drawn as this, mm², since a logarithmic axis has no zero."""


def phases_of_grasp(record: Record) -> tuple[Phase, ...]:
    """Return the reflex's phases by the names that plots and replay show; none of a scene without a controller."""
    return phases_of(record, "reflex.phase", _PHASE_NAMES) if "reflex.phase" in record else ()


def figures_of_grasp(parameters: Parameters, record: Record) -> list[TimeFigure]:
    """Return the figures of distances (seen and true) with the cost, and of commanded and measured motion."""
    phases = phases_of_grasp(record)
    caption = (
        "Distances as the controller sees them, [Luberto] eq. (11), and along the beams in truth (dotted), where "
        "there are any in the sensors' range, and the cost f of thumb and ring, [Luberto] eq. (4), in mm² (1e-6 m²), "
        "dotted while one of the two sees nothing, which then counts with "
        f"{1000 * ReflexParams().distance_max:.0f} mm, and left out while neither sees anything. Dashed: target "
        "distance, and cost at which the hand closes."
    )
    return [
        TimeFigure(
            name="distances",
            caption=caption,
            plots=[_distances(parameters, record, phases), _cost(parameters, record, phases)],
        ),
        TimeFigure(
            name="commands",
            caption="Wrist, heading and closure: what the controller commands and what the encoders say.",
            plots=_commands(record, phases),
        ),
    ]


def _in_sight(record: Record, signal: str) -> Floats:
    """Return distances of the three fingers, shape (rows, 3), mm; NaN where nothing is in range."""
    return np.where(record[signal] < ReflexParams().distance_max, 1000 * record[signal], np.nan)


def _distances(parameters: Parameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    seen, true = _in_sight(record, "reflex.distance"), _in_sight(record, "scene.range")
    curves: list[Curve] = []
    for i, finger in enumerate(FINGER_NAMES):
        curves.append(Curve(label=f"{finger}, as seen", values=seen[:, i], held=True, group=finger))
        curves.append(Curve(label=f"{finger}, true along the beam", values=true[:, i], stroke="dotted", group=finger))
    target = Level(label="target of thumb and ring", value=1000 * ReflexParams().target)
    return TimePlot(
        title="Distances of the fingers from the object",
        quantity="distance",
        unit="mm",
        curves=curves,
        levels=() if parameters.literal else (target,),
        phases=phases,
        limits=(0.0, None),
    )


def _cost(parameters: Parameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    reflex = ReflexParams()
    closes = reflex.threshold_literal if parameters.literal else reflex.threshold
    cost = np.maximum(1e6 * record["reflex.cost"], _MIN_COST)
    seeing = np.count_nonzero(record["reflex.distance"][:, IN_COST] < reflex.distance_max, axis=1)
    partly = "cost f, while thumb or ring sees nothing"
    return TimePlot(
        title="Cost of thumb and ring, [Luberto] eq. (4)",
        quantity="cost f",
        unit="mm²",
        phases=phases,
        logarithmic=True,
        curves=(
            Curve(label="cost f", values=np.where(seeing == 2, cost, np.nan), held=True),
            Curve(label=partly, values=np.where(seeing == 1, cost, np.nan), held=True, stroke="dotted", group="cost f"),
        ),
        levels=(Level(label="the hand closes", value=1e6 * closes),),
    )


def _commands(record: Record, phases: Sequence[Phase]) -> list[TimePlot]:
    suffix = "_meas" if "scene.p_WH_meas" in record else ""
    p, yaw, sigma = ((record[f"reflex.{n}_cmd"], record[f"scene.{n}{suffix}"]) for n in ("p_WH", "yaw", "sigma"))
    followed = [
        *((f"Wrist along {name} of W", name, "mm", *(1000 * of[:, i] for of in p)) for i, name in enumerate("xy")),
        ("Heading", "yaw", "°", *(np.degrees(of) for of in yaw)),
        ("Closure", "closure, 0 to 1", "", *sigma),
    ]
    return [
        TimePlot(
            title=title,
            quantity=quantity,
            unit=unit,
            phases=phases,
            curves=(
                Curve(label="measured", values=measured),
                Curve(label="commanded", values=commanded, held=True, stroke="dashed"),
            ),
        )
        for title, quantity, unit, commanded, measured in followed
    ]


PALM_COLOUR, THING_COLOUR, OTHER_COLOUR = "#c9d1db", "#ecd9b8", "#d5dfc6"


def draw_scene(parameters: Parameters, moments: Mapping[str, float], record: Record, folder: Path) -> Figure:
    """Draw the table at some moments, given as times by role, into a folder."""
    rows = {role: int(np.searchsorted(record.time, at - 1e-9)) for role, at in moments.items()}
    low, high = _frame(parameters, record, list(rows.values()))
    wide, tall = high - low
    with figure(folder / "scene", 1, len(rows), size=(11.0, 1.4 + 9.3 / len(rows) * tall / wide)) as panels:
        for axes, (role, k) in zip(panels, rows.items(), strict=True):
            draw_moment(axes, parameters, record, k)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (mm)")
            axes.set_title(f"{record.time[k]:.1f} s, {role}")
        panels[0].set(ylabel="y (mm)")
        for name, colour in zip(FINGER_NAMES, FINGER_COLOURS, strict=True):
            panels[len(panels) // 2].plot([], [], color=colour, lw=5, label=name)
        panels[len(panels) // 2].legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.15), handlelength=1.0)
    caption = (
        "The table from above: hand, object, and the sensors' beams, solid as far as the object where they meet it, "
        "else dotted."
    )
    return Figure("scene", caption)


def draw_moment(axes: Axes, parameters: Parameters, record: Record, k: int) -> None:
    """Draw the table at a row of a record, in mm: object, hand and beams."""
    for part in _thing(parameters, record, k):
        axes.add_patch(Polygon(part * 1000, facecolor=THING_COLOUR, edgecolor="#8a6d3b", lw=1.0))
    if _has_other(parameters, record):
        middle, radius = 1000 * record["scene.p_WX"][k], 1000 * parameters.other_radius
        axes.add_patch(Circle(middle.tolist(), radius, facecolor=OTHER_COLOUR, edgecolor="#4d5866", lw=1.0))
    p_WH, yaw, q = record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k]
    draw_hand(axes, p_WH, yaw, q, record["scene.range"][k])


def draw_hand(axes: Axes, p_WH: Floats, yaw: float, q: Floats, distances: Floats) -> None:
    """Draw palm and fingers, in mm, and the beams as far as they meet something at these distances, m, else dotted."""
    axes.add_patch(Polygon(palm_outline(p_WH, yaw) * 1000, facecolor=PALM_COLOUR, edgecolor="#4d5866", lw=1.0))
    for i, (finger, points) in enumerate(zip(FINGERS, finger_points(p_WH, yaw, q), strict=True)):
        for j, radius in enumerate(finger.radii):
            axes.add_patch(
                Polygon(_capsule(points[j], points[j + 1], radius) * 1000, fc=FINGER_COLOURS[i], ec="w", lw=0.5)
            )
    origins, directions = sensor_rays(p_WH, yaw, q)
    for i, distance in enumerate(distances):
        met = distance < ReflexParams().distance_max
        ends = np.array([origins[i], origins[i] + min(distance, ReflexParams().distance_max) * directions[i]]) * 1000
        axes.plot(ends[:, 0], ends[:, 1], color=FINGER_COLOURS[i], lw=1.0, ls="-" if met else ":")


def _has_other(parameters: Parameters, record: Record) -> bool:
    return parameters.other_radius > 0.0 and "scene.p_WX" in record


def _thing(parameters: Parameters, record: Record, k: int) -> list[Floats]:
    return placed(parameters.solid, record["scene.p_WO"][k], float(record["scene.yaw_O"][k]))


def _frame(parameters: Parameters, record: Record, rows: list[int]) -> tuple[Floats, Floats]:
    """Return the corners, in mm, of a rectangle that holds the hand and the objects at the given rows."""
    hands = [finger_points(record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k]) for k in rows]
    bodies = ["scene.p_WH", "scene.p_WO", *(["scene.p_WX"] if _has_other(parameters, record) else [])]
    points = np.vstack([p for hand in hands for p in hand] + [record[body][rows] for body in bodies])
    return 1000 * points.min(axis=0) - 60.0, 1000 * points.max(axis=0) + 60.0


def _capsule(a: Floats, b: Floats, radius: float) -> Floats:
    """Return the outline of a phalanx, shape (18, 2)."""
    heading = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
    angles = heading + np.linspace(-np.pi / 2, np.pi / 2, 9)
    arc = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([b + arc, a - arc])
