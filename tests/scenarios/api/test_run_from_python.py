"""A run from Python is that of the command, byte for byte, and refuses what that refuses."""

import threading
from collections.abc import Callable
from dataclasses import fields, replace
from fractions import Fraction
from inspect import signature
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from support.commands import data_in
from support.cosim.native_units import native_fmu
from support.kept_runs import kept_run
from support.wording import Wording

import handover
from handover.controllers.ir_grasp.parameters import Strategy
from handover.cosim.exceptions import InvalidOptions
from handover.scenarios.api.arguments import master_options
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp

OPTIONS = set(handover.run.__kwdefaults__ or {}) | set(handover.sweep.__kwdefaults__ or {})


def system() -> handover.System:
    """5 N for 0.5 s on a robot of 10 kg."""
    s = handover.System()
    push = s.add("push", handover.unit("Push"), force=5.0, duration=0.5)
    robot = s.add("robot", handover.unit("FreeFlyer"), mass=10.0)
    s.connect(push.y.f_G, robot.u.f_G)
    return s


@pytest.fixture(scope="module")
def blind(tmp_path_factory: pytest.TempPathFactory) -> handover.Run:
    out = tmp_path_factory.mktemp("runs") / "blind"
    return handover.run("ir_grasp", seed=3, strategy=Strategy.BLIND, out=out)


def test_it_leaves_the_same_bytes_as_the_command_and_its_result_is_what_the_folder_has(blind: handover.Run):
    of_command = kept_run("run", "ir_grasp", "--seed", "3", "-p", "strategy=blind", "--no-report")
    assert (of_command / "signals.parquet").read_bytes() == (blind.folder / "signals.parquet").read_bytes()
    again = handover.Run(of_command)
    assert (again.seed, again.parameters["strategy"]) == (blind.seed, blind.parameters["strategy"]) == (3, "blind")
    assert (again.success, again.reason) == (blind.success, blind.reason)
    ours, theirs = (
        {name: value for name, value in run.metrics.items() if not name.startswith(("cpu_", "pace_", "peak_"))}
        for run in (blind, again)
    )
    assert ours.keys() == theirs.keys()
    np.testing.assert_array_equal(list(ours.values()), list(theirs.values()))  # with NaN of no sight


def test_a_system_is_run_and_its_results_outlive_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    runs = [handover.run(system(), stop=Fraction(3))]
    thread = threading.Thread(target=lambda: runs.append(handover.run(system(), stop=Fraction(3))))
    thread.start()
    thread.join()
    assert len({run.folder for run in runs}) == 2  # also within one second
    for run in runs:
        assert run.folder.parent == Path("runs")
        assert run.success
        assert run.signals["robot.v_WB"][-1] == pytest.approx([0.25, 0.0, 0.0])
    assert runs[0].scenario == "system"


class Nearer(IrGrasp):
    """A scenario of one's own, as one writes it into a notebook."""

    name: ClassVar[str] = "nearer"
    title: ClassVar[str] = "a hand that begins nearer"


def test_a_class_of_ones_own_is_run_and_drawn(tmp_path: Path):
    run = handover.run(Nearer, strategy="blind", standoff=0.05, stop=0.5, out=tmp_path / "n")
    assert run.scenario == "nearer"
    assert 'class="replay"' in run.replay().html
    with pytest.raises(handover.InvalidInput, match="it is a run of nearer, not of ir_grasp"):
        handover.Run(run.folder, IrGrasp())
    Nearer.name = "moved"  # as that of a notebook, it is found by no name then
    try:
        again = type("Nearer", (Nearer,), {"name": "nearer", "title": ""})()
        assert 'class="replay"' in handover.Run(run.folder, again).report().html
    finally:
        Nearer.name = "nearer"
    with handover.open(Nearer, strategy="blind") as s:
        assert "scene.p_WH" in s.outputs


def test_parameters_of_units_are_set(blind: handover.Run, tmp_path: Path):
    own = {"reflex.shake_cycles": 1}  # of 3, at 1.5 Hz
    run = handover.run("ir_grasp", seed=3, strategy="blind", parameters=own, out=tmp_path / "u")
    assert run.signals.time[-1] == pytest.approx(blind.signals.time[-1] - 2 / 1.5, abs=0.05)


def test_an_fmu_is_run_by_itself(tmp_path: Path):
    run = handover.run(handover.unit("Push", fmi=2), stop=1, out=tmp_path / "p", force=2, parameters={"start": 0.25})
    force = run.signals["Push.f_G"][:, 0]
    assert (force[run.signals.time < 0.24] == 0.0).all()
    assert force.max() == pytest.approx(2.0)


@pytest.mark.parametrize("subject", ["ir_grasp", native_fmu("gain")])
def test_a_keyword_that_is_like_an_argument_is_taken_for_one(subject: str | Path):
    with pytest.raises(handover.InvalidInput, match="as an argument, 'sead' is spelt seed") as raised:
        handover.run(subject, sead=1)
    assert isinstance(raised.value.__cause__, InvalidParameter)
    assert raised.value.__cause__.unknown == ("sead",)


def test_a_name_of_a_megabyte_is_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(handover.InvalidInput, match="has no parameter") as raised:
        handover.run("ir_grasp", parameters={"a" * 10**6: 1})
    assert len(str(raised.value)) < 1000
    monkeypatch.chdir(tmp_path)
    Path("nop").mkdir()
    Path("notes").touch()
    with pytest.raises(handover.InvalidInput, match=r"^nope: there is no such file or folder$"):  # neither has results
        handover.load("nope")


def test_units_are_isolated(tmp_path: Path):
    run = handover.run(native_fmu("gain"), stop=0.1, step=0.1, isolate="all", out=tmp_path / "i")
    assert data_in(run.folder, "run")["master"]["isolated"] == ["all"]


def test_a_unit_that_fails_is_a_result_without_success(tmp_path: Path):
    s = handover.System()
    s.add("robot", handover.unit("FreeFlyer"), mass=0.1, f_G=np.array([1e308, 0.0, 0.0]))
    run = handover.run(s, stop=5, out=tmp_path / "f")
    assert not run.success
    assert "robot" in run.reason


def test_no_shipped_parameter_has_the_name_of_an_option():
    for scenario in SCENARIOS.values():
        assert not {v.name for v in scenario.parameters()} & OPTIONS, scenario.name


class Unfindable(IrGrasp):
    """Is in no module that a worker could import by its path."""


Unfindable.__qualname__ = "nowhere.Unfindable"


CALLS: dict[str, Callable[[Any], object]] = {
    "run of a number": lambda h: h.run(3),
    "open of nothing": lambda h: h.open(None),
    "all faults": lambda h: h.run("ir_grasp", strategi="reflex", forward=-1, literal=np.bool_(True)),
    "a class of one's own": lambda h: h.run(Nearer, strategi="blind"),
    "system without a stop time": lambda h: h.run(system()),
    "system without units": lambda h: h.run(h.System(), stop=1),
    "system with parameters": lambda h: h.run(system(), stop=1, seed=3, mass=3),
    "seed beyond all numbers": lambda h: h.run("ir_grasp", seed=10**310),
    "half a seed": lambda h: h.run("ir_grasp", seed=0.5),
    "parameter given twice": lambda h: h.run("ir_grasp", thing=1, parameters={"thing": 2}),
    "no such place": lambda h: h.environment("ir_grasp", "reflexx"),
    "no such action": lambda h: h.environment("ir_grasp", "reflex", actions=["yaw"]),
    "place with pictures": lambda h: h.environment("helix_handover", "camera"),
    "place that only plays": lambda h: h.environment("flyer_impedance", "push"),
    "parameter of an environment": lambda h: h.environment("ir_grasp", "reflex", strategi=1),
    "sweep of no values": lambda h: h.sweep("ir_grasp", strategy=[]),
    "input of a file": lambda h: h.sweep(native_fmu("array_passer"), v=[1, 2]),
    "run of another class": lambda h: h.run(Path),
    "run of the base class": lambda h: h.run(Experiment),
    "lists of lists": lambda h: h.run("ir_grasp", strategy=[["a"], ["b", "c"]]),
    "sweep of a class without a module": lambda h: h.sweep(Unfindable),
    "list for a value": lambda h: h.run("ir_grasp", strategy=["blind"]),
    "array for a value": lambda h: h.run(IrGrasp, forward=np.array([0.1])),
    "environment with a tuple": lambda h: h.environment("ir_grasp", "reflex", thing=("cup",)),
    "parameters of a list": lambda h: h.run("ir_grasp", parameters=[1]),
    "units of a list": lambda h: h.run("ir_grasp", units=["servo"]),
    "out of a number": lambda h: h.run("ir_grasp", out=3),
    "record of a number": lambda h: h.run("ir_grasp", record=3),
    "isolate with a number": lambda h: h.run("ir_grasp", isolate=["arm", 3]),
    "options of a dict": lambda h: h.run("ir_grasp", options={"call_limit": 3}),
    "workers in words": lambda h: h.sweep("ir_grasp", workers="two"),
    "load of a number": lambda h: h.load(3),
    "load of nothing there": lambda h: h.load("no_such_run"),
    "describe of nothing": lambda h: h.describe(""),
    "unit of a number": lambda h: h.unit(3),
    "unit of FMI 4": lambda h: h.unit("Push", fmi=4),
    "unit of no names": lambda h: h.unit(":"),
    "stop beyond all numbers": lambda h: h.run("ir_grasp", stop=10**400),
    "stop of too many digits": lambda h: h.run("ir_grasp", stop=1 + Fraction(1, 10**400)),
    "scheduler of a number": lambda h: h.sweep("ir_grasp", scheduler=3),
    "place of a number": lambda h: h.open("ir_grasp", place=3),
    "actions of a number": lambda h: h.environment("ir_grasp", "reflex", actions=3),
    "place of nothing": lambda h: h.environment("ir_grasp", None),
    "reward of a number": lambda h: h.environment("ir_grasp", "reflex", reward=3),
    "options of an environment of a dict": lambda h: h.environment("ir_grasp", "reflex", options={}),
    "unit of FMI 2 with pictures": lambda h: h.unit("StereoCamera", fmi=2),
    "argument as the command calls it": lambda h: h.run("ir_grasp", input="u.csv"),
    "argument that is misspelled": lambda h: h.sweep("ir_grasp", sees=2),
    "option of the master": lambda h: h.open("ir_grasp", tolerance=1e-6),
    "Run of a number": lambda h: h.Run(3),
    "tolerance of a text": lambda h: h.AdaptiveStep(relative="x"),
    "step that is not exact": lambda h: h.AdaptiveStep(smallest=0.1),
    "report in words": lambda h: h.run("ir_grasp", report="no"),
    "progress in words": lambda h: h.run("ir_grasp", progress="no"),
    "paired in words": lambda h: h.sweep("ir_grasp", paired="no"),
    "values in a text": lambda h: h.sweep("ir_grasp", strategy="reflex,blind"),
    "values without order": lambda h: h.sweep("ir_grasp", strategy={"reflex"}),
    "values without end": lambda h: h.sweep("ir_grasp", forward=range(10**30)),
    "out that no file system takes": lambda h: h.run("ir_grasp", out="a\0b"),
    "flag of a text": lambda h: h.MasterOptions(strict="no"),
    "another algorithm in the options": lambda h: h.run(
        "ir_grasp", algorithm="jacobi", options=h.MasterOptions(algorithm=h.Algorithm.NEWTON)
    ),
    "other isolated units in the options": lambda h: h.run(
        "ir_grasp", isolate="scene", options=h.MasterOptions(isolated=("reflex",))
    ),
}


@pytest.mark.parametrize("call", CALLS)
def test_what_cannot_be_run_is_reported_in_one_sentence_and_nothing_is_written(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((handover.InvalidInput, InvalidOptions)) as raised:
        CALLS[call](handover)
    wording.check(raised.value)
    assert "\n" not in str(raised.value)
    assert not any(tmp_path.iterdir())


def test_options_go_with_arguments_that_they_leave_open_or_say_alike():
    options = handover.MasterOptions(tolerance=1e-6, isolated=("arm", "hand"))
    chosen = master_options(options, "newton", ["hand", "arm"])
    assert chosen == replace(options, algorithm=handover.Algorithm.NEWTON)
    assert [*signature(handover.MasterOptions).parameters] == [f.name for f in fields(handover.MasterOptions)]


def test_a_file_in_a_run_s_folder_is_reported_to_be_one(tmp_path: Path):
    file = tmp_path / "run.json"
    file.write_text("{}")
    with pytest.raises(handover.InvalidInput, match="it is a file; expected the folder"):
        handover.load(file)
