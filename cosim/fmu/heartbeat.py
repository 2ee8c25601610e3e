"""Which call of which unit is under way, in memory that C code writes and another thread or process reads.

A run notes every call in its `Heartbeat`, together with what a crash report needs. Whoever supervises the run, a thread
of the same process or its parent process, reads there which call hangs or crashed; `StallTimer` measures for how long
the same call has been under way.
"""

import ctypes
import json
import mmap
import struct
import time
from collections.abc import Callable
from typing import Any, NamedTuple

SIZE = 2**20
"""Bytes of a heartbeat; the system allocates only the pages that are used."""

_NONE = -1  # no call is under way
_CODE, _COUNT, _TIME, _STOP, _LIMIT, _STATUS, _CRASHED, _WHERE = range(8)  # cells
_UNITS, _CALLS, _LOG, _FACTS = (64, 2**18), (2**18, 2**14), (2**18 + 2**14, 2**16), (2**19, 2**19)  # offset, size
_MAX_CALLS = 256  # different calls in a run; further ones share the last number


class Abandoned(BaseException):
    """A call returned after its unit was abandoned: units may no longer be touched, and this thread has to end."""


class Call(NamedTuple):
    """A call that is under way: the instance, what is called of it, and the simulated time in seconds."""

    unit: str
    call: str
    t: float


class Heartbeat:
    """Shows which call is under way. Writing costs a few stores in memory and no system call.

    The first 64 bytes are eight cells: 0 the call under way as int64 (see `code`; -1: none), 1 a count as int64 that
    changes with every call, 2 simulated time as float64, 3 an int64 that is not 0 when the thread that steps the units
    has to stop, 4 the limit of a call in seconds as float64, 5 the exit status plus 1 (0: none yet), 6 the thread that
    crashed the process and 7 the address of its instruction, as int64.

    C code that steps units writes cell 2 at each step's time, then before a call adds one to cell 1 and sets cell 0,
    and after the last call sets cell 0 to -1. After each call it reads cell 3; where that is not 0 it touches no unit
    any more and returns, and its caller raises `Abandoned`.

    The heartbeat holds no wall time, which would cost a system call: a supervisor sees by the count whether calls
    proceed, and measures the time itself.

    Attributes:
        abandoned: names of instances that did not return; they and their libraries are neither called nor freed.
        isolated: names of instances in processes of their own, which are ended after `limit` without further ado.
    """

    def __init__(self, memory: mmap.mmap | None = None) -> None:
        self.memory = mmap.mmap(-1, SIZE) if memory is None else memory
        whole = memoryview(self.memory)
        self._cells, self._seconds = whole[:64].cast("q"), whole[:64].cast("d")
        self._units, self._calls = _Lines(self.memory, *_UNITS), _Lines(self.memory, *_CALLS)
        self._log, self._facts = _Lines(self.memory, *_LOG), _Lines(self.memory, *_FACTS)
        self._unit_numbers = {name: i for i, name in enumerate(self._units.read())}
        self._call_numbers = {name: i for i, name in enumerate(self._calls.read())}
        self._write = struct.Struct("=qqd").pack_into
        self._count = 0
        self.abandoned: set[str] = set()
        self.isolated: set[str] = set()
        if memory is None:
            self.end()

    def code(self, unit: str, call: str) -> int:
        """Return what cell 0 holds while this call of this instance is under way."""
        unit_number, call_number = self._unit_numbers.get(unit), self._call_numbers.get(call)
        if unit_number is None:
            unit_number = self._unit_numbers[unit] = len(self._unit_numbers)
            self._units.append(unit)
        if call_number is None:
            call_number = self._call_numbers[call] = min(len(self._call_numbers), _MAX_CALLS - 1)
            self._calls.append(call)
        return unit_number * _MAX_CALLS + call_number

    def begin(self, code: int, t: float) -> None:
        """Note that a call begins, at simulated time t in seconds."""
        self._count += 1
        self._write(self.memory, 0, code, self._count, t)

    def end(self) -> None:
        """Note that the call has returned."""
        self._cells[_CODE] = _NONE

    @property
    def beat(self) -> tuple[int, int] | None:
        """The call under way as code and count, a pair that no other call has; None between calls."""
        count, code = self._cells[_COUNT], self._cells[_CODE]
        return None if code == _NONE else (code, count)

    @property
    def under_way(self) -> Call | None:
        """The call under way, by names."""
        code = self._cells[_CODE]
        if code == _NONE:
            return None
        unit_number, call_number = divmod(code, _MAX_CALLS)
        units, calls = self._units.read(), self._calls.read()
        unit = units[unit_number] if unit_number < len(units) else f"number {unit_number + 1}"
        call = calls[call_number] if call_number < len(calls) else "a call"
        return Call(unit, call, self._seconds[_TIME])

    @property
    def time(self) -> float:
        """Simulated time of the last call, s."""
        return self._seconds[_TIME]

    @property
    def stopped(self) -> bool:
        """Whether the thread that steps the units has to stop."""
        return self._cells[_STOP] != 0

    @stopped.setter
    def stopped(self, stopped: bool) -> None:
        self._cells[_STOP] = stopped

    @property
    def limit(self) -> float:
        """Seconds that a call may take, 0 where there is no limit; for a supervising process."""
        return self._seconds[_LIMIT]

    @limit.setter
    def limit(self, limit: float) -> None:
        self._seconds[_LIMIT] = limit

    @property
    def status(self) -> int | None:
        """The exit status with which the process that writes is about to end; None while it is not done."""
        return self._cells[_STATUS] - 1 if self._cells[_STATUS] else None

    @status.setter
    def status(self, status: int) -> None:
        self._cells[_STATUS] = status + 1

    @property
    def crash(self) -> tuple[int, int] | None:
        """The thread that crashed the process and the address of its instruction; None where that is not known."""
        thread, address = self._cells[_CRASHED], self._cells[_WHERE]
        return (thread, address) if thread else None

    @property
    def crash_address(self) -> int:
        """Address of the two cells of `crash`, for C code."""
        return self.address + 8 * _CRASHED

    @property
    def time_address(self) -> int:
        """Address of the cell of `time`, for C code."""
        return self.address + 8 * _TIME

    def record_facts(self, **facts: Any) -> None:
        """Keep facts, in addition to those kept before, for the report if this process crashes; JSON must hold them."""
        line = json.dumps({**self.facts, **facts})
        self._facts.clear()
        self._facts.append(line)

    def record_scratch_folder(self, folder: str) -> None:
        """Keep the path of a folder that is to be removed if this process crashes."""
        self.record_facts(scratch=[*self.facts.get("scratch", []), folder])

    @property
    def facts(self) -> dict[str, Any]:
        """What `tell` kept, by name."""
        lines = self._facts.read()
        return json.loads(lines[0]) if lines else {}

    def log(self, unit: str, message: str) -> None:
        """Keep what an instance logged; where there is no room, earlier lines are dropped."""
        for line in message.splitlines():
            entry = f"{unit}\t{line}"
            if not self._log.append(entry):
                self._log.clear()
                self._log.append(entry)

    def log_of(self, unit: str) -> tuple[str, ...]:
        """Return the last lines that an instance logged."""
        pairs = [line.partition("\t") for line in self._log.read()]
        return tuple(line for name, _, line in pairs if name == unit)[-30:]

    @property
    def address(self) -> int:
        """Address of the cells, for C code."""
        return ctypes.addressof(ctypes.c_char.from_buffer(self.memory))


class _Lines:
    """Lines of text in a part of the memory, after their length in bytes; that is set last, so lines are whole."""

    def __init__(self, memory: mmap.mmap, at: int, size: int) -> None:
        self._memory, self._at, self._size = memory, at, size

    def read(self) -> list[str]:
        (length,) = struct.unpack_from("<q", self._memory, self._at)
        text = self._memory[self._at + 8 : self._at + 8 + length]
        return text.decode("utf-8", "replace").split("\n")[:-1]

    def append(self, line: str) -> bool:
        (length,) = struct.unpack_from("<q", self._memory, self._at)
        text = line.encode() + b"\n"
        if 8 + length + len(text) > self._size:
            return False
        begin = self._at + 8 + length
        self._memory[begin : begin + len(text)] = text
        struct.pack_into("<q", self._memory, self._at, length + len(text))
        return True

    def clear(self) -> None:
        struct.pack_into("<q", self._memory, self._at, 0)


def own_page_reads() -> int:
    """Return how often this process has waited for a page of memory from the disk; 0 where that is unknown."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_majflt


class PolledClock:
    """Adds up the wall time between polls, of which at most `max_gap` seconds count each.

    If more has passed between two polls, this process or the machine was suspended, or busy with something else.

    Args:
        max_gap: seconds.
        clock: returns the wall time in seconds.

    Attributes:
        seconds: that have counted since the start.
    """

    def __init__(self, max_gap: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._max_gap, self._clock = max_gap, clock
        self.restart()

    def restart(self) -> None:
        """Begin at zero."""
        self.seconds, self._at = 0.0, self._clock()

    def poll(self, *, counts: bool = True) -> float:
        """Return the seconds until now; the time since the last poll is left out unless it `counts`."""
        now = self._clock()
        self.seconds += min(now - self._at, self._max_gap) if counts else 0.0
        self._at = now
        return self.seconds


class StallTimer:
    """Measures, by polling a heartbeat, for how long the same call has been under way.

    Of the time between two polls at most `max_gap` seconds count, see `PolledClock`. Time in which the process read its
    memory from the disk, as where it was swapped out, does not count.

    Args:
        heartbeat: of the process that makes the calls.
        max_gap: seconds.
        clock: returns the wall time in seconds.
        page_reads: counts what that process has read of its memory from the disk.
    """

    def __init__(
        self, heartbeat: Heartbeat, max_gap: float, clock: Callable[[], float] = time.monotonic,
        page_reads: Callable[[], int] = own_page_reads,
    ) -> None:  # fmt: skip
        self._heartbeat, self._clock, self._page_reads = heartbeat, PolledClock(max_gap, clock), page_reads
        self.beat: tuple[int, int] | None = None
        """The call that was under way at the last poll."""
        self._reads = page_reads()

    def poll(self, *, suspended: bool = False) -> float:
        """Return the seconds for which the present call has been under way, 0 where there is none.

        Args:
            suspended: whether the process that makes the calls is known to have been stopped since the last poll.
        """
        beat, reads = self._heartbeat.beat, self._page_reads()
        swapped, self._reads = reads != self._reads, reads
        if beat is None or beat != self.beat:
            self.beat = beat
            self._clock.restart()
            return 0.0
        return self._clock.poll(counts=not suspended and not swapped)
