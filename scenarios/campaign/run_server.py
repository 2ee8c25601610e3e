"""A process that carries out one run after the other, each in a child of its own: `python -m` this module.

It has loaded what runs need, so that a run costs a fork and not the start of an interpreter. It reads orders from
standard input and answers on standard output, all pickled: an order is a `RunJob` and the folder for its files while
it runs; the answer is a `JobResult`. It ends with its input, and a run under way with it.

Where processes cannot be forked (Windows) it carries runs out itself: what a unit does to the process, it does to it.
"""

import contextlib
import gc
import importlib
import os
import pickle
import select
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO, NoReturn

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.fmus.catalog import UNITS, import_block
from handover.scenarios.campaign.run_job import (
    finish,
    job_result,
    lost_by,
    printing_to,
    record_failed_job,
    run_job,
)
from handover.scenarios.campaign.worker_pool import JobResult, RunJob
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.execution import supervisor
from handover.scenarios.execution.child_process import ChildEnd, ForkedChild
from handover.scenarios.execution.crash import Crash
from handover.scenarios.results.summary import ElapsedTime

IDLE = 60.0
"""Seconds without an order after which it ends by itself, so that none stays on a cluster that lives on."""


class RunServer:
    """Carries out orders.

    Args:
        orders: where they come from.
        answers: where the answers go.
    """

    def __init__(self, jobs: BinaryIO, results: BinaryIO) -> None:
        self._jobs, self._results = jobs, results
        self._loaded: set[str] = set()
        self._forks = supervisor.can_supervise()

    def serve(self) -> None:
        """Carry out orders until there are no more."""
        while self._comes():
            try:
                job, folder = pickle.load(self._jobs)
            except (EOFError, pickle.UnpicklingError):  # the worker has ended, maybe amid an order
                return
            self._load(job.scenario)
            pickle.dump(self._run_job(job, folder), self._results)
            self._results.flush()

    def _comes(self) -> bool:
        """Wait for an order, or the end of them."""
        return not self._forks or bool(select.select([self._jobs], [], [], IDLE)[0])

    def _load(self, scenario: str) -> None:
        """Load what the units of a scenario import, once for all its runs."""
        if scenario in self._loaded or scenario not in SCENARIOS:
            return
        self._loaded.add(scenario)
        for unit in SCENARIOS[scenario].units.values():
            with contextlib.suppress(Exception):  # a run that needs it will tell
                import_block(UNITS[unit].block)
                for module in UNITS[unit].deferred:
                    importlib.import_module(module)
        gc.collect()
        gc.freeze()  # else the collector of each child touches, and so copies, all that is loaded

    def _run_job(self, job: RunJob, folder: Path) -> JobResult:
        try:
            log = tempfile.TemporaryFile(dir=job.runs)  # noqa: SIM115 (closed below)
        except OSError as e:
            return lost_by(e, job, f"{job.runs} cannot be written: {e.strerror}")
        with log:
            if self._forks:
                result = self._fork(job, folder, log)
            else:
                with printing_to(log):
                    result = job_result(job, lambda: run_job(job, folder))
            result = result if result.lost else finish(job, folder, log)
        if result.lost:
            shutil.rmtree(folder, ignore_errors=True)
        return result

    def _fork(self, job: RunJob, folder: Path, log: BinaryIO) -> JobResult:
        """Carry out a run in a child; if that dies of a unit, another child tells of it in the folder."""
        began = time.monotonic()
        end, heartbeat = self._in_child(lambda: job_result(job, lambda: run_job(job, folder)), folder, log)
        if heartbeat.status is not None:
            return _result(job, heartbeat, "")
        death = Crash(heartbeat, end, time.monotonic() - began)
        if death.was_killed or end.signal in supervisor.ORDERS:
            return JobResult(name=job.name, lost=death.message)
        left, failure, spent = death.folder, death.failure, ElapsedTime(time.monotonic() - began, end.cpu)
        if left is None and failure is None:
            return JobResult(name=job.name, lost=death.message)

        def tell() -> None:
            if left is not None:
                death.complete(left)
            elif failure is not None:
                record_failed_job(job, folder, failure, spent)

        end, heartbeat = self._in_child(lambda: job_result(job, tell), folder, log)
        return _result(job, heartbeat, "" if heartbeat.status == 0 else death.message)

    def _in_child(self, work: Callable[[], JobResult], folder: Path, log: BinaryIO) -> tuple[ChildEnd, Heartbeat]:
        heartbeat = supervisor.renew_heartbeat()

        def begin() -> NoReturn:
            supervisor.begin_child()
            os.close(self._jobs.fileno())  # answers stay open: by their end the worker knows that runs have ended too
            for number in (1, 2):
                os.dup2(log.fileno(), number)
            result = work()
            if result.lost:
                heartbeat.tell(loss={"lost": result.lost, "no_room": result.no_room})
            supervisor.leave(1 if result.lost else 0)

        child = ForkedChild(begin, heartbeat)
        end = child.wait(self._jobs.fileno())
        if end is None:  # no order comes before the answer: the worker is gone
            child.kill()
            for scratch in heartbeat.facts.get("scratch", []):
                shutil.rmtree(scratch, ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)
            sys.exit()
        return end, heartbeat


def _result(job: RunJob, heartbeat: Heartbeat, otherwise: str) -> JobResult:
    """Answer as the child has told that the run is lost, or otherwise."""
    loss: Mapping[str, str] = heartbeat.facts.get("loss", {"lost": otherwise})
    return JobResult(name=job.name, **loss)


def main() -> None:
    """Serve on the standard streams, which runs do not see."""
    jobs, results = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    RunServer(jobs, results).serve()


if __name__ == "__main__":
    main()
