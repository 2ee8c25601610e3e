"""What is wrong with own scenarios, units and their values is reported in one line, all at once; nothing is written."""

import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from support.commands import call
from support.scenarios.own_controllers import write_placed
from support.scenarios.tutorial import SCENE, refused, write_files
from support.wording import Wording

LACKING = """
from reach import TwoLinkReach
from handover.scenarios.experiment.experiment import Experiment


class Scene(Experiment):
    name = "ir_grasp"
    units = {"arm": "arm:TwoLinkArms", "servo": "Visual"}
    parameters_type = dict

    def build(self, parameters, seed, fmu):
        raise ValueError


class Failing(TwoLinkReach):
    def evaluator(self, parameters):
        return parameters.gaol
"""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Generator[Path, None, None]:
    """Give a folder with scenarios and units, right and wrong; its modules are forgotten afterwards."""
    folder = tmp_path_factory.mktemp("prepared")
    write_files(folder)
    write_placed(folder)
    for name, text in (("test_reach", "mine"), ("broken", "import nowhere_to_be_found\n"), ("lacking", LACKING)):
        (folder / f"{name}.py").write_text(text)
    yield folder
    for name, module in [*sys.modules.items()]:
        if str(getattr(module, "__file__", None) or "").startswith(f"{folder}/"):
            del sys.modules[name]


MISSPELLED = ("placed:Placed", "--unit", "controller=wrong:Misspelled")
GENTLE = ("new", "controller", "Gentle", "--for")


def values(*given: str) -> tuple[str, ...]:
    return ("run", SCENE, *(text for value in given for text in ("-p", value)))


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(("run", "reach:TwoLinkRech"), id="class"),
        pytest.param(("run", "reech:TwoLinkReach"), id="module"),
        pytest.param(("run", "goal_spring:SpringToGoal"), id="no scenario"),
        pytest.param(("run", "two_link_reach"), id="without module"),
        pytest.param(("run", SCENE, "-p", "goall=1,1"), id="parameter"),
        pytest.param(("run", SCENE, "--unit", "controller=goal_spring:Spring"), id="unit"),
        pytest.param(("sweep", "broken:Scene"), id="import"),
        pytest.param(("run", "lacking:Scene"), id="all that it lacks"),
        pytest.param(("run", "lacking:Failing"), id="set up"),
        pytest.param(("sweep", "lacking:Failing"), id="set up in a sweep"),
        pytest.param(values("contr.stiffness=3", "goall=1", "arm.=2"), id="names of values"),
        pytest.param(values("controller.stif=3", "arm.mass=-1", "controller.p_WD=1,2,3"), id="values of units"),
        pytest.param(values("controller.p_WD=1,east"), id="no number"),
        pytest.param(("sweep", SCENE, "controller.stiffness=3,-4", "arm.mass=x,1"), id="varied values"),
        pytest.param(("sweep", SCENE, "arm.mass=3,4", "-p", "arm.mass=5"), id="varied and set"),
        pytest.param(("sweep", SCENE, "--unit", "controller=goal_spring:SpringToGoal,"), id="empty item"),
        pytest.param(("run", *MISSPELLED), id="place in a run"),
        pytest.param(("export", *MISSPELLED, "--ssp", "a.ssp"), id="place in an export"),
        pytest.param(("run", "placed:Placed", "--unit", "controller=other:Misspelled"), id="same kind"),
        pytest.param(("list", "placed:Placed", "--unit", "controler"), id="listed place"),
        pytest.param(("list", "--unit", "controller"), id="place of nothing"),
        pytest.param(("new", "unit", "Reach"), id="file there"),
        pytest.param(("new", "unit", "TendonArm"), id="unit there"),
        pytest.param(("new", "unit", "my-arm"), id="no name"),
        pytest.param(("new", "controller", "class"), id="keyword"),
        pytest.param(("new", "scenario", "None"), id="keyword as class"),
        pytest.param(("new", "unit", "A" * 300), id="too long for a file"),
        pytest.param((*GENTLE, "helix_handover"), id="no place"),
        pytest.param((*GENTLE, "helix_handover:servos"), id="unknown place"),
        pytest.param((*GENTLE, "helix_handovers:servo"), id="unknown scenario"),
        pytest.param((*GENTLE, "helix_handover:camera"), id="no start possible"),
        pytest.param(("new", "scenario", "Gentle", "--for", "helix_handover:servo"), id="scenario for a place"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line_and_nothing_is_written(
    arguments: tuple[str, ...], prepared: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(prepared)
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = {*prepared.rglob("*.*")}
    done = call(*arguments)
    assert done.exit_code == 2, done.output
    assert {path for path in prepared.rglob("*.*") if path.suffix != ".pyc"} <= before
    (line,) = [line for line in done.stderr.strip().splitlines() if not line.endswith(" ...")]
    wording.check(line.replace(sys.executable, "PYTHON").replace(str(prepared), "HERE"))


def test_a_unit_that_does_not_fit_is_reported_before_a_sweep_begins(
    prepared: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(prepared)
    monkeypatch.setattr(sys, "path", [*sys.path])
    units = "controller=goal_spring:SpringToGoal,arm:TwoLinkArm"
    done = call("sweep", SCENE, "--unit", units, "--out", "other")
    assert done.exit_code == 2
    wording.check(done.stderr)
    assert not (prepared / "other").exists()


@pytest.mark.slow
def test_an_evaluator_whose_state_no_checkpoint_can_hold_is_refused(here: Path, wording: Wording):
    code = (here / "reach.py").read_text()
    with_set = code.replace("self.is_there = False", "self.is_there, self.ever = False, set()", 1)
    assert with_set != code
    (here / "reach.py").write_text(with_set)
    wording.check(refused(here, "run", SCENE, "--no-report", "--checkpoint", "0.05", "-p", "patience=0.1"))
