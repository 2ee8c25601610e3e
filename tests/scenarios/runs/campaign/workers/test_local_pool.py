"""A local pool runs all jobs whatever is killed, and leaves no process and no incomplete folder."""

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Generator, Sequence
from pathlib import Path

import psutil
import pytest
from support.processes import family, lives, program, servers, until
from support.scenarios.sample_jobs import bad_job, quick_job

from handover.scenarios.runs.campaign import pools
from handover.scenarios.runs.campaign.pools import LocalPool
from handover.scenarios.runs.campaign.run_servers import JobRunner
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, WorkerPool, cores

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc"),
]


@pytest.fixture(scope="module")
def pool() -> Generator[WorkerPool, None, None]:
    with LocalPool(2) as pool:
        yield pool


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


def results_of(pool: WorkerPool, jobs: Sequence[RunJob]) -> list[JobResult]:
    return sorted(pool.run_jobs(jobs), key=lambda result: result.name)


def going(runs: Path) -> bool:
    """Return whether two workers execute a run each."""
    return len(list(runs.glob(".*/signals.tail"))) == 2


def test_all_are_answered_and_one_that_fails_ends_no_other(pool: WorkerPool, runs: Path, tmp_path: Path):
    jobs = [*(quick_job(runs, f"run_{i}", seed=i) for i in range(5)), bad_job(runs, "Crashes", tmp_path)]
    jobs.append(bad_job(runs, "IsKilled", tmp_path, "killed"))
    pool.check(runs)
    results = results_of(pool, jobs)
    assert [result.name for result in results] == ["bad", "killed", *(f"run_{i}" for i in range(5))]
    assert [result.name for result in results if result.lost] == ["killed"]
    assert "was killed" in results[1].lost
    assert sorted(p.name for p in runs.iterdir()) == ["bad", *(f"run_{i}" for i in range(5))]
    assert len(servers(os.getpid())) == 2  # each has had a run


def test_a_killed_server_is_replaced_and_its_run_begun_anew(pool: WorkerPool, runs: Path):
    jobs = [quick_job(runs, f"run_{i}", seed=i) for i in range(4)]
    names: list[str] = []
    for result in pool.run_jobs(jobs):
        if not names:
            os.kill(servers(os.getpid())[0], signal.SIGKILL)
        names.append(result.name)
        assert result.lost == ""
    assert sorted(names) == sorted(p.name for p in runs.iterdir()) == [f"run_{i}" for i in range(4)]


def test_a_run_that_always_takes_its_server_with_it_is_given_up(pool: WorkerPool, runs: Path, tmp_path: Path):
    (result,) = pool.run_jobs([bad_job(runs, "KillsItsServer", tmp_path)])
    assert result.lost.startswith("its run server ended with status -9")
    assert list(runs.iterdir()) == []
    assert results_of(pool, [quick_job(runs)])[0].lost == ""


def test_an_iteration_that_is_left_ends_its_runs(pool: WorkerPool, runs: Path, tmp_path: Path):
    hanging = [bad_job(runs, "Hangs", tmp_path, f"hangs_{i}") for i in range(4)]
    results = pool.run_jobs([quick_job(runs), *hanging])
    assert next(iter(results)).name == "run"
    results.close()
    assert servers(os.getpid()) == []
    assert [p.name for p in runs.iterdir()] == ["run"]


def test_what_a_worker_raises_loses_its_run_and_no_other(runs: Path, monkeypatch: pytest.MonkeyPatch):
    def run(_runner: JobRunner, job: RunJob, _wanted: object) -> JobResult:
        if job.name == "run_1":
            raise MemoryError("no room")
        return JobResult(name=job.name)

    monkeypatch.setattr(JobRunner, "run", run)
    results = results_of(LocalPool(2), [quick_job(runs, f"run_{i}", seed=i) for i in range(3)])
    assert [(r.name, r.lost) for r in results] == [("run_0", ""), ("run_1", "MemoryError: no room"), ("run_2", "")]


def test_nobody_can_speak_to_it(pool: WorkerPool, runs: Path):
    assert results_of(pool, [quick_job(runs)])[0].lost == ""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    assert len(processes) >= 2
    assert [c for p in processes for c in p.net_connections(kind="inet") if c.status == psutil.CONN_LISTEN] == []


def test_by_default_there_is_a_worker_for_each_core(monkeypatch: pytest.MonkeyPatch):
    assert cores() == len(os.sched_getaffinity(0))
    monkeypatch.setattr(pools, "cores", lambda: 3)
    assert LocalPool(None).workers == 3


@pytest.mark.parametrize(("number", "status"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_a_command_that_is_ended_leaves_no_process_and_says_nothing(
    number: signal.Signals, status: int, runs: Path, tmp_path: Path
):
    hanging = [bad_job(runs, "Hangs", tmp_path, f"hangs_{i}") for i in range(4)]
    (tmp_path / "jobs").write_bytes(pickle.dumps(hanging))
    command = program("scenarios/pool_program.py", tmp_path / "jobs")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as process:
        try:
            until(lambda: going(runs))
            below = family(process.pid)
            assert len(below) == 4  # two servers, two runs
            if number == signal.SIGINT:
                os.killpg(process.pid, number)  # as Ctrl-C in a terminal does
            else:
                process.kill()
            assert process.communicate(timeout=60) == (b"", b"")
            assert process.returncode == status
        finally:
            process.kill()
    until(lambda: not any(map(lives, below)))
    until(lambda: list(runs.iterdir()) == [])
