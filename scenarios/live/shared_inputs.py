"""Inputs of a run from outside, which another process may set while it goes on: a hand, a push.

They lie in a memory-mapped file. The process that serves a page, or reads a device, writes samples of them; the run
reads the newest at each communication point, and writes down which one it used, and how old that was.
"""

import contextlib
import json
import math
import mmap
import threading
import time
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import nearest
from handover.cosim.system.time_series import ExternalSource

Integers = NDArray[np.int64]

NEVER = 1e6
"""Age of what never came, s; older than any limit."""
_SAMPLE = np.dtype([("begun", "<i8"), ("ended", "<i8"), ("stamp", "<f8"), ("check", "<i8")])
USE = np.dtype([("t", "<f8"), ("number", "<i8"), ("stamp", "<f8"), ("at", "<f8")])
"""Which sample the run used: for the communication point at t, s; the sample's number, from 1; its stamp, and when it
was read, both in s of the monotonic clock."""
_MOST_USES = 1 << 14
"""Uses that are kept: of four minutes in steps of 16 ms."""
_GUARD = 16
"""Oldest of them that are not read, since the run may be writing over them."""
_TRIES = 1000
"""How often a sample that is being written is read again, until the one before it is used once more."""


class UnknownInput(KeyError):
    """A value is set of an input that there is not."""


class SharedInputs:
    """Inputs by their names `unit.input`, in a file of both processes: one writes samples, the other uses them.

    A sample is all inputs at one time, its stamp: seconds of the monotonic clock (`time.monotonic`), which all
    processes of a machine share, at which the device saw what it says. Inputs that were not set hold on; those that
    never were keep the start values of their units.

    A sequence lock: the counter is written before and after each sample, so a reader detects a torn read. The CRC
    catches reordered stores on weakly ordered CPUs.

    Args:
        path: a file that `create` has made.
    """

    def __init__(self, path: Path) -> None:
        with open(path, "r+b") as file:
            self._map = mmap.mmap(file.fileno(), 0)
        head = self._map.readline()
        layout = json.loads(head)
        self.sizes: Mapping[str, int] = layout["inputs"]
        self._age_of: Sequence[str] = layout["ages"]
        count = sum(self.sizes.values())
        at = _aligned(len(head))
        self._sample: Any = np.frombuffer(self._map, dtype=_SAMPLE, count=1, offset=at)[0]
        at += _SAMPLE.itemsize
        self._given: Integers = np.frombuffer(self._map, dtype="<i8", count=len(self.sizes), offset=at)
        at += self._given.nbytes
        self._values: Floats = np.frombuffer(self._map, dtype="<f8", count=count, offset=at)
        at += self._values.nbytes
        self._used: Integers = np.frombuffer(self._map, dtype="<i8", count=1, offset=at)
        self._uses: NDArray[Any] = np.frombuffer(self._map, dtype=USE, count=_MOST_USES, offset=at + 8)
        self._writing = threading.Lock()

    @classmethod
    def create(cls, path: Path, inputs: Mapping[str, int], ages: Sequence[str] = ()) -> "SharedInputs":
        """Make the file.

        Args:
            path: where it is to be.
            inputs: how many entries each input has, by its name.
            ages: names of inputs that are to be how old the sample is, s; nobody sets them.

        Raises:
            OSError: it cannot be made.
        """
        head = json.dumps({"inputs": dict(inputs), "ages": list(ages)}).encode() + b"\n"
        numbers = len(inputs) + sum(inputs.values()) + 1
        with open(path, "wb") as file:
            file.write(head)
            file.truncate(_aligned(len(head)) + _SAMPLE.itemsize + 8 * numbers + _MOST_USES * USE.itemsize)
        return cls(path)

    def set(self, entries: Mapping[str, float | Sequence[float] | NDArray[Any]], stamp: float) -> int:
        """Write a sample, of some or all inputs; return its number, from 1.

        Args:
            entries: by the inputs' names, in row-major order, in the inputs' units; a truth value is 0 or 1.
            stamp: when the device saw that, s of the monotonic clock.

        Raises:
            UnknownInput: there is no such input.
            ValueError: a value is of another size, or it or the stamp is not finite.
        """
        given = {name: self._entries_of(name, value) for name, value in entries.items()}
        if not math.isfinite(stamp):
            raise ValueError(f"the stamp must be finite, not {stamp}")
        with self._writing:
            begun = max(int(self._sample["begun"]), int(self._sample["ended"])) + 1
            self._sample["begun"] = begun
            at = 0
            for k, (name, size) in enumerate(self.sizes.items()):
                if name in given:
                    self._given[k] = 1
                    self._values[at : at + size] = given[name]
                at += size
            self._sample["stamp"] = stamp
            self._sample["check"] = self._checksum(begun, stamp, self._given, self._values)
            self._sample["ended"] = begun
        return begun

    def sources(self) -> dict[str, ExternalSource]:
        """Return who gives the values of each input, and of the ages, to the run's `System.external`.

        All take one sample, at the first question at a time.
        """
        reader, at = _SampleReader(self), 0
        sources: dict[str, ExternalSource] = {}
        for k, (name, size) in enumerate(self.sizes.items()):
            sources[name] = _OfSample(reader, k, slice(at, at + size))
            at += size
        return {**sources, **{name: _AgeOfSample(reader) for name in self._age_of}}

    def uses(self) -> NDArray[Any]:
        """Return which samples the run has used, oldest first, of dtype `USE`; of a long run, the last ones."""
        used = int(self._used[0])
        first = 0 if used <= _MOST_USES else used - _MOST_USES + _GUARD
        return self._uses[np.arange(first, used) % _MOST_USES]

    def ages(self) -> Floats:
        """Return how old the samples were as the run used them, s."""
        uses = self.uses()
        return np.maximum(0.0, uses["at"] - uses["stamp"])

    def read(self) -> tuple[int, float, Integers, Floats] | None:
        """Return number, stamp, which inputs were given, and all entries; None if none can be read whole."""
        for _ in range(_TRIES):
            number = int(self._sample["ended"])
            if number == 0:
                return None
            stamp, check = float(self._sample["stamp"]), int(self._sample["check"])
            given, values = np.array(self._given), np.array(self._values)
            if int(self._sample["begun"]) == number and check == self._checksum(number, stamp, given, values):
                return number, stamp, given, values
        return None

    def note_use(self, t: float, number: int, stamp: float, at: float) -> None:
        """Write down which sample the run used."""
        used = int(self._used[0])
        self._uses[used % _MOST_USES] = (t, number, stamp, at)
        self._used[0] = used + 1

    def close(self) -> None:
        """Release the file."""
        self._sample = np.zeros(1, dtype=_SAMPLE)[0]
        self._given, self._used = np.zeros(len(self.sizes), dtype=np.int64), np.zeros(1, dtype=np.int64)
        self._values, self._uses = np.zeros(len(self._values)), np.zeros(_MOST_USES, dtype=USE)
        with contextlib.suppress(BufferError):
            self._map.close()

    def _entries_of(self, name: str, value: Any) -> Floats:
        if name not in self.sizes:
            raise UnknownInput(f"no input {name!r}: {nearest(name, self.sizes)}")
        entries = np.asarray(value, dtype=np.float64).ravel()
        if len(entries) != self.sizes[name]:
            raise ValueError(f"{name} takes {self.sizes[name]} values, not {len(entries)}")
        if not np.isfinite(entries).all():
            raise ValueError(f"{name} must be finite, not {entries.tolist()}")
        return entries

    @staticmethod
    def _checksum(number: int, stamp: float, given: Integers, values: Floats) -> int:
        return zlib.crc32(np.array([number, stamp]).tobytes() + given.tobytes() + values.tobytes())


class _SampleReader:
    """Takes a sample at each new time, and notes its use."""

    def __init__(self, inputs: SharedInputs) -> None:
        self._inputs = inputs
        self._asked: float | None = None
        self._number, self._stamp = 0, -math.inf
        self.age = NEVER
        self.given: Integers = np.zeros(len(inputs.sizes), dtype=np.int64)
        self.values: Floats = np.zeros(0)

    def take(self, t: float) -> None:
        """Take the newest sample for the time t, s, unless that was done; the one before it holds if none is whole."""
        if t == self._asked:
            return
        self._asked = t
        sample = self._inputs.read()
        if sample is not None:
            self._number, self._stamp, self.given, self.values = sample
        at = time.monotonic()
        if self._number == 0:
            return
        self.age = min(max(0.0, at - self._stamp), NEVER)
        self._inputs.note_use(t, self._number, self._stamp, at)


class _OfSample:
    """Gives an input of the newest sample."""

    def __init__(self, reader: _SampleReader, k: int, place: slice) -> None:
        self._reader, self._k, self._place = reader, k, place

    def at(self, t: float) -> Floats | None:
        """Return the entries for the communication point at t, s; None if they were never set."""
        self._reader.take(t)
        return self._reader.values[self._place] if self._reader.given[self._k] else None


class _AgeOfSample:
    """Gives how old the newest sample is."""

    def __init__(self, reader: _SampleReader) -> None:
        self._reader = reader

    def at(self, t: float) -> list[float]:
        """Return the age at the communication point at t, s; `NEVER` if no sample ever came."""
        self._reader.take(t)
        return [self._reader.age]


def _aligned(size: int) -> int:
    return -(-size // 8) * 8
