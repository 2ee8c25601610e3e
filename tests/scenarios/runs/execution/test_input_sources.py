"""Runs whose inputs come from outside: from another process, from the record of a run, or from where they cannot."""

import json
import shutil
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.commands import call, data_in, refusal
from support.cosim.native_units import native_fmu
from support.kept_runs import kept_run
from support.scenarios.flyer_runs import task_of

import handover
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.cosim.system.time_series import ExternalSource, TimeSeries
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.robots.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.input_sources import give_inputs, played_back, resumed_inputs
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.task import InputSources

GOALS = {
    "person.p_WH_track": "person.p_WH_goal",
    "person.q_WH_track": "person.q_WH_goal",
    "person.finger_track": "person.finger_goal",
    "person.closed_track": "person.closed_goal",
}


class Scripted:
    """Has a hand do what another one wanted at the time, by shared inputs, before they are read."""

    def __init__(self, inputs: SharedInputs, wanted: Record) -> None:
        self._inputs = inputs
        self._series = {name: wanted.series(goal) for name, goal in GOALS.items()}
        self._written = -1.0

    def sources(self) -> dict[str, ExternalSource]:
        return {name: _After(self, source) for name, source in self._inputs.sources().items()}

    def write(self, t: float) -> None:
        if t != self._written:
            self._written = t
            self._inputs.set({name: series.at(t) for name, series in self._series.items()}, time.monotonic())


class _After:
    def __init__(self, script: Scripted, source: ExternalSource) -> None:
        self._script, self._source = script, source

    def at(self, t: float) -> Sequence[Any] | NDArray[Any] | None:
        self._script.write(t)
        return self._source.at(t)


def tell_nobody(*_: float) -> None:
    pass


def led_by_script(wanted: Path, out: Path) -> None:
    sizes = {"person.p_WH_track": 3, "person.q_WH_track": 4, "person.finger_track": 14, "person.closed_track": 1}
    inputs = SharedInputs.create(out.with_suffix(".inputs"), sizes, ["person.age"])
    script = Scripted(inputs, Record(wanted / "signals.parquet"))
    inputs = InputSources(script.sources(), {"from": "program", "what": "a script"})
    task = replace(task_of(RobotToHuman, out, "hand=outside"), sources=inputs, stop=Fraction(1, 2))
    run_task(task, tell_nobody, Interruption())


@pytest.mark.slow
def test_a_run_led_by_shared_inputs_is_played_back_byte_for_byte(tmp_path: Path):
    person = kept_run("run", "flyer_robot_to_human", "--no-report", "--stop", "1")
    led_by_script(person, tmp_path / "led")
    led = Record(tmp_path / "led" / "signals.parquet")
    assert led["person.age"].max() < 0.2
    assert np.ptp(led["person.p_WH_track"], axis=0).max() > 0.001
    again: dict[str, Any] = {"hand": "outside", "inputs_from": tmp_path / "led", "stop": 0.5, "progress": False}
    handover.run("flyer_robot_to_human", out=tmp_path / "again", **again)
    a, b = ((tmp_path / name / "signals.parquet").read_bytes() for name in ("led", "again"))
    assert a == b
    reported = [data_in(tmp_path / name, "run") for name in ("led", "again")]
    assert reported[0]["inputs"] == {"from": "program", "what": "a script"}
    assert (reported[1]["inputs"]["from"], reported[1]["inputs"]["folder"]) == ("run", str(tmp_path / "led"))
    assert reported[0]["external_inputs"] == reported[1]["external_inputs"] == [*GOALS, "person.age"]
    handover.run("flyer_robot_to_human", out=tmp_path / "other", propulsion="nozzles", **again)
    meets_the_same_hand = Record(tmp_path / "other" / "signals.parquet")
    np.testing.assert_array_equal(meets_the_same_hand["person.p_WH_track"], led["person.p_WH_track"])
    assert not np.array_equal(meets_the_same_hand["robot.p_WG"], led["robot.p_WG"])


def pushed_mass(source: ExternalSource | None) -> System:
    system = System()
    mass = system.add("mass", native_fmu("mass", 3))
    system.external(mass.u.f, source)
    return system


def test_a_system_wired_in_python_is_played_back(tmp_path: Path):
    pushes = TimeSeries([0.0, 0.1, 0.3], [[0.0], [2.0], [-1.0]], linear=False)
    at: dict[str, Any] = {"stop": Fraction(1, 2), "progress": False}
    handover.run(pushed_mass(pushes), out=tmp_path / "a", **at)
    handover.run(pushed_mass(None), out=tmp_path / "b", inputs_from=tmp_path / "a", **at)
    a, b = ((tmp_path / name / "signals.parquet").read_bytes() for name in "ab")
    assert a == b
    assert Record(tmp_path / "b" / "signals.parquet")["mass.v"][-1] != 0.0
    own = pushed_mass(None)
    handover.run(own, out=tmp_path / "c", inputs_from=tmp_path / "a", **at)
    handover.run(own, out=tmp_path / "d", **at)
    assert (tmp_path / "c" / "signals.parquet").read_bytes() == a
    assert not Record(tmp_path / "d" / "signals.parquet")["mass.v"].any()


def test_a_run_that_lacks_inputs_is_refused_before_anything_is_written(tmp_path: Path):
    handover.run(pushed_mass(None), out=tmp_path / "mass", stop=Fraction(1, 10), progress=False)
    for given, why in (
        (["-p", "hand=outside"], "person.age: comes from outside in this run, and did not in the recorded one"),
        ([], "mass.f: this run takes no values from outside for it; with which parameters the recorded run takes them"),
    ):
        out = tmp_path / "out"
        assert why in refusal("run", "flyer_robot_to_human", *given, "--inputs-from", tmp_path / "mass", "--out", out)
        assert not out.exists()


def test_a_run_that_goes_on_after_its_recorded_inputs_says_when_they_end(tmp_path: Path):
    task = task_of(FlyerImpedance, tmp_path / "pushed")
    run_task(replace(task, stop=Fraction(2, 25), pushed=True), tell_nobody, Interruption())
    given = ("run", "flyer_impedance", "--push", "--inputs-from", tmp_path / "pushed", "--no-report")
    output = call(*given, "--stop", "0.16", "--out", tmp_path / "again").output
    assert "the recorded inputs end at 0.08 s, and the run went on until 0.16 s" in output


def test_a_folder_without_inputs_from_outside_and_a_series_of_another_size_are_refused(tmp_path: Path):
    run = {"scenario": "a", "parameters": {}}
    for content, why in (
        (None, "not the folder of a run"),
        (run, "the run had no inputs from outside"),
        ({**run, "external_inputs": ["mass.f"]}, "no record"),
    ):
        if content is not None:
            (tmp_path / "run.json").write_text(json.dumps(content))
        with pytest.raises(InvalidRunFolder, match=why):
            played_back(tmp_path)
    inputs: Mapping[str, ExternalSource] = {"mass.f": TimeSeries([0.0], [[1.0, 2.0]], linear=False)}
    with pytest.raises(UsageError, match=r"mass\.f: 2 values a time where 1 is right"):
        give_inputs(pushed_mass(None), InputSources(inputs, {}))


def test_a_run_is_resumed_with_the_inputs_that_it_played_back_and_not_with_those_of_a_program(tmp_path: Path):
    handover.run(pushed_mass(None), out=tmp_path / "mass", stop=Fraction(1, 10), progress=False)
    origin = played_back(tmp_path / "mass").origin
    folder = RunFolder(tmp_path / "resumed")
    assert resumed_inputs(folder, None) is None
    inputs = resumed_inputs(folder, origin)
    assert inputs is not None
    assert list(inputs.sources) == ["mass.f"]
    with pytest.raises(InvalidRunFolder, match="from a program, which is gone; begin it once more with --inputs-from"):
        resumed_inputs(folder, {"from": "program"})
    with pytest.raises(InvalidRunFolder, match="is another one"):
        resumed_inputs(folder, {**origin, "sha256": "0"})


def held_until(released: float, force: float) -> dict[str, ExternalSource]:
    """Return a push at a point that a person holds until a time, s."""
    times = [0.0, 0.1, released]
    return {
        "robot.f_P": TimeSeries(times, [[0.0] * 3, [0.0, force, 0.0], [0.0] * 3], linear=False),
        "robot.p_BP": TimeSeries(times, [[0.0] * 3, [0.16, 0.0, 0.1], [0.16, 0.0, 0.1]], linear=False),
    }


@pytest.mark.parametrize("is_page", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["page", "nobody"])
def test_a_run_that_could_be_pushed_is_resumed_as_it_was_recorded_and_is_then_let_go(tmp_path: Path, is_page: bool):
    task = task_of(FlyerImpedance, tmp_path / "whole", "begin=30")
    inputs = InputSources(held_until(0.6, 4.0), {"from": "page"}) if is_page else None
    task = replace(task, every=Fraction(1, 5), stop=Fraction(4, 5), pushed=True, sources=inputs)
    at = {"held": 0.45, "released": 0.65}  # when the run is killed: as it is, its folder is copied

    def snapshot(t: float, _stop: float) -> None:
        for name, when in at.items():
            if t >= when and not (tmp_path / name).exists():
                shutil.copytree(tmp_path / "whole", tmp_path / name)

    run_task(task, snapshot, Interruption())
    whole = Record(tmp_path / "whole" / "signals.parquet")
    for name in at:
        reported = call("resume", tmp_path / name, "--no-report")
        assert (tmp_path / name / "summary.json").is_file(), reported.output
    released, held = (tmp_path / name / "signals.parquet" for name in ("released", "held"))
    assert released.read_bytes() == (tmp_path / "whole" / "signals.parquet").read_bytes()
    record = Record(held)
    assert len(record.time) == len(whole.time)
    before = whole.time <= 0.45
    np.testing.assert_array_equal(record["robot.p_WB"][before], whole["robot.p_WB"][before])
    if is_page:
        assert record["robot.f_P"][before].max() == whole["robot.f_P"][~before].max() == 4.0
        assert record["robot.f_P"][whole.time > 0.47].max() == 0.0
        inputs_of_run = data_in(tmp_path / "held", "run")["inputs"]
        assert (inputs_of_run["from"], inputs_of_run["until"]) == ("page", pytest.approx(0.45, abs=0.02))


def test_a_hand_whose_page_is_gone_stays_and_its_sample_grows_old(tmp_path: Path):
    person = kept_run("run", "flyer_robot_to_human", "--no-report", "--stop", "1")
    wanted = Record(person / "signals.parquet")
    sources: dict[str, ExternalSource] = {name: wanted.series(goal) for name, goal in GOALS.items()}
    sources["person.age"] = TimeSeries([0.0], [[0.02]], linear=False)
    inputs = InputSources(sources, {"from": "page"})
    task = replace(task_of(RobotToHuman, tmp_path / "led", "hand=outside"), sources=inputs, stop=Fraction(1, 2))
    run_task(task, tell_nobody, Interruption())
    led = RobotToHuman().led_hand(task.parameters)
    resumed = resumed_inputs(task.folder, {"from": "page"}, (), led)
    assert resumed is not None
    end = Record(tmp_path / "led" / "signals.parquet").time[-1]
    assert np.asarray(resumed.sources["person.age"].at(end)).tolist() == [0.02]
    assert np.asarray(resumed.sources["person.age"].at(end + 3.0)) == pytest.approx([3.02])
    last = wanted.series("person.p_WH_goal").at(end)
    np.testing.assert_array_equal(resumed.sources["person.p_WH_track"].at(end + 3.0), last)
