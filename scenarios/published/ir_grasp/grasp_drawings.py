"""Drawings after figures 5, 9 and 11 of Luberto et al.: poses of the objects, recovering actions, grasps in moments."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.controllers.ir_grasp.visibility import RECOVERY, Action, Visibility
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import finger_points
from handover.plants.ir_grasp.objects import SOLIDS, Thing, placed
from handover.plants.ir_grasp.parameters import Params as SceneParams
from handover.plants.ir_grasp.scene import GraspScene
from handover.plants.ir_grasp.scene import Inputs as SceneInputs
from handover.plants.ir_grasp.scene import Outputs as SceneOutputs
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.robots.ir_grasp.plots import FINGER_COLOURS, FINGER_NAMES, THING_COLOUR, draw_hand, draw_moment

_EDGE, _SOFT, _ARROW = "#8a6d3b", "#4d5866", "#1b5fae"
_MARGIN = 25.0
"""About what is drawn, mm."""

_MOMENTS = {
    "vision's pose": Phase.CHECK,
    "first step": Phase.STEP,
    "closes": Phase.CLOSE,
    "pulls": Phase.PULL,
    "shaken": Phase.DONE,
}
"""Columns of the sequences: the first moment of each phase."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class SeenScene:
    """A hand with its wrist in the origin of W, along x, and an object that only some of its sensors see."""

    thing: Thing
    p_WO: tuple[float, float]
    yaw: float = 0.0
    sigma: float = 0.0

    def outputs(self) -> SceneOutputs:
        """Return what the scene gives at rest, without noise."""
        params = SceneParams(
            thing=self.thing,
            p_WO_0=np.array(self.p_WO),
            yaw_O_0=self.yaw,
            p_WH_0=np.zeros(2),
            sigma_0=self.sigma,
            noise=0.0,
        )
        return GraspScene(params).outputs(0.0, SceneInputs())

    def case(self) -> Visibility:
        """Return which fingers see the object, by the controller's threshold."""
        p = ReflexParams()
        ticks = self.outputs().ticks.tolist()
        return Visibility(sum(1 << i for i, x in enumerate(ticks) if x >= p.calibration.ticks(p.epsilon)))


SEEN: Mapping[Visibility, SeenScene] = {
    Visibility.NONE: SeenScene(Thing.CYLINDER, (0.215, 0.0)),
    Visibility.THUMB: SeenScene(Thing.CYLINDER, (0.136, -0.036)),
    Visibility.INDEX: SeenScene(Thing.CYLINDER, (0.180, 0.055)),
    Visibility.RING: SeenScene(Thing.CYLINDER, (0.120, 0.024)),
    Visibility.INDEX_RING: SeenScene(Thing.CYLINDER, (0.160, 0.044)),
    Visibility.THUMB_INDEX: SeenScene(Thing.PAPER_BOX_A, (0.154, -0.004), yaw=1.2, sigma=0.15),
    Visibility.THUMB_RING: SeenScene(Thing.CYLINDER, (0.144, 0.0)),
}
"""A scene of each of figure 9's seven cases (assumed: the figure's own are photographs' outlines)."""

_DIRECTIONS = {
    Action.FORWARD: (1.0, 0.0),
    Action.BACK: (-1.0, 0.0),
    Action.TO_THUMB: (0.0, -1.0),
    Action.TO_FINGERS: (0.0, 1.0),
}
_ACTIONS = {
    Action.FORWARD: "forward",
    Action.BACK: "back",
    Action.TO_THUMB: "to the thumb's side",
    Action.TO_FINGERS: "to the fingers' side",
    Action.CLOSE: "close (H)",
}


def draw_cases(folder: Path) -> Figure:
    """Draw figure 9: for each case the hand, what sees, and the action that follows."""
    with figure(folder / "recoveries", 2, 4, size=(10.0, 4.9)) as panels:
        for axes, (case, scene) in zip(panels, SEEN.items(), strict=False):
            _case(axes, case, scene)
        for axes in panels:
            axes.set(xlim=(-12, 265), ylim=(-105, 110), aspect="equal")
            axes.grid(visible=False)
        for axes in panels[:4]:
            axes.tick_params(labelbottom=False)
        for k in (0, 4):
            panels[k].set_ylabel("y (mm)")
        for axes in panels[4:7]:
            axes.set_xlabel("x (mm)")
        last = panels[-1]
        last.set_axis_off()
        for name, colour in zip(FINGER_NAMES, FINGER_COLOURS, strict=True):
            last.plot([], [], color=colour, lw=5, label=name)
        last.plot([], [], color=_ARROW, lw=2, label="action")
        last.legend(loc="center")
    caption = (
        "The seven cases of [Luberto] fig. 9 and the action that the controller takes in each, in scenes in which "
        "the sensors read so. Solid beams meet the object within 65 mm; a finger sees up to 60 mm by the curve. The "
        "figure's own actions are not described in the text; these follow from the planar hand. Where one would undo "
        "the last, a second one takes its place."
    )
    return Figure("recoveries", caption)


def _case(axes: Axes, case: Visibility, scene: SeenScene) -> None:
    now, action = scene.outputs(), RECOVERY[case]
    _draw_thing(axes, scene.thing, now.p_WO, now.yaw_O)
    draw_hand(axes, now.p_WH, now.yaw, now.q, now.range)
    seeing = " and ".join(name for i, name in enumerate(FINGER_NAMES) if case & (1 << i)) or "none"
    axes.set_title(f"{seeing}: {_ACTIONS[action]}", fontsize=9)
    arrow = {"arrowstyle": "-|>", "color": _ARROW, "lw": 2.0, "mutation_scale": 14, "shrinkA": 0, "shrinkB": 0}
    if action is Action.CLOSE:
        points = finger_points(now.p_WH, now.yaw, now.q)
        for finger, inwards in ((0, 1.0), (1, -1.0)):
            x, y = (1000 * points[finger][-1]).tolist()
            axes.annotate("", (x + 14, y + 40 * inwards), (x + 14, y), arrowprops=arrow)
        return
    d_x, d_y = _DIRECTIONS[action]
    axes.annotate("", (28 + 40 * d_x, 40 * d_y), (28, 0), arrowprops=arrow)


def draw_poses(rows: Sequence[Row], runs: Path, folder: Path) -> Figure | None:
    """Draw figure 5: each thing in nominal and perturbed pose, of the runs of rows; None without a run."""
    things = [thing for thing in SOLIDS if any(row["thing"] == thing.name.lower() for row in rows)]
    if not things:
        return None
    with figure(folder / "poses", 2, len(things), size=(2.1 * len(things) + 0.8, 4.6)) as panels:
        for k, axes in enumerate(panels):
            thing, perturbed = things[k % len(things)], k >= len(things)
            of_cell = [r for r in rows if r["thing"] == thing.name.lower() and r["perturbed"] is perturbed]
            for n, row in enumerate(of_cell):
                first = Record(runs / row["run"] / "signals.parquet").row(0)
                p_WO, yaw = first["scene.p_WO"][0], float(first["scene.yaw_O"][0])
                _draw_thing(axes, thing, p_WO, yaw, filled=n == 0)
            axes.plot([0], [0], "+", color=_SOFT, ms=8)
            axes.annotate(
                "", (-62, 0), (-88, 0), arrowprops={"arrowstyle": "-|>", "color": _SOFT, "shrinkA": 0, "shrinkB": 0}
            )
            axes.set(xlim=(-92, 118), ylim=(-105, 105), aspect="equal")
            axes.tick_params(labelbottom=perturbed, labelleft=k % len(things) == 0)
            if not perturbed:
                axes.set_title(thing.name.lower().replace("_", " "), fontsize=10)
            else:
                axes.set_xlabel("x (mm)")
        panels[0].set_ylabel("nominal\ny (mm)")
        panels[len(things)].set_ylabel("perturbed\ny (mm)")
    caption = (
        "Objects in nominal and perturbed poses as in [Luberto] fig. 5, from above: as they stand in the first run, "
        "filled, and in all others. The hand comes from the left; the cross is where vision saw the object."
    )
    return Figure("poses", caption)


def draw_sequences(rows: Sequence[Row], runs: Path, folder: Path) -> Figure | None:
    """Draw figure 11: the first runs of rows with the baby cup in pose (a), nominal and perturbed; None without."""
    cup = Thing.BABY_CUP_A
    found = [
        next((r for r in rows if r["thing"] == cup.name.lower() and r["perturbed"] is p), None) for p in (False, True)
    ]
    shown = [row for row in found if row is not None]
    if not shown:
        return None
    records = [Record(runs / row["run"] / "signals.parquet") for row in shown]
    moments = [_rows_of_moments(record) for record in records]
    columns = [name for name in _MOMENTS if any(name in m for m in moments)]
    low, high = _extent(records, [list(m.values()) for m in moments])
    wide, tall = high - low
    size = (11.0, 0.9 + len(shown) * 10.2 / len(columns) * tall / wide)
    with figure(folder / "sequences", len(shown), len(columns), size=size) as panels:
        for n, (row, record, at) in enumerate(zip(shown, records, moments, strict=True)):
            for j, name in enumerate(columns):
                axes = panels[n * len(columns) + j]
                axes.set(ylim=(low[1], high[1]), aspect="equal")
                axes.tick_params(labelbottom=n == len(shown) - 1, labelleft=j == 0)
                axes.set_xticks(np.arange(-400, 401, 100))
                axes.tick_params(axis="x", labelsize=8)
                axes.set(xlim=(low[0], high[0]))
                axes.grid(visible=False)
                if name in at:
                    draw_moment(axes, Parameters(thing=cup), record, at[name])
                    axes.set_title(f"{record.time[at[name]]:.1f} s, {name}", fontsize=9)
                if n == len(shown) - 1:
                    axes.set_xlabel("x (mm)")
            panels[n * len(columns)].set_ylabel(f"{'perturbed' if row['perturbed'] else 'nominal'}\ny (mm)")
    poses = " and ".join("perturbed" if row["perturbed"] else "nominal" for row in shown)
    caption = (
        f"The baby cup in configuration (a) as the IR-guided hand grasps it, {poses}, in moments as in [Luberto] "
        "fig. 11, from above. Beams are solid as far as they meet the object within the range."
    )
    return Figure("sequences", caption)


def _rows_of_moments(record: Record) -> dict[str, int]:
    """Return the first row of each moment that a run came to."""
    phase = record["reflex.phase"]
    return {name: int(np.argmax(phase == wanted)) for name, wanted in _MOMENTS.items() if np.any(phase == wanted)}


def _extent(records: Sequence[Record], rows: Sequence[Sequence[int]]) -> tuple[Any, Any]:
    """Return the corners, in mm, of a rectangle that holds hand and object at rows of records."""
    corners: list[Any] = []
    for record, of_record in zip(records, rows, strict=True):
        for k in of_record:
            hand = finger_points(record["scene.p_WH"][k], float(record["scene.yaw"][k]), record["scene.q"][k])
            corners += [1000 * np.vstack([*hand, record["scene.p_WH"][k]])]
            corners += [1000 * record["scene.p_WO"][k] + np.array([[-30.0, -30.0], [30.0, 30.0]])]
    points = np.vstack(corners)
    return points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN


def _draw_thing(axes: Axes, thing: Thing, p_WO: Floats, yaw: float, filled: bool = True) -> None:
    style: dict[str, Any] = {"facecolor": THING_COLOUR, "lw": 1.0} if filled else {"fill": False, "lw": 0.5}
    for part in placed(SOLIDS[thing], p_WO, yaw):
        axes.add_patch(Polygon(1000 * part, edgecolor=_EDGE, **style))
