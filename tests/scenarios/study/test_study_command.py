"""`handover study new` and `plan`: a plan to start from, and what follows from it."""

import json
import sys
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.scenarios.sample_study import PLAN
from support.wording import Wording

from handover.scenarios.cli.command import main
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import rounds_of
from handover.scenarios.study.plan.plan import default_plan, parse_plan


def study(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["study", *map(str, arguments)])


@pytest.mark.parametrize(
    "command", ["plan {}/plan.toml", "report {}", "export {}", "replay {} P01 1", "replay {} P01 1 --check"]
)
def test_no_code_is_run_because_a_plan_names_it(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    marker = tmp_path / "marker"
    (tmp_path / "foreign_scene.py").write_text(f"open({str(marker)!r}, 'w')\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    StudyFolder.opened(tmp_path / "study", PLAN)
    (tmp_path / "study" / "plan.toml").write_text(
        default_plan().replace("flyer_robot_to_human", "foreign_scene:Scene"), "utf-8"
    )
    refused = study(*command.format(tmp_path / "study").split())
    assert refused.exit_code == 2, refused.output
    assert "no scenario 'foreign_scene:Scene'" in refused.output
    assert not marker.exists()


def test_a_new_plan_can_be_followed_as_it_is(tmp_path: Path, wording: Wording):
    file = tmp_path / "mine" / "plan.toml"
    assert study("new", file).exit_code == 0
    assert file.read_text(encoding="utf-8") == default_plan()
    shown = study("plan", file)
    assert shown.exit_code == 0, shown.output
    wording.check(shown.output)
    again = study("new", file)
    assert again.exit_code == 2
    wording.check(again.output)


def test_the_orders_as_json_are_those_that_are_played(tmp_path: Path):
    study("new", tmp_path / "plan.toml")
    data = json.loads(study("plan", tmp_path / "plan.toml", "--participants", "12", "--json").output)
    assert len(data["orders"]) == 12
    assert set(Counter(of["order_row"] for of in data["orders"]).values()) == {2}
    planned = rounds_of(parse_plan(default_plan()), 7)
    assert [(r["behaviour"], r["seed"]) for r in data["orders"][6]["rounds"]] == [
        (r.condition.behaviour, r.seed) for r in planned
    ]


def test_the_duration_goes_by_the_scenarios_parameters(tmp_path: Path):
    study("new", tmp_path / "plan.toml")
    before = json.loads(study("plan", tmp_path / "plan.toml", "--json").output)["longest_session"]
    text = default_plan().replace("practice = 600", "practice = 300").replace("repetitions = 2", "repetitions = 1")
    (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
    after = json.loads(study("plan", tmp_path / "plan.toml", "--json").output)["longest_session"]
    assert before["practice"] - after["practice"] == 300.0
    assert after["rounds"] == pytest.approx(before["rounds"] / 2)
    assert before["together"] == sum(before[part] for part in ("practice", "rounds", "ratings"))


def test_on_windows_serving_is_refused_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    study("new", tmp_path / "plan.toml")
    monkeypatch.setattr(sys, "platform", "win32")
    refused = study("serve", tmp_path / "plan.toml", "--out", tmp_path / "study")
    monkeypatch.undo()
    assert refused.exit_code == 2
    assert "handover study serve: not on Windows yet" in refused.output
    assert not (tmp_path / "study").exists()


def test_every_fault_of_a_plan_has_its_line(tmp_path: Path, wording: Wording):
    file = tmp_path / "plan.toml"
    file.write_text(default_plan().replace("seed = 2020", "sed = 1"), encoding="utf-8")
    shown = study("plan", file)
    assert shown.exit_code == 2
    wording.check(shown.output)


def test_of_very_many_faults_of_a_plan_the_first_have_a_line_each(tmp_path: Path):
    file, table = tmp_path / "plan.toml", "[text.en.statements]\n"
    wrong = "".join(f'wrong_{k} = "x"\n' for k in range(50))
    file.write_text(default_plan().replace(table, table + wrong), encoding="utf-8")
    shown = study("plan", file).output.splitlines()
    assert "50 faults in the plan" in shown[-22]
    assert shown[-2].startswith("  text.en.statements.wrong_19: no such key; valid: ")
    assert shown[-1] == "  and 30 more"
