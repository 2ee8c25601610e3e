"""Camera pictures of a run under way, in a memory-mapped file: the run puts a few a second there where a page asks.

A record holds no pictures, so a live page cannot take them from there. The run copies their pixels, which takes some
tenths of a millisecond each, and nothing where no page asks; the page's server compresses them.
"""

import json
import mmap
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Raster
from handover.cosim.system.signals import Signals

PERIOD = 0.3
"""Least wall time between two moments whose pictures are shown, s."""
_STATE = np.dtype([("asked", "<i8"), ("ended", "<i8"), ("t", "<f8")])
_ALIGNED = 8

Pixels = NDArray[np.uint8]


class PictureWriter:
    """Observes a run, and puts its pictures at the newest communication point into the file when they were asked for.

    Args:
        path: where the file is to be, once the first point is seen; a run without pictures makes none.
        clock: wall time, s.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._path, self._clock = path, clock
        self._rasters: Mapping[str, Raster] | None = None
        self._state: Any = None
        self._places: dict[str, Pixels] = {}
        self._next = 0.0

    def __call__(self, t: float, signals: Signals) -> None:
        """Write the pictures of the time t, s, if somebody wants to see them."""
        if self._rasters is None:
            self._rasters = signals.rasters()
            if self._rasters:
                self._create(self._rasters)
        state: Any = self._state
        if state is None or state["asked"] <= state["ended"] or self._clock() < self._next:
            return
        self._next = self._clock() + PERIOD
        for name, place in self._places.items():
            pixels = signals[name]
            if pixels.size == place.size:  # a camera may have given nothing yet
                place[...] = pixels.ravel()
        state["t"] = t
        state["ended"] = state["asked"]  # until then the page waits, and asks for no others

    def _create(self, rasters: Mapping[str, Raster]) -> None:
        head = json.dumps({name: [r.width, r.height] for name, r in rasters.items()}).encode() + b"\n"
        unfinished = self._path.with_name(self._path.name + ".part")
        with open(unfinished, "w+b") as file:
            file.write(head)
            file.truncate(_after(head) + _STATE.itemsize + sum(r.size for r in rasters.values()))
            self._state, self._places = _arrays(mmap.mmap(file.fileno(), 0), head, rasters)
        os.replace(unfinished, self._path)


class Seen(NamedTuple):
    """Pictures of one moment: simulated time, s, and pixels (height, width, 3), blue green red, by signal."""

    t: float
    pictures: Mapping[str, Pixels]


class PictureReader:
    """Reads the file of a run under way.

    Args:
        path: the file, which need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._rasters: dict[str, Raster] = {}
        self._state: Any = None
        self._places: dict[str, Pixels] = {}

    def take(self) -> Seen | None:
        """Return the pictures that were asked for last, and ask for the next ones; None while they are not there."""
        if self._state is None:
            self._open()
        state: Any = self._state
        if state is None or state["asked"] > state["ended"]:
            return None
        rasters = self._rasters
        taken = {name: np.array(p).reshape(rasters[name].height, -1, 3) for name, p in self._places.items()}
        seen = Seen(float(state["t"]), taken) if int(state["ended"]) else None
        state["asked"] = state["ended"] + 1
        return seen

    def _open(self) -> None:
        if not self._path.is_file():
            return
        with open(self._path, "r+b") as file:
            mapped = mmap.mmap(file.fileno(), 0)
        head = mapped.readline()
        self._rasters = {name: Raster(*size) for name, size in json.loads(head).items()}
        self._state, self._places = _arrays(mapped, head, self._rasters)


def _arrays(mapped: mmap.mmap, head: bytes, rasters: Mapping[str, Raster]) -> tuple[Any, dict[str, Pixels]]:
    at = _after(head)
    state: Any = np.frombuffer(mapped, dtype=_STATE, count=1, offset=at)[0]
    at += _STATE.itemsize
    places: dict[str, Pixels] = {}
    for name, raster in rasters.items():
        places[name] = np.frombuffer(mapped, dtype=np.uint8, count=raster.size, offset=at)
        at += raster.size
    return state, places


def _after(head: bytes) -> int:
    return -(-len(head) // _ALIGNED) * _ALIGNED
