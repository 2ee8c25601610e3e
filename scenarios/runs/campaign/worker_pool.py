"""The worker pool that runs a campaign, as a protocol; its jobs, their results, how they pass a pipe, counts of runs.

`LocalPool` implements it on this machine, `ClusterPool` by Dask.
"""

import contextlib
import os
import uuid
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.stepping.options import OPTION_RECORDS, MasterOptions
from handover.scenarios.runs.results.run_folder import disk_errors_reported


@dataclass(frozen=True, kw_only=True)
class RunJob:
    """What a worker needs for a run, as plain data; paths are absolute and the same for all workers.

    Attributes:
        name: of the run's folder in `runs`. While it runs, its files are in a folder of another name beside it, which
            is renamed when the run has ended, so that a folder of this name is complete.
        scenario, parameters, seed: what to run; parameters are texts `name=value`. Of an SSP or an FMU, `scenario` is
            the path of its copy.
        modules: folder in which the scenario's module is; "" if it is installed.
        fmus: the FMU of each unit.
        runs: the campaign's folder of runs.
        options: how units are run.
        start, stop, step, inputs, recorded: as of `RunRequest`; "" for no inputs.
        log_level: from which level on its log has logs, see `logging_to_standard_error`.
    """

    name: str
    scenario: str
    parameters: tuple[str, ...]
    seed: int
    fmus: Mapping[str, str]
    runs: str
    options: MasterOptions
    modules: str = ""
    start: Fraction | None = None
    stop: Fraction | None = None
    step: Fraction | None = None
    inputs: str = ""
    recorded: tuple[str, ...] = ()
    log_level: str | None = None


@dataclass(frozen=True, kw_only=True)
class JobResult:
    """How a job ended.

    Attributes:
        name: the job's.
        lost: why there is no folder of the run, in a sentence; "" if there is one, whose `summary.json` says the rest.
        no_room: the system's message if it is lost by a full disk, as "No space left on device"; else "".
    """

    name: str
    lost: str = ""
    no_room: str = ""


_RECORDS = (RunJob, JobResult, *OPTION_RECORDS)
_LONGEST = 2**26
"""Bytes of a message at most: jobs and results have some hundreds, and a table of FMUs some thousands."""


def write_message(pipe: BinaryIO, message: Any) -> None:
    """Write a job or a result to a pipe: the length of its bytes (8, big endian), then what `pack_state` makes of it.

    Raises:
        OSError, ValueError: the pipe is closed.
    """
    packed = pack_state(message, _RECORDS)
    pipe.write(len(packed).to_bytes(8, "big") + packed)
    pipe.flush()


def read_message(pipe: BinaryIO) -> Any:
    """Read what `write_message` wrote. Nothing in it is executed.

    Raises:
        EOFError: the pipe has ended, perhaps amid a message. InvalidState: it is not such a message.
    """
    head = pipe.read(8)
    size = int.from_bytes(head, "big")
    if len(head) == 8 and size > _LONGEST:
        raise InvalidState(f"what came through the pipe is not a message: it begins with {head!r}")
    packed = pipe.read(size)
    if len(head) < 8 or len(packed) < size:
        raise EOFError
    return unpack_state(packed, _RECORDS)


class WorkerPool(Protocol):
    """Workers that run jobs side by side."""

    def check(self, folder: Path) -> None:
        """Check that all workers compute the same numbers as this process would, and write to the same folder.

        Args:
            folder: an existing one, into which runs are to be written.

        Raises:
            PoolError: some do not. RecordNotWritten: nothing can be written there, as on a full disk.
        """
        ...

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Give each job to a worker; yield the results as they come.

        A worker that is lost is replaced where that is possible, and its run started again. If the iteration is left
        before its end, runs under way are ended and leave nothing.

        Raises:
            ClusterLost: all workers were lost, and none came back.
        """
        ...


@contextlib.contextmanager
def marked(folder: Path) -> Generator[str, None, None]:
    """Keep a file in a folder during the block, to show that it can be written to; give its name, its content too.

    Raises:
        RecordNotWritten: it cannot.
    """
    mark = folder / f".{uuid.uuid4().hex}"
    with disk_errors_reported(folder):
        try:
            mark.write_text(mark.name, encoding="utf-8")
            yield mark.name
        finally:
            mark.unlink(missing_ok=True)


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True, kw_only=True)
class RunCounts:
    """Numbers of a campaign's runs.

    Attributes:
        total: all that are planned.
        kept: those that were done before this command.
        ended: those whose folder is complete, with those kept.
        failed: those of `ended` in which a unit failed.
        lost: those that no worker came back with in this command.
    """

    total: int
    kept: int = 0
    ended: int = 0
    failed: int = 0
    lost: int = 0

    @property
    def left(self) -> int:
        """Runs that are yet to come in this command."""
        return self.total - self.ended - self.lost


OnRunCounts = Callable[[RunCounts], None]
"""Is called with the counts of a campaign's runs, at its start and after each run."""
