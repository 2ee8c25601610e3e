"""What a worker of a Dask cluster does for a campaign: functions that the campaign's process calls there.

Each thread of a worker has a run server (`handover.scenarios.campaign.run_server`), a process to which it gives one job
after the other. All jobs of one worker pool have the same `batch`, by which they can be ended together.
"""

import contextlib
import functools
import os
import queue
import shutil
import subprocess
import tempfile
import threading
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

from distributed import get_worker

from handover.cosim.blocks.block import InvalidState
from handover.cosim.python_process import module_command, without_safe_path
from handover.scenarios.campaign.worker_pool import JobResult, RunJob, read_message, write_message
from handover.scenarios.results.run_folder import version_differences, versions

_POLL_INTERVAL = 0.5
"""How often is checked whether a run is still wanted, s."""

_GRACE = 5.0
"""How long a server gets to end its run and remove its files, s."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
"""Set to 1 for servers: runs are side by side, each with one core."""


class ServerLost(Exception):
    """The server has ended without a result."""


class NotWanted(Exception):
    """The run was ended, as nobody waits for it any more."""


class ServerProcess:
    """A process of `handover.scenarios.campaign.run_server`. It ends when this process does, however that ends.

    It receives no Ctrl-C: the process that runs the campaign does, and ends it.
    """

    def __init__(self) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the process)
        self._process = subprocess.Popen(
            module_command("handover.scenarios.campaign.run_server"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**without_safe_path(), **dict.fromkeys(_ONE_THREAD, "1")},
            start_new_session=True,
        )
        self._results: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def lives(self) -> bool:
        """Whether it can be given jobs."""
        return self._process.poll() is None

    def run_job(self, job: RunJob, wanted: Callable[[], bool]) -> JobResult:
        """Let the server run a job.

        Raises:
            ServerLost: the server has crashed, or was about to end. NotWanted: `wanted` says so; the server has ended.
        """
        folder = Path(job.runs, f".{job.name}.{uuid.uuid4().hex[:12]}")
        try:
            try:
                write_message(self._jobs, (job, str(folder)))
            except (OSError, ValueError) as e:
                raise ServerLost(self._how_it_ended()) from e
            while True:
                lives = self.lives
                with contextlib.suppress(queue.Empty):
                    result = self._results.get(timeout=_POLL_INTERVAL)
                    if result is None:
                        raise ServerLost(self._how_it_ended())
                    return result
                if not lives:
                    raise ServerLost(self._how_it_ended())
                if not wanted():
                    raise NotWanted
        except BaseException:
            self.end()
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def ask_to_end(self) -> None:
        """Let it end, without waiting for that."""
        with contextlib.suppress(OSError, ValueError):
            self._jobs.close()

    def end(self) -> None:
        """End it, and its run, which leaves nothing."""
        self.ask_to_end()
        try:
            self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listening.join(_GRACE)  # its run ends after it, and writes until then

    @property
    def _jobs(self) -> BinaryIO:
        return cast(BinaryIO, self._process.stdin)

    def _listen(self) -> None:
        """Take results until both the server and its run have ended."""
        results = cast(BinaryIO, self._process.stdout)
        with contextlib.suppress(EOFError, OSError, InvalidState):  # it ended, maybe amid a result
            while True:
                self._results.put(read_message(results))
        self._results.put(None)
        results.close()

    def _how_it_ended(self) -> str:
        """Return how the server ended."""
        status = self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").split("\n")
        error = next((f": {line.strip()}" for line in reversed(lines) if line.strip()), "")
        return f"its run server ended with status {status}{error}"


_servers: dict[tuple[str, int], ServerProcess] = {}
"""By batch and thread."""

_ended: set[str] = set()
"""Batches whose runs are not wanted any more."""

_lock = threading.Lock()


def run_job_on_worker(job: RunJob, batch: str, wanted_versions: Mapping[str, str]) -> JobResult:
    """Run a job of a batch. If its server crashes, start the job again with another server, once.

    A worker that joined after the others were checked may be of other versions; it runs nothing.
    """
    worker = get_worker()
    if other := difference(wanted_versions, _versions()):
        return JobResult(name=job.name, lost=f"worker {worker.address} {other}")
    task = worker.get_current_task()

    def wanted() -> bool:
        known = worker.state.tasks.get(task)
        return batch not in _ended and known is not None and known.state in ("executing", "long-running")

    lost = ""
    for _ in range(2):
        try:
            return _server_of(batch).run_job(job, wanted)
        except ServerLost as e:
            lost = str(e)
        except NotWanted:
            lost = "it was ended, as nobody waited for it"
        if not wanted():
            break
    return JobResult(name=job.name, lost=lost)


def end_runs(batch: str) -> None:
    """End the runs of a batch in this worker, and its servers."""
    with _lock:
        _ended.add(batch)
        servers = [_servers.pop(key) for key in list(_servers) if key[0] == batch]
    for server in servers:
        server.ask_to_end()
    for server in servers:
        server.end()


def package_versions() -> dict[str, str]:
    """Return the versions of the packages on which a run's numbers depend."""
    return _versions()


_versions = functools.cache(versions)


def difference(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return which versions of a worker differ, as a predicate; "" if none does."""
    other = version_differences(here, there)
    return f"has other versions: {other}" if other else ""


def fault_of_folder(folder: str, file: str, content: str) -> str:
    """Return why this worker cannot write to a folder in which the campaign has written a file, "" if it can."""
    try:
        if Path(folder, file).read_text(encoding="utf-8") != content:
            return "it sees another folder of that name"
    except OSError as e:
        return f"it does not see what is written there ({e.strerror})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it may not write there"


def _server_of(batch: str) -> ServerProcess:
    """Return this thread's server, which is started unless it runs.

    Raises:
        NotWanted: the batch is ended; jobs that waited here still come until the scheduler has cancelled them.
    """
    key = batch, threading.get_ident()
    with _lock:
        if batch in _ended:
            raise NotWanted
        server = _servers.get(key)
        if server is None or not server.lives:
            server = _servers[key] = ServerProcess()
    return server
