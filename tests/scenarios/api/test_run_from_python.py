"""A run from Python is that of the command, byte for byte, and refuses what that refuses."""

import threading
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from click.testing import CliRunner

import handover
from handover.controllers.ir_grasp.parameters import Strategy
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp

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
    return handover.run("ir_grasp", seed=4, strategy=Strategy.BLIND, standoff=0.06, out=out)


def test_it_leaves_the_same_bytes_as_the_command(blind: handover.Run, tmp_path: Path):
    command = ["run", "ir_grasp", "--seed", "4", "-p", "strategy=blind", "-p", "standoff=0.06", "--no-report"]
    assert CliRunner().invoke(main, [*command, "--out", str(tmp_path / "c")]).exit_code in (0, 1)
    assert (tmp_path / "c" / "signals.parquet").read_bytes() == (blind.folder / "signals.parquet").read_bytes()
    assert handover.load(tmp_path / "c").reason == blind.reason  # type: ignore


def test_its_result_is_what_the_folder_has(blind: handover.Run):
    assert blind.seed == 4
    assert blind.parameters["strategy"] == "blind"
    assert blind.parameters["standoff"] == 0.06
    again = handover.load(blind.folder)
    assert isinstance(again, handover.Run)
    assert (again.success, again.reason) == (blind.success, blind.reason)
    assert again.metrics.keys() == blind.metrics.keys()
    np.testing.assert_array_equal(list(again.metrics.values()), list(blind.metrics.values()))  # with NaN of no sight


def test_all_faults_are_told_at_once_and_nothing_is_written(tmp_path: Path):
    with pytest.raises(handover.InvalidInput) as e:
        handover.run("ir_grasp", strategi="reflex", forward=-1, literal=np.bool_(True), out=tmp_path / "r")
    assert str(e.value) == (
        "ir_grasp has no parameter 'strategi'; did you mean strategy?; forward: -1.0 is out of range: from 0 to 0.3 m"
    )
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    ("subject", "given", "told"),
    [
        ("ir_grap", {}, "no scenario 'ir_grap': did you mean ir_grasp?"),
        ("ir_grasp", {"step": 3}, "step is for an SSP or an FMU; a scenario's units have steps of their own"),
        ("ir_grasp", {"units": {"reflexx": "a.fmu"}}, "ir_grasp has no unit 'reflexx': did you mean reflex?"),
        ("ir_grasp", {"algorithm": "jacoby"}, "no algorithm 'jacoby'; did you mean jacobi?"),
        ("ir_grasp", {"seed": -1}, "seed = -1: a whole number from 0 to 9223372036854775807 is right"),
        ("ir_grasp", {"seed": 10**310}, "seed = 1000000000"),
        ("ir_grasp", {"seed": 0.5}, "seed = 0.5: a whole number from 0 to"),
        ("ir_grasp", {"formats": ["cvs"]}, "formats: 'cvs': did you mean csv?"),
        ("ir_grasp", {"checkpoint": 0}, "checkpoint = 0: a finite number of seconds above 0 is right"),
        ("ir_grasp", {"thing": 1, "parameters": {"thing": 2}}, "thing: given by keyword and in parameters={...}"),
        ("nowhere.fmu", {"stop": 1}, "nowhere.fmu"),
    ],
)
def test_what_cannot_be_run_is_refused_in_one_line(
    subject: str, given: dict[str, object], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(handover.InvalidInput) as e:
        handover.run(subject, **given)  # type: ignore
    assert told in str(e.value)
    assert "\n" not in str(e.value)
    assert not any(tmp_path.iterdir())


def test_a_system_is_run_and_its_results_outlive_the_call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    runs = [handover.run(system(), stop=Fraction(3)) for _ in range(2)]
    assert len({run.folder for run in runs}) == 2  # also within one second
    for run in runs:
        assert run.folder.parent == Path("runs")
        assert run.success
        assert run.signals["robot.v_WB"][-1] == pytest.approx([0.25, 0.0, 0.0])
    assert runs[0].scenario == "system"


def test_a_system_needs_a_stop_time_and_takes_no_parameters():
    with pytest.raises(handover.InvalidInput, match="a system has no stop time of its own; stop=10 lets it run"):
        handover.run(system())
    with pytest.raises(handover.InvalidInput, match="parameters, seed: a system has its parameters"):
        handover.run(system(), stop=1, seed=3, mass=3)


class Nearer(IrGrasp):
    """A scenario of one's own, as one writes it into a notebook."""

    name: ClassVar[str] = "nearer"
    title: ClassVar[str] = "a hand that begins nearer"


def test_a_class_of_ones_own_is_run_and_drawn(tmp_path: Path):
    run = handover.run(Nearer, strategy="blind", standoff=0.05, out=tmp_path / "n")
    assert run.scenario == "nearer"
    assert 'class="replay"' in run.replay().html
    assert "data:image/png" in run._repr_html_()  # type: ignore
    with handover.open(Nearer, strategy="blind") as s:
        assert "scene.p_WH" in s.outputs
    with pytest.raises(handover.InvalidInput, match="nearer has no parameter 'strategi'"):
        handover.run(Nearer, strategi="blind")


def test_parameters_of_units_are_set(blind: handover.Run, tmp_path: Path):
    own = {"reflex.shake_cycles": 1}  # of 3, at 1.5 Hz
    run = handover.run("ir_grasp", seed=4, strategy="blind", standoff=0.06, parameters=own, out=tmp_path / "u")
    assert run.signals.time[-1] == pytest.approx(blind.signals.time[-1] - 2 / 1.5, abs=0.05)
    with pytest.raises(handover.InvalidInput, match="no parameter 'closing_tim'; did you mean closing_time"):
        handover.run("ir_grasp", parameters={"reflex.closing_tim": 3.0}, out=tmp_path / "v")


def test_an_fmu_is_run_by_itself(tmp_path: Path):
    run = handover.run(handover.unit("Push", fmi=2), stop=1, out=tmp_path / "p", force=2, parameters={"start": 0.25})
    force = run.signals["Push.f_G"][:, 0]
    assert (force[run.signals.time < 0.24] == 0.0).all()
    assert force.max() == pytest.approx(2.0)


def test_a_unit_that_fails_is_a_result_without_success(tmp_path: Path):
    s = handover.System()
    s.add("robot", handover.unit("FreeFlyer"), mass=0.1, f_G=np.array([1e308, 0.0, 0.0]))
    run = handover.run(s, stop=5, out=tmp_path / "f")
    assert not run.success
    assert "robot" in run.reason


def test_other_threads_may_run(tmp_path: Path):
    runs: list[handover.Run] = []
    thread = threading.Thread(target=lambda: runs.append(handover.run(system(), stop=1, out=tmp_path / "t")))
    thread.start()
    thread.join()
    assert runs[0].success


def test_no_shipped_parameter_has_the_name_of_an_option():
    for scenario in SCENARIOS.values():
        assert not {v.name for v in scenario.parameters()} & OPTIONS, scenario.name


class NoScenario:
    pass


class Unfindable(IrGrasp):
    """Is in no module that a worker could import by its path."""


Unfindable.__qualname__ = "nowhere.Unfindable"


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: handover.run(3), "3 cannot be run: a scenario's name or class, a system, or the path of"),  # type: ignore
        (lambda: handover.open(None), "None cannot be run: "),  # type: ignore
        (lambda: handover.run(NoScenario), "NoScenario is no scenario: a subclass of Experiment is"),  # type: ignore
        (lambda: handover.environment(NoScenario, "reflex"), "NoScenario is no scenario"),  # type: ignore
        (lambda: handover.sweep(NoScenario), "NoScenario is no scenario"),  # type: ignore
        (lambda: handover.run(Experiment), "Experiment is not complete: it has no build"),
        (lambda: handover.sweep(Experiment), "Experiment is not complete: it has no build"),
        (lambda: handover.run("ir_grasp", strategy=[["a"], ["b", "c"]]), "strategy = .*a run has one value"),
        (lambda: handover.sweep(4), "4 cannot be run"),  # type: ignore
        (lambda: handover.sweep(Unfindable), "Unfindable: each run of a sweep imports its scenario"),
        (lambda: handover.run("ir_grasp", step=0.1), "^step is for an SSP or an FMU"),
        (lambda: handover.run("ir_grasp", inputs="u.csv"), "^inputs is for an FMU that runs by itself"),
        (lambda: handover.run("ir_grasp", record="scene.zz"), "^record: "),
        (lambda: handover.run("ir_grasp", units={"reflex": ""}), "^units 'reflex=' is not of the form NAME=FILE"),
        (lambda: handover.run("ir_grasp", strategy=["blind"]), r"strategy = \['blind'\]: a run has one value"),
        (lambda: handover.run(IrGrasp, forward=np.array([0.1])), "forward = .*handover.sweep varies lists"),
        (lambda: handover.environment("ir_grasp", "reflex", thing=("cup",)), "thing = .*a run has one value"),
        (lambda: handover.run("ir_grasp", parameters=[1]), "^parameters = .*a mapping such as"),  # type: ignore
        (lambda: handover.run("ir_grasp", units=["servo"]), "^units = .*a mapping such as"),  # type: ignore
        (lambda: handover.run("ir_grasp", out=3), "^out = 3: a path"),  # type: ignore
        (lambda: handover.run("ir_grasp", inputs_from=3), "^inputs_from = 3: a path"),  # type: ignore
        (lambda: handover.run("ir_grasp", record=3), "^record = 3: a text, or a list"),  # type: ignore
        (lambda: handover.run("ir_grasp", formats=3), "^formats = 3: a text, or a list"),  # type: ignore
        (lambda: handover.run("ir_grasp", isolate=["arm", 3]), "^isolate = 3: a text, or a list"),  # type: ignore
        (lambda: handover.run("ir_grasp", options={"call_limit": 3}), "^options = .*MasterOptions"),  # type: ignore
        (lambda: handover.sweep("ir_grasp", workers=0), "^workers = 0: a whole number from 1"),
        (lambda: handover.sweep("ir_grasp", workers="two"), "^workers = .*: a whole number from 1"),  # type: ignore
        (lambda: handover.load(3), "^folder = 3: a path"),  # type: ignore
        (lambda: handover.load("no_such_run"), "there is no such file or folder"),
        (lambda: handover.describe(3), "^fmu = 3: a path"),  # type: ignore
    ],
)
def test_what_is_no_subject_or_no_single_value_is_told_in_one_sentence(call: Callable[[], object], told: str):
    with pytest.raises(handover.InvalidInput, match=told) as raised:
        call()
    assert "\n" not in str(raised.value)
