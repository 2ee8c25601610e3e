"""A folder is of one campaign: one of another campaign, or of something else, is rejected and left as it was."""

import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.wording import Wording

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.files import folder_locked
from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.runs.campaign.folder import CampaignFolder, default_folder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.execution.errors import PoolError
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, unfinished_place

PLAN = CampaignPlan(
    scenario="ir_grasp", points=[{"forward": "0.03"}, {"forward": "0.1"}], fixed={"thing": "cylinder"}, repetitions=2
)


@pytest.fixture
def fmus(tmp_path: Path) -> dict[str, Path]:
    (tmp_path / "built").mkdir()
    files = {unit: tmp_path / "built" / f"{unit}.fmu" for unit in ("scene", "reflex")}
    for unit, file in files.items():
        file.write_text(unit)
    return files


@pytest.fixture
def folder(tmp_path: Path, fmus: dict[str, Path]) -> CampaignFolder:
    folder = CampaignFolder(tmp_path / "c")
    begin(folder, PLAN, fmus)
    return folder


def begin(folder: CampaignFolder, plan: CampaignPlan, fmus: dict[str, Path]) -> dict[str, Path]:
    with folder.opened(plan, fmus, lambda _path: None) as copies:
        return copies


def content(folder: CampaignFolder) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in folder.path.rglob("*") if p.is_file()}


def refusal(folder: CampaignFolder, plan: CampaignPlan, fmus: dict[str, Path]) -> str:
    before = content(folder)
    with pytest.raises(InvalidRunFolder) as caught:
        begin(folder, plan, fmus)
    assert content(folder) == before
    return caught.value.fault


def test_it_holds_copies_of_the_fmus(folder: CampaignFolder, fmus: dict[str, Path]):
    fmus["scene"].rename(fmus["scene"].with_suffix(".moved"))
    assert (folder.fmus / "scene.fmu").read_text() == "scene"
    assert folder.read()["units"]["scene"]["fmu"] == "scene.fmu"
    fmus["scene"].with_suffix(".moved").rename(fmus["scene"])
    (folder.fmus / "scene.fmu").write_text("half")
    assert begin(folder, PLAN, fmus)["scene"].read_text() == "scene"  # a damaged copy is made anew


def test_different_files_of_one_name_have_copies_of_their_own(tmp_path: Path, fmus: dict[str, Path]):
    (tmp_path / "other").mkdir()
    other = fmus["reflex"].rename(tmp_path / "other" / "scene.fmu")
    copies = begin(CampaignFolder(tmp_path / "d"), PLAN, {**fmus, "reflex": other})
    assert {unit: (p.name, p.read_text()) for unit, p in copies.items()} == {
        "scene": ("scene_scene.fmu", "scene"),
        "reflex": ("reflex_scene.fmu", "reflex"),
    }


@pytest.mark.parametrize(
    "change",
    [
        {"scenario": "flyer_impedance", "fixed": {}, "points": [dict[str, str]()]},
        {"points": [{"standoff": "0.1"}] * 2},
        {"fixed": {"thing": "paper_box_a"}},
        {"seed": 5},
        {"paired": True},
        {"repetitions": 1},
        {"experiment": "ir-table"},
        {"options": MasterOptions(pace=1)},
    ],
    ids=lambda change: " ".join(change),
)
def test_another_campaign_is_refused(
    folder: CampaignFolder, fmus: dict[str, Path], change: dict[str, Any], wording: Wording
):
    wording.check(refusal(folder, replace(PLAN, **change), fmus))


def test_points_of_the_same_values_that_are_combined_otherwise(tmp_path: Path, fmus: dict[str, Path]):
    def plan(*pairs: tuple[str, str]) -> CampaignPlan:
        return replace(PLAN, points=[{"forward": forward, "standoff": standoff} for forward, standoff in pairs])

    folder = CampaignFolder(tmp_path / "c")
    begin(folder, plan(("0.01", "0.02"), ("0.03", "0.04")), fmus)
    assert "to 2 points there" in refusal(folder, plan(("0.01", "0.02"), ("0.03", "0.04"), ("0.01", "0.04")), fmus)


def test_another_fmu_and_another_version_are_refused(folder: CampaignFolder, fmus: dict[str, Path]):
    fmus["scene"].write_text("another")
    assert "unit scene is scene.fmu (sha256 " in refusal(folder, PLAN, fmus)
    fmus["scene"].write_text("scene")
    (folder.path / "campaign.json").write_text(json.dumps(folder.read() | {"versions": {"numpy": "1.0"}}))
    assert "version of numpy is 1.0 there, " in refusal(folder, PLAN, fmus)


def test_a_damaged_campaign_json_is_refused(folder: CampaignFolder, fmus: dict[str, Path]):
    file = folder.path / "campaign.json"
    written: dict[str, Any] = json.loads(file.read_text())
    for damage, text in (("{", "its campaign.json is damaged: "), ("{}", "missing required field")):
        file.write_text(damage)
        assert text in refusal(folder, PLAN, fmus)
    for name in written:  # each member is of a declared type
        file.write_text(json.dumps({**written, name: [[0]]}))
        with pytest.raises(InvalidRunFolder, match=name):
            folder.read()


def test_files_in_place_of_folders_and_folders_in_place_of_files_are_refused(
    folder: CampaignFolder, fmus: dict[str, Path]
):
    run = next(iter(PLAN.runs())).name
    (folder.runs / run).touch()
    assert refusal(folder, PLAN, fmus) == f"{Path('runs', run)} is a file, not a folder; remove it"
    (folder.runs / run).unlink()
    folder.table.mkdir()
    assert refusal(folder, PLAN, fmus) == "runs.parquet is a folder, not a file; remove it"


def test_a_folder_of_something_else_and_a_second_command_are_refused(
    folder: CampaignFolder, tmp_path: Path, fmus: dict[str, Path]
):
    other = CampaignFolder(tmp_path / "built")
    assert "it is not empty and has no campaign.json" in refusal(other, PLAN, fmus)
    assert "there is a file of that name" in refusal(CampaignFolder(fmus["scene"]), PLAN, fmus)
    with folder_locked(folder.path):
        assert refusal(folder, PLAN, fmus) == f"another command is running this campaign (process {os.getpid()})"


def test_a_call_killed_before_it_wrote_its_campaign_is_no_obstacle(tmp_path: Path, fmus: dict[str, Path]):
    folder = CampaignFolder(tmp_path / "c")
    folder.path.mkdir()
    unfinished_place(folder.path / "campaign.json").write_text("{")
    begin(folder, PLAN, fmus)
    assert folder.read()["scenario"] == "ir_grasp"


def test_workers_that_are_refused_and_a_full_disk_leave_no_folder(
    tmp_path: Path, fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch
):
    def refuse(path: Path) -> None:
        assert path.is_dir()
        raise PoolError("no")

    def full(*_given: Any, **_options: Any) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(PoolError), CampaignFolder(tmp_path / "a" / "b" / "c").opened(PLAN, fmus, refuse):
        pass
    monkeypatch.setattr("os.replace", full)
    with pytest.raises(RecordNotWritten, match="No space left"):
        begin(CampaignFolder(tmp_path / "a" / "d"), PLAN, fmus)
    assert not (tmp_path / "a").exists()


def test_without_a_folder_the_newest_incomplete_campaign_of_the_plan_goes_on(
    tmp_path: Path, fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)

    def chosen() -> Path:
        with contextlib.ExitStack() as opened:
            return default_folder(PLAN, fmus, opened).path

    assert chosen().parent == Path("campaigns")
    for name, plan in (("2026-01-01", PLAN), ("2026-01-02", PLAN), ("2026-01-03", replace(PLAN, seed=1))):
        begin(CampaignFolder(Path(f"campaigns/{name}_ir_grasp")), plan, fmus)
    Path("campaigns/2026-01-04_ir_grasp").mkdir()
    newest = CampaignFolder(Path("campaigns/2026-01-02_ir_grasp"))
    assert chosen() == newest.path
    for run in PLAN.runs():
        (newest.runs / run.name).mkdir()
        assert not newest.is_done(run)
        (newest.runs / run.name / "summary.json").touch()
    assert newest.has_all(PLAN)
    with contextlib.ExitStack() as opened:
        two = [default_folder(PLAN, fmus, opened).path for _ in range(2)]
        assert len({*two, newest.path}) == 3
    assert not any(path.exists() for path in two)
