"""Which call of which unit is under way, in memory that a C loop writes and another thread or process reads.

For how long the same call has been under way.
"""

import json
import mmap
import struct
import time
from collections.abc import Callable
from typing import Any, NamedTuple

SIZE = 2**20
"""Bytes of a heartbeat; the system gives only those that are used."""

_NONE = -1
_DOING, _COUNT, _TIME, _STOP, _LIMIT, _OVER = range(6)
_UNITS, _CALLS, _LOG, _NOTES = (64, 2**18), (2**18, 2**14), (2**18 + 2**14, 2**16), (2**19, 2**19)
_CALLS_OF_A_UNIT = 256


class Abandoned(BaseException):
    """A call returned too late: the units belong to another thread, and this one has to end at once."""


class Call(NamedTuple):
    """A call that is under way: the instance, what is called of it, and the simulated time in seconds."""

    unit: str
    call: str
    t: float


class Heartbeat:
    """Tells which call is under way. Writing costs a few stores in memory and no system call.

    The first 64 bytes are eight cells: 0 the call under way as int64 (see `code`; -1: none), 1 a count as int64 that
    changes with every call, 2 simulated time as float64, 3 an int64 that is not 0 when the units are taken from who
    steps them.
    A C loop over units writes cell 2 at each step's time, then before a call adds one to cell 1 and sets cell 0, and
    after the last call sets cell 0 to -1. After each call it reads cell 3 before it goes on; where that is not 0 it
    touches no unit any more and returns, and its caller raises `Abandoned`.

    Without a clock in it, whoever watches sees by the count that calls go on, and takes the time himself.

    Attributes:
        abandoned: names of instances that did not return; they and their libraries are left alone.
    """

    def __init__(self, memory: mmap.mmap | None = None) -> None:
        self.memory = mmap.mmap(-1, SIZE) if memory is None else memory
        whole = memoryview(self.memory)
        self._cells, self._seconds = whole[:64].cast("q"), whole[:64].cast("d")
        self._units, self._calls = _Lines(self.memory, *_UNITS), _Lines(self.memory, *_CALLS)
        self._log, self._notes = _Lines(self.memory, *_LOG), _Lines(self.memory, *_NOTES)
        self._places = {name: i for i, name in enumerate(self._units.read())}
        self._known = {name: i for i, name in enumerate(self._calls.read())}
        self._write = struct.Struct("=qqd").pack_into
        self._count = 0
        self.abandoned: set[str] = set()
        if memory is None:
            self.end()

    def code(self, unit: str, call: str) -> int:
        """Return what cell 0 holds while this call of this instance is under way."""
        place, which = self._places.get(unit), self._known.get(call)
        if place is None:
            place = self._places[unit] = len(self._places)
            self._units.append(unit)
        if which is None:
            which = self._known[call] = min(len(self._known), _CALLS_OF_A_UNIT - 1)
            self._calls.append(call)
        return place * _CALLS_OF_A_UNIT + which

    def begin(self, code: int, t: float) -> None:
        """Tell that a call begins, at simulated time t in seconds."""
        self._count += 1
        self._write(self.memory, 0, code, self._count, t)

    def end(self) -> None:
        """Tell that the call has returned."""
        self._cells[_DOING] = _NONE

    @property
    def beat(self) -> tuple[int, int] | None:
        """A call under way as code and count, which the next one does not share; None between calls."""
        count, code = self._cells[_COUNT], self._cells[_DOING]
        return None if code == _NONE else (code, count)

    @property
    def under_way(self) -> Call | None:
        """The call under way, by names."""
        code = self._cells[_DOING]
        if code == _NONE:
            return None
        place, which = divmod(code, _CALLS_OF_A_UNIT)
        units, calls = self._units.read(), self._calls.read()
        unit = units[place] if place < len(units) else f"number {place + 1}"
        return Call(unit, calls[which] if which < len(calls) else "a call", self._seconds[_TIME])

    @property
    def time(self) -> float:
        """Simulated time of the last call, s."""
        return self._seconds[_TIME]

    @property
    def stopped(self) -> bool:
        """Whether the units are taken from who steps them."""
        return self._cells[_STOP] != 0

    @stopped.setter
    def stopped(self, stopped: bool) -> None:
        self._cells[_STOP] = stopped

    @property
    def limit(self) -> float:
        """Seconds that a call may take, 0 where there is no limit; for a process that watches."""
        return self._seconds[_LIMIT]

    @limit.setter
    def limit(self, limit: float) -> None:
        self._seconds[_LIMIT] = limit

    @property
    def status(self) -> int | None:
        """With what status the process that writes ends because it is done; None: it is not done."""
        return self._cells[_OVER] - 1 if self._cells[_OVER] else None

    @status.setter
    def status(self, status: int) -> None:
        self._cells[_OVER] = status + 1

    def tell(self, **facts: Any) -> None:
        """Keep facts, which JSON can hold, for the case that this process dies."""
        text = json.dumps({**self.facts, **facts})
        self._notes.clear()
        self._notes.append(text)

    def record_scratch_folder(self, folder: str) -> None:
        """Keep the place of a folder that is to be removed if this process dies."""
        self.tell(scratch=[*self.facts.get("scratch", []), folder])

    @property
    def facts(self) -> dict[str, Any]:
        """What was told, by name."""
        lines = self._notes.read()
        return json.loads(lines[0]) if lines else {}

    def log(self, unit: str, message: str) -> None:
        """Keep what an instance logged; where there is no room, what was logged before is forgotten."""
        for line in message.splitlines():
            sentence = f"{unit}\t{line}"
            if not self._log.append(sentence):
                self._log.clear()
                self._log.append(sentence)

    def log_of(self, unit: str) -> tuple[str, ...]:
        """Return the last lines that an instance logged."""
        pairs = [line.partition("\t") for line in self._log.read()]
        return tuple(line for name, _, line in pairs if name == unit)[-30:]

    @property
    def address(self) -> int:
        """Where the cells lie, for C."""
        import ctypes

        return ctypes.addressof(ctypes.c_char.from_buffer(self.memory))


class _Lines:
    """Lines of text in a part of the memory, which begins with their length in bytes: set last, so they are whole."""

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


class StallTimer:
    """Looks at a heartbeat now and then, and adds up the time in which one call did not return.

    Of the time between two looks at most `most` seconds count: if more has passed, it was the whole process, or the
    machine, that stood still.
    """

    def __init__(self, heartbeat: Heartbeat, max_gap: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._heartbeat, self._max_gap, self._clock = heartbeat, max_gap, clock
        self.beat: tuple[int, int] | None = None
        """The call that was under way at the last look."""
        self._seconds, self._checked_at = 0.0, clock()

    def elapsed(self) -> float:
        """Return the seconds for which the call that is under way has been seen; 0 where there is none."""
        now, beat = self._clock(), self._heartbeat.beat
        passed, self._checked_at = now - self._checked_at, now
        if beat is None or beat != self.beat:
            self.beat, self._seconds = beat, 0.0
        else:
            self._seconds += min(passed, self._max_gap)
        return self._seconds
