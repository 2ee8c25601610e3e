"""Which bodies of which scenarios can be pushed: their inputs are there, and a push moves what is pressed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from flyer_runs import task_of

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.time_series import TimeSeries
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.runner import run_task
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.results.task import InputSources

_STOP = 0.4


def tell_nobody(*_: float) -> None:
    pass


def pushed_run(name: str, out: Path, forces: Mapping[str, Sequence[float] | Floats], *given: str) -> Record:
    """Run a scenario for a moment with constant forces and points on what can be pushed."""
    series = {end: TimeSeries([0.0], [list(value)], linear=False) for end, value in forces.items()}
    task: Any = task_of(SCENARIOS[name], out, *given)
    inputs = InputSources(series, {"from": "program"})
    run_task(replace(task, pushed=True, stop=Fraction(str(_STOP)), inputs=inputs), tell_nobody, Interruption())
    return Record(out / "signals.parquet")


@pytest.mark.parametrize(
    ("name", "given", "unit"),
    [
        ("flyer_two_robots", (), "robot_1"),
        ("flyer_two_robots", (), "robot_2"),
        ("flyer_arm_impedance", ("begin=30",), "robot"),
        ("helix_reach", (), "arm"),
    ],
)
def test_each_of_its_bodies_yields_to_a_push_and_the_scene_shows_it(
    tmp_path: Path, name: str, given: Sequence[str], unit: str
):
    experiment = SCENARIOS[name]()
    parameters = task_of(SCENARIOS[name], tmp_path / "unused", *given).parameters
    pushes = [push for push in experiment.pushes(parameters) if push.unit == unit]
    assert pushes
    alone = pushed_run(name, tmp_path / "alone", {}, *given)
    for k, push in enumerate(pushes):
        force = push.greatest * np.array([0.0, 0.6, 0.8])
        values = {f"{unit}.{push.force}": force} | ({f"{unit}.{push.point}": np.zeros(3)} if push.point else {})
        record = pushed_run(name, tmp_path / f"pushed{k}", values, *given)
        assert (record[f"{unit}.{push.force}"] == force).all()
        way = record[f"{unit}.p_WG"][-1] - alone[f"{unit}.p_WG"][-1]
        assert way @ force > 0.0
        assert np.linalg.norm(way) > 1e-3
        scene = experiment.replay(parameters, record)
        assert scene is not None
        assert set(push.labels) <= {body.label for body in scene.bodies}
        arrows = [line.points[-1] for line in scene.lines if line.label == "force of the push"]
        assert sum(bool(np.isfinite(points).all()) for points in arrows) == 1


def test_lines_and_points_of_a_pushed_helix_are_told_apart_by_their_colours(tmp_path: Path):
    record = pushed_run("helix_handover", tmp_path / "run", {"arm.f_P": [0.0, 0.5, 0.0]})
    scene = SCENARIOS["helix_handover"]().replay(parse_parameters(SCENARIOS["helix_handover"], ()), record)
    assert scene is not None
    colours = {line.label: line.colour for line in (*scene.lines, *scene.fixed) if line.radii is None}
    assert colours.keys() == {"ball, estimated", "gripper, estimated", "force of the push", "cameras"}
    assert len(set(colours.values())) == len(colours)


def test_where_nothing_can_be_pushed_that_is_told_before_anything_runs(tmp_path: Path):
    done = CliRunner().invoke(main, ["run", "ir_grasp", "--live", "--push", "--out", str(tmp_path / "run")])
    assert done.exit_code == 2
    assert "--push: nothing can be pushed in ir_grasp" in done.output
    assert not (tmp_path / "run").exists()


def test_the_pushed_gripper_of_a_robot_with_an_arm_leads_its_base(tmp_path: Path):
    force = {"robot.f_Q": [0.0, 3.0, 0.0], "robot.p_GQ": [0.0, 0.0, 0.0]}
    record = pushed_run("flyer_arm_impedance", tmp_path / "gripper", force, "begin=30")
    moved = {name: np.linalg.norm(np.ptp(record[f"robot.{name}"], axis=0)) for name in ("p_WG", "p_WB")}
    assert moved["p_WG"] > 2.0 * moved["p_WB"]
    assert np.abs(record["robot.q_J"][-1] - record["robot.q_J"][0]).max() > 0.01


def test_a_run_without_a_page_does_not_take_pushes(tmp_path: Path):
    done = CliRunner().invoke(main, ["run", "flyer_impedance", "--push", "--out", str(tmp_path / "run")])
    assert done.exit_code == 2
    assert "--push: it is the page of --live that pushes" in done.output
    assert not (tmp_path / "run").exists()
