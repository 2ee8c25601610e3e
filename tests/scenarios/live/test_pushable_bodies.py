"""Which bodies of which scenarios can be pushed: their inputs are there, and a push moves what is pressed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.commands import refusal
from support.scenarios.flyer_runs import task_of
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.time_series import TimeSeries
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.task import InputSources

_STOP = 0.4


def tell_nobody(*_: float) -> None:
    pass


def pushed_run(name: str, out: Path, forces: Mapping[str, Sequence[float] | Floats], *given: str) -> Record:
    """Run a scenario for a moment with constant forces and points on what can be pushed."""
    series = {end: TimeSeries([0.0], [list(value)], linear=False) for end, value in forces.items()}
    task: Any = task_of(SCENARIOS[name], out, *given)
    inputs = InputSources(series, {"from": "program"})
    run_task(replace(task, pushed=True, stop=Fraction(str(_STOP)), sources=inputs), tell_nobody, Interruption())
    return Record(out / "signals.parquet")


@pytest.mark.parametrize(
    ("name", "given", "unit"),
    [
        pytest.param("flyer_two_robots", (), "robot_2", marks=pytest.mark.slow),
        pytest.param("flyer_arm_impedance", ("begin=30",), "robot", marks=pytest.mark.slow),
        pytest.param("helix_reach", (), "arm", marks=pytest.mark.slow),
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
        if push.force == "f_Q":  # the gripper of a robot with an arm, which leads its base
            of_base = record[f"{unit}.p_WB"][-1] - alone[f"{unit}.p_WB"][-1]
            assert np.linalg.norm(way) > 2.0 * np.linalg.norm(of_base)
            assert np.abs(record[f"{unit}.q_J"][-1] - record[f"{unit}.q_J"][0]).max() > 0.01
        scene = experiment.replay(parameters, record)
        assert scene is not None
        assert set(push.labels) <= {body.label for body in scene.bodies}
        arrows = [line.points[-1] for line in scene.lines if line.label == "force of the push"]
        assert sum(bool(np.isfinite(points).all()) for points in arrows) == 1
        colours = {line.label: line.colour for line in (*scene.lines, *scene.fixed) if line.radii is None}
        assert len(set(colours.values())) == len(colours)
    assert (f"{unit}.f_Q" in {f"{unit}.{push.force}" for push in pushes}) == (name == "flyer_arm_impedance")


@pytest.mark.parametrize(
    "given",
    [
        pytest.param(("ir_grasp", "--live"), id="nothing to push"),
        pytest.param(("flyer_impedance",), id="without a page"),
    ],
)
def test_pushes_that_cannot_be_are_refused_before_anything_runs(given: Sequence[str], tmp_path: Path, wording: Wording):
    wording.check(refusal("run", *given, "--push", "--out", tmp_path / "run"))
    assert not (tmp_path / "run").exists()
