"""A cluster that the user runs: workers with several threads, and workers that cannot be used."""

import os
import pickle
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from support.clusters import scheduler, worker
from support.processes import lives, program, servers, until
from support.scenarios.sample_jobs import bad_job, quick_job

from handover.scenarios.runs.campaign.cluster import connect_cluster
from handover.scenarios.runs.campaign.scheduler import scheduler_address
from handover.scenarios.runs.execution.errors import PoolError

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc"),
]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Generator[str, None, None]:
    with scheduler(tmp_path_factory.mktemp("scheduler")) as address:
        yield address


def test_a_cluster_without_workers_is_refused(address: str):
    with (
        pytest.raises(PoolError, match=f"{address} has no workers; `dask worker {address}` starts some"),
        connect_cluster(address),
    ):
        pass


@pytest.fixture(scope="module")
def nanny(address: str, tmp_path_factory: pytest.TempPathFactory) -> Generator[int, None, None]:
    """The process that has started a worker of two threads."""
    with worker(tmp_path_factory.mktemp("worker"), address, threads=2) as process:
        yield process


def test_threads_of_a_worker_execute_runs_in_parallel(address: str, nanny: int, tmp_path: Path):
    runs = tmp_path / "runs"
    jobs = [quick_job(runs, f"run_{i}", seed=i) for i in range(4)]
    jobs.append(bad_job(runs, "Crashes", tmp_path))
    with connect_cluster(scheduler_address(address.removeprefix("tcp://"))) as pool:
        assert pool.workers == 2
        pool.check(runs)
        results = [(result.name, result.lost) for result in pool.run_jobs(jobs)]
        assert len(servers(nanny)) == 2
    assert sorted(results) == [("bad", ""), *((f"run_{i}", "") for i in range(4))]
    assert servers(nanny) == []  # though the cluster lives on


def test_a_run_that_always_takes_its_worker_with_it_is_given_up(address: str, nanny: int, tmp_path: Path):  # noqa: ARG001
    runs = tmp_path / "runs"
    with connect_cluster(address) as pool:
        (result,) = pool.run_jobs([bad_job(runs, "KillsItsWorker", tmp_path)])
    assert result.lost == "its worker was lost 4 times: killed, or out of memory"
    until(lambda: list(runs.iterdir()) == [])  # the last worker's server sees to that when its worker is gone


def test_a_command_that_is_killed_leaves_no_run_on_the_cluster(address: str, nanny: int, tmp_path: Path):
    runs = tmp_path / "runs"
    jobs = [bad_job(runs, "Hangs", tmp_path, f"hangs_{i}") for i in range(3)]
    (tmp_path / "jobs").write_bytes(pickle.dumps(jobs))
    with subprocess.Popen(program("scenarios/pool_program.py", tmp_path / "jobs", address)) as command:
        try:
            until(lambda: len(list(runs.glob(".*/signals.tail"))) == 2)
            below = servers(nanny)
            assert len(below) == 2
        finally:
            command.kill()
    until(lambda: not any(map(lives, below)))
    until(lambda: list(runs.iterdir()) == [])


@pytest.mark.parametrize(
    ("file", "text", "reported"),
    [
        (
            "handover_cosim-9.9.dist-info/METADATA",
            "Metadata-Version: 2.1\nName: handover-cosim\nVersion: 9.9\n",
            r"has other versions: handover-cosim 9\.9 \(here ",
        ),
        ("handover.py", "", r"cannot run this package: .*handover\.scenarios"),
    ],
)
def test_a_worker_of_another_version_or_without_this_package_is_refused(
    file: str, text: str, reported: str, address: str, tmp_path: Path
):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(text)
    places = f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    with (
        worker(tmp_path, address, PYTHONPATH=places),
        connect_cluster(address) as pool,
        pytest.raises(PoolError, match=rf"worker tcp://[\d.:]+ {reported}"),
    ):
        pool.check(tmp_path)


@pytest.mark.usefixtures("nanny")
def test_a_worker_that_does_not_see_the_folder_is_refused(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    with connect_cluster(address) as pool:
        (tmp_path / "here").mkdir()
        monkeypatch.chdir(tmp_path / "here")
        with pytest.raises(
            PoolError, match=r"worker tcp://[\d.:]+ cannot use .* does not see what is written there \(No such file"
        ):
            pool.check(Path("/proc/self/cwd"))  # another folder in each process
        assert list((tmp_path / "here").iterdir()) == []
