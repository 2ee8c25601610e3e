"""A campaign resumes where it stopped, with the runs that are done; its table is rebuilt from their folders."""

import json
import shutil
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from support.campaigns import carried_out, short_plan
from support.in_process_pool import InProcessPool
from support.sweep_process import without_times

from handover.scenarios.campaign.campaign import run_campaign
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.plan_check import prepared
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.campaign.table_writer import rebuild_table
from handover.scenarios.campaign.worker_pool import JobResult, RunCounts, RunJob
from handover.scenarios.cli.command import main

PLAN = short_plan(repetitions=2)
NAMES = [run.name for run in PLAN.runs()]
FIRST = NAMES[0]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return carried_out(PLAN, tmp_path_factory.mktemp("campaign") / "done").path


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> CampaignFolder:
    shutil.copytree(finished, tmp_path / "c")
    return CampaignFolder(tmp_path / "c")


def resume(
    folder: CampaignFolder, plan: CampaignPlan = PLAN, pool: InProcessPool | None = None
) -> tuple[list[str], list[RunCounts]]:
    """Resume a campaign; return which runs were begun, and the counts that were reported."""
    pool, counts = pool or InProcessPool(), list[RunCounts]()
    run_campaign(prepared(plan), folder, pool, counts.append)
    return pool.begun, counts


def test_each_run_has_a_row_in_the_plans_order(finished: Path):
    table = CampaignTable.read(finished)
    assert table.column("run").tolist() == NAMES
    assert table.column("seed").tolist() == [run.seed for run in PLAN.runs()]
    assert table.column("status").tolist() == ["done"] * 4
    assert sorted(p.name for p in (finished / "runs").iterdir()) == NAMES
    assert sorted(p.name for p in finished.iterdir()) == ["campaign.json", "fmus", "runs", "runs.parquet"]


def test_what_is_done_is_not_begun_again(folder: CampaignFolder):
    begun, counts = resume(folder)
    assert begun == []
    assert counts == [RunCounts(total=4, kept=4, ended=4)]


def test_an_interrupted_campaign_goes_on_and_is_as_if_undisturbed(finished: Path, tmp_path: Path):
    def interrupt(job: RunJob) -> str:
        if job.name == NAMES[1]:  # the third, as first repetitions of all points come first
            raise KeyboardInterrupt
        return ""

    folder = CampaignFolder(tmp_path / "c")
    with pytest.raises(KeyboardInterrupt):
        resume(folder, pool=InProcessPool(interrupt))
    assert CampaignTable.read(folder.table).column("run").tolist() == [NAMES[0], NAMES[2]]
    begun, counts = resume(folder)
    assert begun == [NAMES[1], NAMES[3]]
    assert counts[0] == RunCounts(total=4, kept=2, ended=2)
    assert without_times(folder.path) == without_times(finished)


def test_a_run_whose_result_did_not_come_is_in_the_table_nevertheless(tmp_path: Path):
    class Mute(InProcessPool):
        def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
            for _ in super().run_jobs(jobs[:1]):
                raise KeyboardInterrupt
            yield from ()

    folder, counts = CampaignFolder(tmp_path / "c"), list[RunCounts]()
    with pytest.raises(KeyboardInterrupt):
        run_campaign(prepared(PLAN), folder, Mute(), counts.append)
    assert CampaignTable.read(folder.table).column("run").tolist() == [NAMES[0]]
    assert counts[-1] == RunCounts(total=4, ended=1)


def test_a_lost_run_is_a_row_with_its_reason_and_tried_again(tmp_path: Path):
    folder = CampaignFolder(tmp_path / "c")
    _, counts = resume(folder, pool=InProcessPool(lambda job: "its machine burnt" if job.name == NAMES[0] else ""))
    assert counts[-1] == RunCounts(total=4, ended=3, lost=1)
    row = CampaignTable.read(folder.table).rows[0]
    assert (row["status"], row["success"], row["reason"]) == ("lost", None, "its machine burnt")
    assert (row["m"], row["simulated_seconds"], row["last_x"]) == (1.0, None, None)
    begun, _ = resume(folder)
    assert begun == [NAMES[0]]
    assert CampaignTable.read(folder.table).column("status").tolist() == ["done"] * 4


@pytest.mark.parametrize("content", [None, "{", "[]"])
def test_a_run_whose_summary_is_damaged_is_done_anew(folder: CampaignFolder, content: str | None):
    summary = folder.runs / NAMES[2] / "summary.json"
    if content is None:
        summary.unlink()
    else:
        summary.write_text(content)
    assert resume(folder)[0] == [NAMES[2]]
    assert len(CampaignTable.read(folder.table)) == 4


def test_a_run_that_was_interrupted_is_none(folder: CampaignFolder):
    summary = folder.runs / NAMES[2] / "summary.json"
    summary.write_text(json.dumps({**json.loads(summary.read_text()), "complete": False}))
    assert resume(folder)[0] == [NAMES[2]]


def test_a_run_in_which_a_unit_failed_is_done(folder: CampaignFolder):
    summary = folder.runs / NAMES[2] / "summary.json"
    failed = {"complete": False, "success": False, "failure": {"kind": "x"}, "reason": "the hand broke"}
    summary.write_text(json.dumps({**json.loads(summary.read_text()), **failed}))
    begun, counts = resume(folder)
    assert begun == []
    assert counts == [RunCounts(total=4, kept=4, ended=4, failed=1)]
    row = CampaignTable.read(folder.table).rows[2]
    assert (row["status"], row["success"], row["reason"]) == ("failed", None, "the hand broke")


@pytest.mark.parametrize("damage", ["lost", "torn"])
def test_the_table_is_made_anew_from_the_runs(folder: CampaignFolder, damage: str):
    before = CampaignTable.read(folder.table).rows
    if damage == "lost":
        folder.table.unlink()
    else:
        folder.table.write_bytes(folder.table.read_bytes()[:2000])
    assert resume(folder)[0] == []
    assert CampaignTable.read(folder.table).rows == before


def test_left_overs_of_killed_runs_are_removed(folder: CampaignFolder):
    left = folder.runs / f".{NAMES[0]}.abc"
    left.mkdir()
    (left / "signals.parquet.part").write_text("x")
    resume(folder)
    assert not left.exists()


def test_more_repetitions_add_runs(folder: CampaignFolder):
    more = replace(PLAN, repetitions=3)
    begun, _ = resume(folder, more)
    assert begun == [run.name for run in more.runs() if run.repetition == 2]
    table = CampaignTable.read(folder.table)
    assert table.column("run").tolist() == [run.name for run in more.runs()]
    assert folder.read()["repetitions"] == 3


def cut(folder: CampaignFolder, rows: int) -> bytes:
    """Leave the first rows of the table only."""
    pq.write_table(CampaignTable.read(folder.table).table.slice(0, rows), folder.table)
    return folder.table.read_bytes()


@pytest.mark.parametrize("left", ["nothing", "no row", "a row", "damaged"])
def test_a_rebuilt_table_is_as_the_campaign_itself_writes_it(left: str, finished: Path, folder: CampaignFolder):
    if left == "nothing":
        folder.table.unlink()
    elif left == "damaged":
        folder.table.write_bytes(b"PAR1")
    else:
        cut(folder, rows=int(left == "a row"))
    rebuild_table(folder)
    expected = CampaignTable.read(finished).table
    assert CampaignTable.read(folder.table).table.equals(expected, check_metadata=True)


def test_a_whole_table_is_not_written_again(folder: CampaignFolder):
    before = folder.table.stat()
    rebuild_table(folder)
    assert folder.table.stat().st_mtime_ns == before.st_mtime_ns
    assert folder.table.stat().st_ino == before.st_ino


def test_a_lost_run_stays_lost(tmp_path: Path):
    lost = carried_out(short_plan(), tmp_path / "lost", [FIRST])
    cut(lost, rows=1)
    rebuild_table(lost)
    table = CampaignTable.read(lost.table)
    assert table.column("status").tolist() == ["lost", "done"]
    assert table.column("reason")[0] == "its worker went away"


def test_a_table_is_left_alone_while_a_command_works_on_the_campaign(folder: CampaignFolder):
    before = cut(folder, rows=1)
    with folder.held():
        rebuild_table(folder)
    assert folder.table.read_bytes() == before


@pytest.mark.parametrize("change", [{"versions": {"handover-cosim": "9.9"}}, {"scenario": "juggle"}])
def test_the_table_of_a_campaign_of_another_version_is_left(change: dict[str, object], folder: CampaignFolder):
    before = cut(folder, rows=1)
    file = folder.path / "campaign.json"
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **change}), encoding="utf-8")
    rebuild_table(folder)
    assert folder.table.read_bytes() == before


def test_the_page_shows_all_runs_that_are_done(folder: CampaignFolder):
    cut(folder, rows=1)
    with folder.held():  # as a running command does
        assert "1 of 4 runs so far" in page_of(folder)
    assert "so far" not in page_of(folder)


def page_of(folder: CampaignFolder) -> str:
    """Return what `handover report` writes."""
    done = CliRunner().invoke(main, ["report", str(folder.path)])
    assert done.exit_code == 0, done.output
    return folder.report.read_text(encoding="utf-8").replace("\u00a0", " ")
