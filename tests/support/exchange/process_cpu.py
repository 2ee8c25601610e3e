"""CPU time of a process and of those that it has started, which a unit's interpreter may be; for Linux alone."""

import os
import time
from collections.abc import Sequence

from support import processes

_OF_A_PROCESS = 2
"""Linux' mark, in a clock's number, of the clock that a process's scheduler keeps."""


def cpu_seconds(processes: Sequence[int]) -> float:
    """Return the CPU time of processes that run, of all their threads."""
    return sum(time.clock_gettime(~process << 3 | _OF_A_PROCESS) for process in processes)


def family(process: int | None = None) -> list[int]:
    """Return a process, by default this one, and its descendants."""
    first = os.getpid() if process is None else process
    return [first, *processes.family(first)]
