"""What a campaign costs beside its runs, and what a second worker brings.

`pytest tests/benchmarks/test_campaign_speed.py --benchmark-enable -s` prints the figures. Runs are of helix_handover
and give up after a second of simulated time, which takes one to two seconds of wall time on an idle core.

Time is counted from the first job to the last result, when the workers are up and have executed one run each, in which
they load what runs need (2 to 4 s a worker, once). A run's own time are the `wall_seconds` of its summary: from when
its system is built until its summary is written. Overhead is what remains: forking, the folder's name, ending the
process, and Dask.
"""

import json
import time
from collections.abc import Sequence
from pathlib import Path

import psutil
from pytest_benchmark.fixture import BenchmarkFixture

from handover.cosim.stepping.options import MasterOptions
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.runs.campaign.pools import LocalPool
from handover.scenarios.runs.campaign.worker_pool import RunJob, WorkerPool

RUNS, ROUNDS = 10, 3
OVERHEAD = 0.05
"""Most that a campaign takes more than its runs, relative to these."""
CPU_OVERHEAD = 0.1
"""Likewise of CPU time; a busy machine makes forks and short waits dearer than they are."""
FASTER = 1.8
"""How many times as fast two workers are at least as one."""


def jobs(runs: Path, count: int) -> Sequence[RunJob]:
    """Return jobs of short runs in a folder of their own."""
    runs.mkdir(parents=True)
    fmus = {unit: str(cached(block, 3)) for unit, block in SCENARIOS["helix_handover"].units.items()}
    return [
        RunJob(
            name=f"run_{i}",
            scenario="helix_handover",
            parameters=("patience=1",),
            seed=i,
            fmus=fmus,
            runs=str(runs),
            options=MasterOptions(),
        )
        for i in range(count)
    ]


def carried_out(pool: WorkerPool, given: Sequence[RunJob]) -> tuple[float, float]:
    """Return the seconds that a worker pool takes for jobs, and the total of the runs' own seconds."""
    began = time.perf_counter()
    results = list(pool.run_jobs(given))
    took = time.perf_counter() - began
    assert [result.lost for result in results] == [""] * len(given)
    summaries = [json.loads(Path(job.runs, job.name, "summary.json").read_text()) for job in given]
    return took, sum(summary["wall_seconds"] for summary in summaries)


def processor_time(process: psutil.Process) -> float:
    """Return the CPU seconds of a process and of all below it, with those that have ended."""
    times = process.cpu_times()
    own = times.user + times.system + times.children_user + times.children_system
    return own + sum(processor_time(child) for child in process.children())


def test_a_campaign_costs_little_beside_its_runs(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """CPU time, which a busy machine does not change, is also what forks and pipes take while they wait."""
    found: list[tuple[float, float]] = []

    def measure() -> None:
        given = jobs(tmp_path / f"{len(found)}", RUNS if benchmark.enabled else 3)
        before = processor_time(psutil.Process())
        took, spent = carried_out(pool, given)
        cpu = processor_time(psutil.Process()) - before
        summaries = [json.loads(Path(job.runs, job.name, "summary.json").read_text()) for job in given]
        cpu_of_runs = sum(summary["cpu_seconds"] for summary in summaries)
        found.append(((took - spent) / spent, (cpu - cpu_of_runs) / cpu_of_runs))

    with LocalPool(1) as pool:
        carried_out(pool, jobs(tmp_path / "first", 1))
        benchmark.pedantic(measure, rounds=ROUNDS if benchmark.enabled else 1)
    overhead, of_cpu = (min(each) for each in zip(*found, strict=True))
    print(f"\n{RUNS} runs on one worker: overhead {overhead:.1%} of wall time, {of_cpu:.1%} of CPU time")
    benchmark.extra_info.update(overhead=overhead, of_cpu=of_cpu)
    assert of_cpu <= CPU_OVERHEAD
    if benchmark.enabled:  # else other tests run beside it
        assert overhead <= OVERHEAD


def test_two_workers_are_nearly_twice_as_fast_as_one(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    took: dict[int, list[float]] = {1: [], 2: []}

    def measure() -> None:
        for workers, seconds in took.items():
            with LocalPool(workers) as pool:
                carried_out(pool, jobs(tmp_path / f"first_{workers}_{len(seconds)}", workers))
                given = jobs(tmp_path / f"{workers}_{len(seconds)}", RUNS if benchmark.enabled else 2)
                seconds.append(carried_out(pool, given)[0])

    benchmark.pedantic(measure, rounds=ROUNDS if benchmark.enabled else 1)
    faster = min(took[1]) / min(took[2])
    entries = ", ".join(f"{workers} workers {min(seconds):.2f} s" for workers, seconds in took.items())
    print(f"\n{RUNS} runs: {entries}; {faster:.2f} times as fast")
    benchmark.extra_info["faster"] = faster
    if benchmark.enabled:
        assert faster >= FASTER
