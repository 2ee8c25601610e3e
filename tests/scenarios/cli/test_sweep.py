"""`handover sweep`: its output and its exit status."""

import contextlib
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from support.clusters import closed_port
from support.commands import call
from support.cosim.native_units import native_fmu
from support.in_process_pool import InProcessPool

from handover.cosim.files import folder_locked
from handover.scenarios.runs.campaign import plan_check, pools
from handover.scenarios.runs.campaign.pools import LocalPool
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.worker_pool import RunJob
from handover.scenarios.runs.execution.errors import ClusterLost, PoolError

CALL = ("sweep", native_fmu("mass"), "m=1,2", "-p", "f=1", "--workers", "2")
INTO_C = ("--out", "c", "--no-report")
BEGINNING = f"2 runs of {native_fmu('mass')} on 2 workers into c\n"
ALL = ["000_m=1_r0000", "001_m=2_r0000"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(
    monkeypatch: pytest.MonkeyPatch, *more: object, before: Callable[[RunJob], str] = lambda _job: ""
) -> tuple[Result, list[str]]:
    """Return how a command ended, and which runs it began."""
    pool = InProcessPool(before)

    def given(_workers: int | None) -> contextlib.AbstractContextManager[InProcessPool]:
        return contextlib.nullcontext(pool)

    monkeypatch.setattr(pools, "LocalPool", given)
    return call(*CALL, *more), pool.begun


def refuse_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no workers be had."""

    def refuse(_pool: LocalPool, _folder: Path) -> None:
        raise PoolError("there are none")

    monkeypatch.setattr(LocalPool, "check", refuse)


def raising(error: BaseException) -> Callable[[RunJob], str]:
    """Return what raises an error before the second run."""

    def raise_it(job: RunJob) -> str:
        if job.name == ALL[1]:
            raise error
        return ""

    return raise_it


@pytest.mark.usefixtures("empty_figures")
def test_a_campaign_ends_with_a_row_for_each_point_and_is_not_begun_again(here: Path, monkeypatch: pytest.MonkeyPatch):
    result, begun = sweep(monkeypatch, *INTO_C)
    assert (result.exit_code, begun) == (0, ALL), result.output
    assert f"{native_fmu('mass').name}: 2 of 2 runs done" in result.output
    rows = [line.split()[:5] for line in result.output.splitlines() if " of 1 " in line]
    assert rows == [["1", "1", "1", "of", "1"], ["2", "1", "1", "of", "1"]]
    assert "table: c/runs.parquet" in result.output
    refuse_workers(monkeypatch)
    times: list[list[int]] = []
    for doing in ("drawing figures, writing the report ...\n", ""):
        result = call(*CALL, "--out", "c")
        assert (result.exit_code, result.stderr) == (0, f"c has all of its runs; nothing was run\n{doing}")
        assert "2 of 2 runs done" in result.stdout
        times.append([(here / "c" / name).stat().st_mtime_ns for name in ("runs.parquet", "report.html")])
    assert times[0] == times[1]


def test_an_interrupted_call_goes_on_also_without_a_folder(monkeypatch: pytest.MonkeyPatch):
    result, _ = sweep(monkeypatch, "--no-report", before=raising(KeyboardInterrupt()))
    (folder,) = Path("campaigns").iterdir()
    beginning = BEGINNING.strip().replace("into c", f"into {folder}")
    reported = f"{beginning}\n1 of 2 runs done in {folder}; run the same command again to resume\n"
    assert (result.exit_code, result.output) == (1, reported)
    assert len(CampaignTable.read(folder)) == 1
    result, begun = sweep(monkeypatch, "--no-report")
    assert (result.exit_code, result.stderr, begun) == (0, f"{beginning}; 1 are done\n", [ALL[1]])
    assert list(Path("campaigns").iterdir()) == [folder]


def test_lost_runs_and_workers_that_go_are_reported_by_the_status(monkeypatch: pytest.MonkeyPatch):
    result, _ = sweep(monkeypatch, *INTO_C, before=raising(ClusterLost("the scheduler is gone")))
    reported = f"{BEGINNING}Error: the scheduler is gone; 1 of 2 runs done; run the same command again to resume\n"
    assert (result.exit_code, result.output) == (3, reported)
    result, _ = sweep(monkeypatch, *INTO_C, before=lambda _job: "its machine burnt")
    assert result.exit_code == 3
    assert "1 of 2 runs done, 1 lost" in result.output
    assert "1 lost: its machine burnt" in result.output


def test_what_cannot_be_begun_is_reported_before_units_are_built(here: Path, monkeypatch: pytest.MonkeyPatch):
    refuse_workers(monkeypatch)
    result = call(*CALL, *INTO_C)
    assert (result.exit_code, result.output) == (2, f"{BEGINNING}Error: there are none\n")

    def build(_plan: object) -> dict[str, Path]:
        raise AssertionError("units are not to be built")

    monkeypatch.setattr(plan_check, "unit_fmus", build)
    address = f"127.0.0.1:{closed_port()}"
    result = call(*CALL[:-2], "--scheduler", address)
    assert result.exit_code == 2
    assert result.output.startswith(f"Error: no scheduler can be reached at tcp://{address}: ")
    assert list(here.iterdir()) == []
    (here / "c").mkdir()
    with folder_locked(here / "c"):
        result, begun = sweep(monkeypatch, *INTO_C)
    assert (result.exit_code, begun) == (2, [])
    assert result.output.startswith("Error: folder c: another command is running this campaign")
