"""The table of a killed campaign is rebuilt from its runs' folders."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from in_process_pool import InProcessPool

from handover.scenarios.campaign.campaign import run_campaign
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.plan_check import prepared
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.campaign.table_writer import rebuild_table
from handover.scenarios.cli.command import main

PLAN = CampaignPlan(
    scenario="ir_grasp", points=[{"forward": "0.03"}, {"forward": "0.1"}], fixed={"strategy": "forward", "run_up": "0"}
)
FIRST, SECOND = (run.name for run in PLAN.runs())


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("campaign") / "done"
    run_campaign(prepared(PLAN), CampaignFolder(path), InProcessPool(), lambda _tally: None)
    return path


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> CampaignFolder:
    shutil.copytree(finished, tmp_path / "c")
    return CampaignFolder(tmp_path / "c")


def cut(folder: CampaignFolder, rows: int) -> bytes:
    """Leave the first rows of the table only."""
    pq.write_table(CampaignTable.read(folder.table).table.slice(0, rows), folder.table)
    return folder.table.read_bytes()


@pytest.mark.parametrize("left", ["nothing", "no row", "a row", "damaged"])
def test_it_is_as_the_campaign_itself_writes_it(left: str, finished: Path, folder: CampaignFolder):
    if left == "nothing":
        folder.table.unlink()
    elif left == "damaged":
        folder.table.write_bytes(b"PAR1")
    else:
        cut(folder, rows=int(left == "a row"))
    rebuild_table(folder)
    expected = CampaignTable.read(finished).table
    assert CampaignTable.read(folder.table).table.equals(expected, check_metadata=True)


def test_a_whole_one_is_not_written_again(folder: CampaignFolder):
    before = folder.table.stat()
    rebuild_table(folder)
    assert folder.table.stat().st_mtime_ns == before.st_mtime_ns
    assert folder.table.stat().st_ino == before.st_ino


def test_a_lost_run_stays_lost(tmp_path: Path):
    lost = CampaignFolder(tmp_path / "lost")
    pool = InProcessPool(lambda job: "its worker went away" if job.name == FIRST else "")
    run_campaign(prepared(PLAN), lost, pool, lambda _tally: None)
    cut(lost, rows=1)
    rebuild_table(lost)
    table = CampaignTable.read(lost.table)
    assert table.column("run").tolist() == [FIRST, SECOND]
    assert table.column("status").tolist() == ["lost", "done"]
    assert table.column("reason")[0] == "its worker went away"


def test_it_is_left_alone_while_a_command_works_on_the_campaign(folder: CampaignFolder):
    before = cut(folder, rows=1)
    with folder.held():
        rebuild_table(folder)
    assert folder.table.read_bytes() == before


@pytest.mark.parametrize("change", [{"versions": {"handover-cosim": "9.9"}}, {"scenario": "juggle"}])
def test_a_campaign_of_another_version_is_left(change: dict[str, object], folder: CampaignFolder):
    before = cut(folder, rows=1)
    file = folder.path / "campaign.json"
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **change}), encoding="utf-8")
    rebuild_table(folder)
    assert folder.table.read_bytes() == before


def test_the_page_shows_all_runs_that_are_done(folder: CampaignFolder):
    cut(folder, rows=1)
    with folder.held():  # as a running command does
        assert "1 of 2 runs so far" in page_of(folder)
    assert "so far" not in page_of(folder)


def page_of(folder: CampaignFolder) -> str:
    """Return what `handover report` writes."""
    done = CliRunner().invoke(main, ["report", str(folder.path)])
    assert done.exit_code == 0, done.output
    return folder.report.read_text(encoding="utf-8").replace("\u00a0", " ")
