"""What the report draws of an infrared grasp over time.

Figures of an infrared grasp: the scene at three moments, distances and cost, and the commands.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import FINGERS, finger_points, palm_outline, sensor_rays
from handover.plants.ir_grasp.objects import outlines
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, shade_phases
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.ir_grasp.parameters import Parameters

FINGER_NAMES = ("thumb", "index", "ring")
_PHASES = "reflex.phase"
_WRIST = ("reflex.p_WH_cmd", "scene.p_WH")
_LEAST_COST = 0.1
"""What is drawn of a smaller cost, mm²: a logarithm has no zero."""


def plot_grasp(parameters: Parameters, record: Record) -> list[TimePlot]:
    """Return distances seen and true, cost, and what is commanded of wrist, heading and closure."""
    return [
        _distances(parameters, record),
        TimePlot(
            title="Cost of thumb and ring, [Luberto] eq. (4)",
            quantity="cost f",
            unit="mm²",
            phases=_PHASES,
            logarithmic=True,
            curves=(Curve(label="cost f", values=cost(record), held=True),),
            levels=(Level(label="the hand closes", value=1e6 * closing_cost(parameters)),),
        ),
        *(
            _followed(f"Wrist along {name} of W", name, "mm", *(1000 * record[s][:, i] for s in _WRIST))
            for i, name in enumerate("xy")
        ),
        _followed("Heading", "yaw", "°", *(np.degrees(record[s]) for s in ("reflex.yaw_cmd", "scene.yaw"))),
        _followed("Closure", "closure, from 0 to 1", "", record["reflex.sigma_cmd"], record["scene.sigma"]),
    ]


def in_sight(record: Record, signal: str) -> Floats:
    """Return distances of the three fingers, shape (rows, 3), mm; not a number where there is nothing in range."""
    return np.where(record[signal] < ReflexParams().distance_max, 1000 * record[signal], np.nan)


def cost(record: Record) -> Floats:
    """Return the cost over time, mm², as a logarithmic axis can show it."""
    return np.maximum(1e6 * record["reflex.cost"], _LEAST_COST)


def closing_cost(parameters: Parameters) -> float:
    """Return the cost at which the hand closes, m²."""
    reflex = ReflexParams()
    return reflex.threshold_literal if parameters.literal else reflex.threshold


def _distances(parameters: Parameters, record: Record) -> TimePlot:
    seen, true = in_sight(record, "reflex.distance"), in_sight(record, "scene.range")
    curves: list[Curve] = []
    for i, finger in enumerate(FINGER_NAMES):
        curves.append(Curve(label=f"{finger}, as seen", values=seen[:, i], held=True, group=finger))
        curves.append(Curve(label=f"{finger}, true along the beam", values=true[:, i], faint=True, group=finger))
    target = (
        () if parameters.literal else (Level(label="target of thumb and ring", value=1000 * ReflexParams().target),)
    )
    return TimePlot(
        title="Distances of the fingers from the object",
        quantity="distance",
        unit="mm",
        curves=curves,
        levels=target,
        phases=_PHASES,
    )


def _followed(title: str, quantity: str, unit: str, commanded: Floats, measured: Floats) -> TimePlot:
    curves = (
        Curve(label="commanded", values=commanded, held=True),
        Curve(label="measured", values=measured),
    )
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=_PHASES)


FINGER_COLOURS = COLOURS[:3]
"""Of thumb, index and ring, as the page gives them to the curves of the distances."""
PALM_COLOUR, THING_COLOUR = "#c9d1db", "#ecd9b8"
_GROUPS = {0: "reach", 1: "look", 2: "look", 3: "look", 4: "probe", 5: "step", 6: "close", 7: "pull", 8: "shake", 9: ""}
"""What is written over a phase: a look may include approaching and recovering motions."""


def draw_grasp(parameters: Parameters, moments: Mapping[str, float], record: Record, folder: Path) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report. Moments: times by role."""
    return [
        _scene(parameters, moments, record, folder),
        _draw_distances(parameters, record, folder),
        _commands(record, folder),
    ]


def _draw_distances(parameters: Parameters, record: Record, folder: Path) -> Figure:
    t, reflex = record.time, ReflexParams()
    both = in_sight(record, "reflex.distance"), in_sight(record, "scene.range")
    with figure(folder / "distances", 2, size=(8.0, 5.6), heights=(3, 2)) as (above, below):
        for i, finger in enumerate(FINGER_NAMES):
            seen, true = (distances[:, i] for distances in both)
            above.plot(t, seen, color=FINGER_COLOURS[i], drawstyle="steps-post", label=f"{finger}, as seen")
            above.plot(t, true, color=FINGER_COLOURS[i], lw=0.8, ls=":")
        if not parameters.literal:
            above.axhline(1000 * reflex.target, color="#4d5866", lw=0.8, ls="--", label="target of thumb and ring")
        above.plot([], [], color="#4d5866", lw=0.8, ls=":", label="true, along the beam")
        above.set(ylabel="distance (mm)", ylim=(0, 82), xlim=(t[0], t[-1]))
        above.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.08))
        below.semilogy(t, cost(record), color=COLOURS[3], drawstyle="steps-post")
        below.axhline(
            1e6 * closing_cost(parameters), color="#4d5866", lw=0.8, ls="--", label="at which the hand closes"
        )
        below.legend(loc="best")
        below.set(xlabel="time (s)", ylabel="cost f (mm²)", xlim=(t[0], t[-1]))
        for axes, names in ((above, _GROUPS), (below, {})):
            shade_phases(axes, t, _grouped(record), names)
    caption = (
        "Distances as the controller sees them, [Luberto] eq. (11), and along the beams in truth (dotted), where "
        "there are any in the sensors' range, and the cost f of thumb and ring, [Luberto] eq. (4), in mm² (1e-6 m²), "
        f"in which a finger that sees nothing counts with {1000 * reflex.distance_max:.0f} mm. Dashed: target "
        "distance, and cost at which the hand closes."
    )
    return Figure("distances", caption)


def _commands(record: Record, folder: Path) -> Figure:
    t = record.time
    p_cmd, p = record["reflex.p_WH_cmd"] * 1000, record["scene.p_WH"] * 1000
    angles = [np.degrees(record[s]) for s in ("reflex.yaw_cmd", "scene.yaw")]
    closures = [record[s] for s in ("reflex.sigma_cmd", "scene.sigma")]
    rows = (("x (mm)", p_cmd[:, 0], p[:, 0]), ("y (mm)", p_cmd[:, 1], p[:, 1]))
    with figure(folder / "commands", 4, size=(8.0, 7.0)) as axes:
        for axis, (label, wanted, got) in zip(axes, (*rows, ("yaw (°)", *angles), ("closure", *closures)), strict=True):
            axis.plot(t, wanted, color=COLOURS[1], drawstyle="steps-post", label="commanded")
            axis.plot(t, got, color=COLOURS[0], lw=1.2, label="measured")
            axis.set(ylabel=label, xlim=(t[0], t[-1]))
            shade_phases(axis, t, _grouped(record), _GROUPS if axis is axes[0] else {})
        axes[0].legend(ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.15))
        axes[-1].set(xlabel="time (s)", ylim=(-0.05, 1.05))
    return Figure("commands", "Wrist, heading and closure: what the controller commands and what the encoders say.")


def _grouped(record: Record) -> NDArray[np.int64]:
    """Return phases with the first of those that are named alike for all of them."""
    firsts = {name: min(k for k, n in _GROUPS.items() if n == name) for name in _GROUPS.values()}
    return np.array([firsts[_GROUPS[int(k)]] for k in record["reflex.phase"]])


def _scene(parameters: Parameters, moments: Mapping[str, float], record: Record, folder: Path) -> Figure:
    rows = {role: int(np.searchsorted(record.time, at - 1e-9)) for role, at in moments.items()}
    low, high = _frame(record, list(rows.values()))
    wide, tall = high - low
    with figure(folder / "scene", 1, len(rows), size=(11.0, 1.4 + 9.3 / len(rows) * tall / wide)) as panels:
        for axes, (role, k) in zip(panels, rows.items(), strict=True):
            _draw_moment(axes, parameters, record, k)
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


def _draw_moment(axes: Axes, parameters: Parameters, record: Record, k: int) -> None:
    p_WH, yaw, q = record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k]
    for part in _thing(parameters, record, k):
        axes.add_patch(Polygon(part * 1000, facecolor=THING_COLOUR, edgecolor="#8a6d3b", lw=1.0))
    axes.add_patch(Polygon(palm_outline(p_WH, yaw) * 1000, facecolor=PALM_COLOUR, edgecolor="#4d5866", lw=1.0))
    for i, (finger, points) in enumerate(zip(FINGERS, finger_points(p_WH, yaw, q), strict=True)):
        for j, radius in enumerate(finger.radii):
            axes.add_patch(
                Polygon(_capsule(points[j], points[j + 1], radius) * 1000, fc=FINGER_COLOURS[i], ec="w", lw=0.5)
            )
    origins, directions = sensor_rays(p_WH, yaw, q)
    for i, distance in enumerate(record["scene.range"][k]):
        met = distance < ReflexParams().distance_max
        ends = np.array([origins[i], origins[i] + min(distance, ReflexParams().distance_max) * directions[i]]) * 1000
        axes.plot(ends[:, 0], ends[:, 1], color=FINGER_COLOURS[i], lw=1.0, ls="-" if met else ":")


def _thing(parameters: Parameters, record: Record, k: int) -> list[Floats]:
    p_WO, yaw = record["scene.p_WO"][k], float(record["scene.yaw_O"][k])
    R_WO = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return [p_WO + outline @ R_WO.T for outline in outlines(parameters.thing)]


def _frame(record: Record, rows: list[int]) -> tuple[Floats, Floats]:
    """Return the corners, in mm, of a rectangle that holds the hand and the object at the given rows."""
    hands = [finger_points(record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k]) for k in rows]
    points = np.vstack([p for hand in hands for p in hand] + [record["scene.p_WH"][rows], record["scene.p_WO"][rows]])
    return 1000 * points.min(axis=0) - 60.0, 1000 * points.max(axis=0) + 60.0


def _capsule(a: Floats, b: Floats, radius: float) -> Floats:
    """Return the outline of a phalanx, (18, 2)."""
    heading = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
    angles = heading + np.linspace(-np.pi / 2, np.pi / 2, 9)
    arc = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([b + arc, a - arc])
