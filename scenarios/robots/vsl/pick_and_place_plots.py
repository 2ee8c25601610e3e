"""Figures and replay of a pick and place: heights, forces and pressures over time, and the arm in space."""

from pathlib import Path

import numpy as np

from handover.controllers.vsl.pick_and_place import PHASES, TaskPhase
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.experiment.replay import Body, Line, Replay, prism
from handover.scenarios.experiment.time_plot import Curve, Level, Phase, TimeFigure, TimePlot, phases_of
from handover.scenarios.robots.vsl.parameters import BAR
from handover.scenarios.robots.vsl.pick_and_place_evaluation import PickAndPlaceParameters
from handover.scenarios.robots.vsl.replay import arm_bodies, arm_lines

_SIDE, _TABLE = 0.04, 0.006
"""Side of the object, which is drawn as a box, and thickness of the table, m (assumed)."""
_OBJECT, _TABLE_COLOUR, _TIP = "#b58a1b", "#9aa3af", "#d1602b"


def phases_of_task(record: Record) -> tuple[Phase, ...]:
    """Return the parts of the task by their names."""
    return phases_of(record, "planner.phase", dict(enumerate(PHASES)))


def figures_of_pick_and_place(parameters: PickAndPlaceParameters, record: Record) -> list[TimeFigure]:
    """Return the figure of heights, force and pressures."""
    phases = phases_of_task(record)
    heights = {
        "desired": record["planner.p_WG_goal"],
        "tip": record["arm.p_WG"],
        "top of the object": record["gripper.p_WO"],
    }
    pressures = {"commanded": record["planner.p_cmd"], "measured": record["arm.p_meas"]}
    return [
        TimeFigure(
            name="task",
            caption="Heights in W, with that of the face on which the object stands, and the pressure in link 3. "
            "Forces are the largest within each period, of that face on the gripper or on what it holds.",
            plots=[
                TimePlot(
                    title="Heights",
                    quantity="z in W",
                    unit="mm",
                    curves=[Curve(label=label, values=1000 * p[:, 2]) for label, p in heights.items()],
                    levels=(Level(label="face", value=1000 * float(parameters.pick[2])),),
                    phases=phases,
                ),
                TimePlot(
                    title="Contact",
                    quantity="force",
                    unit="N",
                    curves=[Curve(label="force", values=record["arm.f_G"])],
                    phases=phases,
                    limits=(0.0, None),
                ),
                TimePlot(
                    title="Pressure in link 3",
                    quantity="pressure",
                    unit="bar",
                    curves=[Curve(label=label, values=p[:, 1] / BAR) for label, p in pressures.items()],
                    phases=phases,
                    limits=(0.0, None),
                ),
            ],
        )
    ]


def draw_pick_and_place(parameters: PickAndPlaceParameters, record: Record, folder: Path) -> list[Figure]:
    """Draw the way of the tip, and the arm as it picks up and as it puts down."""
    goal, tip, shape, phase = (record[n] for n in ("planner.p_WG_goal", "arm.p_WG", "arm.shape", "planner.phase"))
    on_task = phase > TaskPhase.SETTLE
    with figure(folder / "way", 1, size=(8.0, 5.2)) as (axes,):
        axes.plot(*_in_plane(goal[on_task]), color=COLOURS[2], lw=3.0, alpha=0.35, label="desired")
        axes.plot(*_in_plane(tip[on_task]), color=COLOURS[1], lw=1.2, label="tip")
        for k, (name, part) in enumerate({"picks up": TaskPhase.GRASP, "puts down": TaskPhase.RELEASE}.items()):
            rows = np.flatnonzero(phase == part)
            if len(rows):
                axes.plot(*_in_plane(shape[rows[-1]]), color=COLOURS[(0, 3)[k]], lw=2.4, label=f"arm as it {name}")
        axes.axhline(1000 * float(parameters.pick[2]), color="#4d5866", lw=0.8, ls=(0, (7, 3)), label="object's top")
        axes.set(xlabel="x in W (mm)", ylabel="z in W (mm)", aspect="equal")
        legend_below(axes)
    caption = "The way of the tip, and the arm at the ends of the grasp and of the release. Equal scales."
    return [Figure("way", caption)]


def _in_plane(positions: Floats) -> tuple[Floats, Floats]:
    return 1000 * positions[:, 0], 1000 * positions[:, 2]


def replay_pick_and_place(parameters: PickAndPlaceParameters, record: Record) -> Replay:
    """Return arm, object, and the table on which it stands."""
    shape, tip, top = record["arm.shape"], record["arm.p_WG"], float(parameters.pick[2])
    corners = _SIDE / 2.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    low, high = (f(parameters.pick[:2], parameters.place[:2]) for f in (np.minimum, np.maximum))
    reach = 2.0 * _SIDE
    outline = np.array(
        [low - reach, [high[0] + reach, low[1] - reach], high + reach, [low[0] - reach, high[1] + reach]]
    )
    table = prism(outline, top - _SIDE - _TABLE, top - _SIDE)
    return Replay(
        bodies=[
            Body(label="table", colour=_TABLE_COLOUR, mesh=table, p_WB=np.zeros((1, 3)), opacity=0.5),
            *arm_bodies(shape),
            Body(label="object", colour=_OBJECT, mesh=prism(corners, -_SIDE, 0.0), p_WB=record["gripper.p_WO"]),
        ],
        lines=[
            *arm_lines(shape),
            Line(label="path of the tip", colour=_TIP, points=tip[:, None], width=4.0, trail=True),
        ],
        eye=(0.45, -1.45, 0.35),
        phases=phases_of_task(record),
        floor=top - _SIDE - _TABLE,
        follow="gripper",
        notes=("The object is drawn as a box of 40 mm: the arm meets its top only.",),
    )
