"""A campaign resumes where it stopped, with the runs that are done; its table is rebuilt from their folders."""

import json
import shutil
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from support.campaigns import carried_out, short_plan
from support.commands import call, data_in
from support.in_process_pool import InProcessPool
from support.sweep_process import without_times

from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.table_writer import rebuild_table
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunCounts, RunJob

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


@pytest.mark.parametrize(
    ("change", "done"),
    [
        (None, False),
        ([], False),
        ({"complete": False}, False),  # it was interrupted
        ({"complete": False, "success": False, "failure": {"kind": "x"}, "reason": "the hand broke"}, True),
    ],
)
def test_a_run_is_done_if_its_summary_says_so(change: Any, done: bool, folder: CampaignFolder):
    run = folder.runs / NAMES[2]
    content = {**data_in(run), **change} if change else change
    (run / "summary.json").write_text("{" if change is None else json.dumps(content))
    begun, counts = resume(folder)
    assert begun == ([] if done else [NAMES[2]])
    row = CampaignTable.read(folder.table).rows[2]
    if done:
        assert counts == [RunCounts(total=4, kept=4, ended=4, failed=1)]
        assert (row["status"], row["success"], row["reason"]) == ("failed", None, "the hand broke")
    else:
        assert row["status"] == "done"


def test_what_is_done_is_not_begun_again_and_left_overs_of_killed_runs_are_removed(folder: CampaignFolder):
    left = folder.runs / f".{NAMES[0]}.abc"
    left.mkdir()
    (left / "signals.parquet.part").write_text("x")
    before = CampaignTable.read(folder.table).rows
    folder.table.write_bytes(folder.table.read_bytes()[:2000])  # torn
    assert resume(folder) == ([], [RunCounts(total=4, kept=4, ended=4)])
    assert not left.exists()
    assert CampaignTable.read(folder.table).rows == before


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


def written(folder: CampaignFolder) -> tuple[int, int] | None:
    """Return what changes if the table is written."""
    return (folder.table.stat().st_mtime_ns, folder.table.stat().st_ino) if folder.table.exists() else None


@pytest.mark.parametrize("left", [None, 0, 1, "damaged", 4])
def test_a_rebuilt_table_is_as_the_campaign_itself_writes_it(
    left: int | str | None, finished: Path, folder: CampaignFolder
):
    if left is None:
        folder.table.unlink()
    elif isinstance(left, str):
        folder.table.write_bytes(b"PAR1")
    else:
        cut(folder, rows=left)
    before = written(folder)
    rebuild_table(folder)
    expected = CampaignTable.read(finished).table
    assert CampaignTable.read(folder.table).table.equals(expected, check_metadata=True)
    assert (written(folder) == before) is (left == 4)  # a whole one is not written again


def test_a_lost_run_stays_lost(tmp_path: Path):
    lost = carried_out(short_plan(), tmp_path / "lost", [FIRST])
    cut(lost, rows=1)
    rebuild_table(lost)
    table = CampaignTable.read(lost.table)
    assert table.column("status").tolist() == ["lost", "done"]
    assert table.column("reason")[0] == "its worker went away"


@pytest.mark.parametrize("change", [None, {"versions": {"handover-cosim": "9.9"}}, {"scenario": "juggle"}])
def test_a_table_is_left_while_a_command_works_on_it_or_of_another_version(
    change: dict[str, object] | None, folder: CampaignFolder
):
    before = cut(folder, rows=1)
    if change is None:
        with folder.held():
            rebuild_table(folder)
    else:
        (folder.path / "campaign.json").write_text(json.dumps({**data_in(folder.path, "campaign"), **change}))
        rebuild_table(folder)
    assert folder.table.read_bytes() == before


def test_the_page_shows_all_runs_that_are_done(folder: CampaignFolder):
    cut(folder, rows=1)
    with folder.held():  # as a running command does
        assert "1 of 4 runs so far" in page_of(folder)
    assert "so far" not in page_of(folder)


def page_of(folder: CampaignFolder) -> str:
    """Return what `handover report` writes."""
    assert call("report", folder.path).exit_code == 0
    return folder.report.read_text(encoding="utf-8").replace("\u00a0", " ")
