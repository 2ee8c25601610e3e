"""A process that runs one job after the other, each in a forked child: `python -m` this module.

It has loaded what runs need, so that a run costs a fork and not the start of an interpreter. It reads jobs from
standard input and writes results to standard output, as messages of plain data: a job is a `RunJob` and the folder for
its files while it runs; the result is a `JobResult`. It ends when its input is closed, and a run under way with it.

Where processes cannot be forked (Windows) it runs jobs itself, and a unit that crashes crashes the server.
"""

import contextlib
import gc
import importlib
import json
import os
import select
import shutil
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from handover.cosim.files import scratch_folder
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.scenarios.runs.campaign.run_job import (
    finish,
    job_result,
    lost_by,
    printing_to,
    record_failed_job,
    run_job,
)
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, read_message, write_message
from handover.scenarios.runs.execution import supervisor
from handover.scenarios.runs.execution.child_process import ChildEnd, ForkedChild
from handover.scenarios.runs.execution.crash import Crash
from handover.scenarios.runs.execution.selection import load_units
from handover.scenarios.runs.results.summary import ElapsedTime

IDLE = 60.0
"""Seconds without a job after which it ends by itself: a cluster may outlive the campaign."""

STOP_LIMIT = 60.0
"""Seconds after which a run that was stopped (SIGSTOP) is given up; the next call of the campaign tries it again."""


class RunServer:
    """Runs jobs.

    Args:
        jobs: stream from which jobs are read.
        results: stream to which their results are written.
    """

    def __init__(self, jobs: BinaryIO, results: BinaryIO) -> None:
        self._jobs, self._results = jobs, results
        self._loaded: set[str] = set()
        self._forks = supervisor.can_supervise()

    def serve(self) -> None:
        """Run jobs until there are no more.

        Raises:
            InvalidState: what came is not a job.
        """
        while self._job_comes():
            try:
                job, folder = read_message(self._jobs)
            except EOFError:  # the worker has ended, maybe while it wrote a job
                return
            self._load(job)
            write_message(self._results, self._run_job(job, Path(folder)))

    def _job_comes(self) -> bool:
        """Wait for a job, or the end of the stream; return False if none came in time."""
        return not self._forks or bool(select.select([self._jobs], [], [], IDLE)[0])

    def _load(self, job: RunJob) -> None:
        """Load what the units of a scenario import, once for all its runs; not what its author may change meanwhile."""
        if job.modules or job.scenario in self._loaded:
            return
        self._loaded.add(job.scenario)
        with contextlib.suppress(ImportError):  # without it pyarrow goes by itself
            importlib.import_module("pandas")  # pyarrow does as a record is looked through: a tenth of a short run
        load_units(job.scenario)
        for path in (*job.fmus.values(), job.scenario):
            with contextlib.suppress(Exception):  # whoever runs it says what is wrong with it
                load_modules(Path(path))
        if self._forks:
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
        """Run a job in a child; if a unit crashes that, another child completes the folder."""
        began = time.monotonic()
        end, heartbeat = self._in_child(lambda: job_result(job, lambda: run_job(job, folder)), folder, log)
        if heartbeat.status is not None:
            return _result(job, heartbeat, "")
        crash = Crash(heartbeat, end, time.monotonic() - began)
        if crash.concluded is not None:
            return JobResult(name=job.name)
        if crash.was_killed or end.signal in supervisor.TERMINATION_SIGNALS:
            return JobResult(name=job.name, lost=crash.message)
        run_folder, failure, spent = crash.folder, crash.failure, ElapsedTime(time.monotonic() - began, end.cpu)
        if run_folder is None and failure is None:
            return JobResult(name=job.name, lost=crash.message)

        def record_crash() -> None:
            if run_folder is not None:
                crash.complete(run_folder)
            elif failure is not None:
                record_failed_job(job, folder, failure, spent)

        end, heartbeat = self._in_child(lambda: job_result(job, record_crash), folder, log)
        return _result(job, heartbeat, "" if heartbeat.status == 0 else crash.message)

    def _in_child(self, work: Callable[[], JobResult], folder: Path, log: BinaryIO) -> tuple[ChildEnd, Heartbeat]:
        heartbeat = supervisor.renew_heartbeat()

        def begin() -> NoReturn:
            supervisor.begin_child()
            os.close(self._jobs.fileno())  # results stay open: their end says that the run has ended, too
            for number in (1, 2):
                os.dup2(log.fileno(), number)
            result = work()
            if result.lost:
                heartbeat.record_facts(loss={"lost": result.lost, "no_room": result.no_room})
            supervisor.leave(1 if result.lost else 0)

        child = ForkedChild(begin, heartbeat)
        end = child.wait(self._jobs.fileno(), stop_limit=STOP_LIMIT)
        if end is None:  # jobs come one by one: what can be read now is the end of the stream
            child.kill()
            for scratch in heartbeat.facts.get("scratch", []):
                shutil.rmtree(scratch, ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)
            sys.exit()
        return end, heartbeat


def load_modules(path: Path) -> None:
    """Load the modules of one of this package's FMUs, if a file is one: children of this process find them loaded.

    They are kept by the hash of their content (`fmus/loader.py`), so an FMU that differs loads its own. To compile and
    load them is a third of a short run.
    """
    with zipfile.ZipFile(path) as archive, scratch_folder("server") as folder:
        if "resources/unit.json" not in archive.namelist():
            return
        unit = json.loads(archive.read("resources/unit.json"))
        if not unit["block"].startswith("handover."):  # others run code of their own as they are loaded
            return
        names = [name for name in archive.namelist() if name.startswith("resources/")]
        archive.extractall(folder, names)
        loader: dict[str, Any] = {"__name__": "loader"}
        exec(archive.read("resources/sources/handover/fmus/loader.py"), loader)
        loader["start"](str(Path(folder, "resources")), unit["token"])


def _result(job: RunJob, heartbeat: Heartbeat, otherwise: str) -> JobResult:
    """Return the result that a child has left in its heartbeat, or `otherwise` as the reason why the run is lost."""
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
