"""A campaign on a disk that is full ends in one line, with status 3; run the same command again to resume."""

import contextlib
import errno
import gc
import io
import os
import tempfile
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support.commands import call
from support.cosim.native_units import native_fmu
from support.in_process_pool import InProcessPool

from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.runs.campaign import pools
from handover.scenarios.runs.campaign.cluster import ClusterPool
from handover.scenarios.runs.campaign.run_server import RunServer
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, WorkerPool, read_message, write_message
from handover.scenarios.runs.execution import supervisor

CALL = ("sweep", native_fmu("mass"), "--repeat", "3", "--out", "c", "--no-report", "--workers", "2")
BEGINNING = f"3 runs of {CALL[1]} on 2 workers into c\n"
GOES_ON = "1 of 3 runs done; run the same command again to resume"
FULL = os.strerror(errno.ENOSPC)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(monkeypatch: pytest.MonkeyPatch, pool: WorkerPool) -> Result:
    """Return how the command ended with a worker pool."""

    @contextlib.contextmanager
    def given(_workers: int | None) -> Generator[WorkerPool, None, None]:
        yield pool

    monkeypatch.setattr(pools, "LocalPool", given)
    return call(*CALL)


def interrupt(_job: RunJob) -> str:
    raise KeyboardInterrupt


def test_a_mark_for_workers_that_cannot_be_written_is_reported(here: Path, monkeypatch: pytest.MonkeyPatch):
    """It is the first that a campaign which goes on writes."""
    assert sweep(monkeypatch, InProcessPool(interrupt)).exit_code == 1
    before = sorted(here.rglob("*"))

    def refuse(file: Path, *_text: Any, **_options: Any) -> None:
        file.touch()  # a name takes no room
        raise OSError(errno.ENOSPC, FULL, str(file))

    monkeypatch.setattr(Path, "write_text", refuse)
    monkeypatch.setattr(ClusterPool, "_ask", lambda *_question: dict[str, Any]())  # type: ignore
    result = sweep(monkeypatch, ClusterPool(None, "nowhere"))  # type: ignore[arg-type]
    text = f"{BEGINNING}Error: c cannot be written: No space left on device\n"
    assert (result.exit_code, result.output) == (3, text)
    assert sorted(here.rglob("*")) == before


def test_a_run_without_room_stops_it_and_what_is_done_stays(monkeypatch: pytest.MonkeyPatch):
    class Full(InProcessPool):
        def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
            yield from super().run_jobs(jobs[:1])
            yield JobResult(name=jobs[1].name, lost="it was lost", no_room="Disk quota exceeded")
            raise AssertionError("no other run is waited for")

    result = sweep(monkeypatch, Full())
    text = f"c/runs/000_r0001 cannot be written: Disk quota exceeded; {GOES_ON}"
    assert (result.exit_code, result.output) == (3, f"{BEGINNING}Error: {text}\n")
    assert CampaignTable.read(Path("c")).column("run").tolist() == ["000_r0000"]


def test_words_of_a_full_disk_stop_nothing(monkeypatch: pytest.MonkeyPatch):
    result = sweep(monkeypatch, InProcessPool(lambda _job: f"its camera says: {FULL}"))
    assert result.exit_code == 3
    assert "3 lost" in result.output
    assert "cannot be written" not in result.output


@pytest.mark.parametrize(("number", "full"), [(errno.EDQUOT, True), (errno.EACCES, False)])
def test_a_run_server_without_room_for_what_a_run_prints_answers(
    number: int, full: bool, here: Path, monkeypatch: pytest.MonkeyPatch
):
    def refuse(**_options: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    job = RunJob(name="r", scenario="none", parameters=(), seed=0, fmus={}, runs=str(here), options=MasterOptions())
    jobs, results = io.BytesIO(), io.BytesIO()
    write_message(jobs, (job, str(here / ".r")))
    jobs.seek(0)
    monkeypatch.setattr(supervisor, "can_supervise", lambda: False)
    frozen = gc.get_freeze_count()
    RunServer(jobs, results).serve()
    assert gc.get_freeze_count() == frozen  # else libraries complain at this process's end of what was never collected
    said = os.strerror(number)
    text = JobResult(name="r", lost=f"{here} cannot be written: {said}", no_room=said if full else "")
    results.seek(0)
    assert read_message(results) == text


def test_a_table_that_cannot_be_written_stops(monkeypatch: pytest.MonkeyPatch):
    replace = os.replace

    def refuse(source: str | Path, target: str | Path) -> None:
        if Path(target).name == "runs.parquet":
            raise OSError(errno.ENOSPC, FULL)
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)
    result = sweep(monkeypatch, InProcessPool())
    text = f"c/runs.parquet cannot be written: No space left on device; {GOES_ON}"
    assert (result.exit_code, result.output) == (3, f"{BEGINNING}Error: {text}\n")
    assert sorted(p.name for p in Path("c").iterdir()) == ["campaign.json", "fmus", "runs"]
