"""Run servers as the process sees them that gives them jobs: a process each, and one that replaces it if it crashes."""

import contextlib
import queue
import shutil
import subprocess
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO, cast

from handover.cosim.blocks.block import InvalidState
from handover.cosim.python_process import module_command, without_safe_path
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, read_message, write_message

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
    """A process of `handover.scenarios.runs.campaign.run_server`. It ends when this process does, however that ends.

    It receives no Ctrl-C: the process that runs the campaign does, and ends it.
    """

    def __init__(self) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the process)
        self._process = subprocess.Popen(
            module_command("handover.scenarios.runs.campaign.run_server"),
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

    def end(self, deadline: float | None = None) -> None:
        """End it, and its run, which leaves nothing; it is killed at a deadline, by default in 5 s."""
        self.ask_to_end()
        deadline = time.monotonic() + _GRACE if deadline is None else deadline
        try:
            self._process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listening.join(max(0.0, deadline + _GRACE - time.monotonic()))  # its run ends after it, and writes

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


class JobRunner:
    """Runs one job after the other by a run server, which is started with the first and replaced when it has ended."""

    def __init__(self) -> None:
        self._server: ServerProcess | None = None
        self._lock = threading.Lock()
        self._ended = False

    def run(self, job: RunJob, wanted: Callable[[], bool]) -> JobResult:
        """Run a job. If the server crashes, another one starts the job again, once.

        Args:
            job: what to run.
            wanted: says whether the result is still waited for.
        """
        lost = ""
        for _ in range(2):
            if self._ended or not wanted():
                return JobResult(name=job.name, lost=lost or "it was ended, as nobody waited for it")
            try:
                return self._running_server().run_job(job, wanted)
            except ServerLost as e:
                lost = str(e)
            except NotWanted:
                continue
            except OSError as e:
                lost = f"its run server cannot be started: {e.strerror}"
        return JobResult(name=job.name, lost=lost or "it was ended, as nobody waited for it")

    def ask_to_end(self) -> None:
        """Let the server and its run end, without waiting for that. No further job is run."""
        with self._lock:
            self._ended = True
        if self._server is not None:
            self._server.ask_to_end()

    def end(self, deadline: float) -> None:
        """End the server, and its run, which leaves nothing, by a deadline."""
        self.ask_to_end()
        if self._server is not None:
            self._server.end(deadline)

    def _running_server(self) -> ServerProcess:
        with self._lock:
            if self._ended:
                raise NotWanted
            if self._server is None or not self._server.lives:
                self._server = ServerProcess()
            return self._server


def end_runners(runners: Sequence[JobRunner]) -> None:
    """End servers and their runs together: all of them have the time that one has."""
    for runner in runners:
        runner.ask_to_end()
    deadline = time.monotonic() + _GRACE
    for runner in runners:
        runner.end(deadline)
