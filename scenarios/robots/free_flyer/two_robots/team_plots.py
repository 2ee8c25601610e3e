"""Curves over time of a handover by two robots, and the scene at its moments."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from handover.cosim.blocks.plain_rotation import vector
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Level, Phase, Stroke, TimeFigure, TimePlot, phases_of
from handover.scenarios.robots.free_flyer.handover.handover_plots import roll_pitch_yaw
from handover.scenarios.robots.free_flyer.parameters import ROBOTS, TeamParameters, TeamTask
from handover.scenarios.robots.free_flyer.push.push_plots import CAPTION, plot_thrust
from handover.scenarios.robots.free_flyer.scene import Solid, draw_scene, hand_at, jaw_gap, large_object_at, robot_at
from handover.scenarios.robots.free_flyer.two_robots.team_evaluation import TeamEvaluator, internal_force

_STROKES: tuple[Stroke, Stroke] = ("solid", "dashed")
_PALETTE = ("gripper 1", "gripper 2", "object", "hand 1", "hand 2")


def figures_of_team(parameters: TeamParameters, record: Record) -> list[TimeFigure]:
    """Return paths and turns, forces with who holds the object, both grippers, and each robot's thrust."""
    phases = phases_of(record, "decision.phase_1")
    hands = parameters.hand_numbers
    return [
        TimeFigure(
            name="positions",
            caption="Positions of grippers, hands and object in W; shaded by the first robot's phases.",
            plots=_positions(record, hands, phases),
        ),
        TimeFigure(
            name="orientation",
            caption="Orientation of the object in W; shaded by the first robot's phases.",
            plots=_orientation(record, phases),
        ),
        TimeFigure(
            name="forces",
            caption="Forces on grippers, shaded by which of them hold the object, and the same on hands; and the part "
            "of the grippers' forces that cancels along the line between them.",
            plots=_forces(record, hands),
        ),
        TimeFigure(
            name="grippers",
            caption="Angles of the grippers, with the threshold above which they count as full, and the speeds by "
            "which each robot judges whether a person moves it. Shaded by the first robot's phases.",
            plots=[_angles(record, phases), _speeds(parameters, record, phases)],
        ),
        *(
            TimeFigure(
                name=f"thrust_{i}",
                caption=f"Robot {i}. {CAPTION}",
                plots=plot_thrust(
                    record,
                    (f"impedance_{i}", f"pose_{i}"),
                    phases_of(record, f"decision.phase_{i}"),
                    f"thrusters_{i}",
                    f"robot {i}'s thrusters",
                ),
                columns=2,
            )
            for i in ROBOTS
        ),
    ]


def draw_team(parameters: TeamParameters, evaluator: TeamEvaluator, record: Record, folder: Path) -> list[Figure]:
    """Draw the scene at the start, the signal, the pull or push, and the end, into a folder."""
    hands = parameters.hand_numbers
    signalled = [r.signalled for r in evaluator.robots if r.signalled is not None]
    felt = [r.felt for r in evaluator.robots if r.felt is not None]
    touch = "pull felt" if parameters.task is TeamTask.ROBOTS_TO_HUMAN else "push felt"
    times = [(0.0, "start"), *((max(t), what) for t, what in ((signalled, "signal"), (felt, touch)) if t)]
    times.append((float(record.time[-1]), "end"))
    rows = {f"{t:.1f} s, {what}": min(int(np.searchsorted(record.time, t)), len(record.time) - 1) for t, what in times}
    gaps = {i: jaw_gap(record, f"_{i}") for i in ROBOTS}
    moments: dict[str, list[Solid]] = {}
    for title, row in rows.items():
        robots = [part for i in ROBOTS for part in robot_at(record, row, float(gaps[i][row]), f"robot_{i}")]
        people = [part for h in hands for part in hand_at(record, row, f"_{h}")]
        moments[title] = [*robots, *large_object_at(record, row, parameters.hands), *people]
    return [draw_scene(moments, "Blue: jaws; orange: object, with its handles in grey.", folder)]


def _positions(record: Record, hands: Sequence[str], phases: Sequence[Phase]) -> list[TimePlot]:
    followed = {f"gripper {i}": 1000 * record[f"robot_{i}.p_WG"] for i in ROBOTS}
    followed |= {"object": 1000 * record["person.p_WO"]}
    followed |= {f"hand {h}": 1000 * record[f"person.p_WH_{h}"] for h in hands}
    return [
        TimePlot(
            title=f"Grippers, hands and object along {axis} of W",
            quantity=f"{axis} in W",
            unit="mm",
            curves=[
                Curve(label=name, values=p[:, k], stroke="dashed" if name == "object" else "solid")
                for name, p in followed.items()
            ],
            phases=phases,
            palette=_PALETTE,
        )
        for k, axis in enumerate("xyz")
    ]


def _orientation(record: Record, phases: Sequence[Phase]) -> list[TimePlot]:
    angles = roll_pitch_yaw(record["person.q_WO"])
    curves = [Curve(label=name, values=angles[:, k]) for k, name in enumerate(("roll", "pitch", "yaw"))]
    return [TimePlot(title="Orientation of the object in W", quantity="angle", unit="°", curves=curves, phases=phases)]


def _forces(record: Record, hands: Sequence[str]) -> list[TimePlot]:
    on_grippers = {i: record[f"person.f_G_{i}"] for i in ROBOTS}
    at = {i: record[f"robot_{i}.p_WG"] for i in ROBOTS}
    rows = zip(*(map(vector, values) for values in (*on_grippers.values(), *at.values())), strict=True)
    internal = np.array([internal_force(f_1, f_2, p_1, p_2) for f_1, f_2, p_1, p_2 in rows])
    return [
        TimePlot(
            title="Forces on the grippers, and which hold the object",
            quantity="force",
            unit="N",
            phases=phases_of(record, "person.grippers_holding"),
            curves=[
                *(
                    Curve(label=f"on gripper {i}", values=np.linalg.norm(f, axis=1), stroke=stroke)
                    for (i, f), stroke in zip(on_grippers.items(), _STROKES, strict=True)
                ),
                Curve(label="internal: pressing, below 0 drawing apart", values=internal, stroke="dotted"),
            ],
        ),
        TimePlot(
            title="Forces on the hands, and which hold the object",
            quantity="force",
            unit="N",
            phases=phases_of(record, "person.hands_holding"),
            curves=[
                Curve(label=f"on hand {h}", values=np.linalg.norm(record[f"person.f_H_{h}"], axis=1), stroke=stroke)
                for h, stroke in zip(hands, _STROKES, strict=False)
            ],
        ),
    ]


def _angles(record: Record, phases: Sequence[Phase]) -> TimePlot:
    threshold = float(np.degrees(paper_values("free_flyer", "published")["angle_threshold"]))
    return TimePlot(
        title="Angles of the grippers",
        quantity="angle",
        unit="°",
        phases=phases,
        curves=[
            Curve(label=f"gripper {i}", values=np.degrees(record[f"person.gripper_angle_{i}"]), stroke=stroke)
            for i, stroke in zip(ROBOTS, _STROKES, strict=True)
        ],
        levels=(Level(label="counts as full", value=threshold),),
        limits=(0.0, None),
    )


def _speeds(parameters: TeamParameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    threshold = parameters.threshold("HAND" if parameters.task is TeamTask.ROBOTS_TO_HUMAN else "GRIPPER")
    return TimePlot(
        title="Speeds by which the robots judge",
        quantity="speed",
        unit="m/s",
        phases=phases,
        curves=[
            *(
                Curve(label=f"as robot {i} judges", values=record[f"decision.speed_{i}"], stroke=stroke)
                for i, stroke in zip(ROBOTS, _STROKES, strict=True)
            ),
            *(
                Curve(label=f"gripper {i}", values=np.linalg.norm(record[f"robot_{i}.v_WG"], axis=1), stroke="dotted")
                for i in ROBOTS
            ),
        ],
        levels=(Level(label="at which they act, while they wait", value=threshold),),
        limits=(0.0, None),
    )
