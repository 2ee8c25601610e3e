"""The outputs of a running system by name, `signals["arm.p_WG"]`, and the observers that see them.

Flattened to scalars, outputs are the columns of a record. An observer is called at every communication point; one of a
run that resumes from a checkpoint has seen the first of them already, see `ObserveAfter`.
"""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Raster
from handover.cosim.blocks.variable import Kind, indices_of, subscript
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.buffers import Views
from handover.cosim.fmu.file.description import FmuPort


@dataclass(frozen=True)
class Column:
    """A scalar signal: its name in a record (`arm.p_WG[1]`, counted from 1 as in FMI), and where its value lives."""

    name: str
    port: FmuPort
    values: NDArray[Any]
    index: int


class Signals:
    """Live values of all outputs; `columns` are views that change as the system steps, so copy what is kept."""

    def __init__(
        self, outputs: Mapping[str, Mapping[str, Views]], ports: Mapping[str, Mapping[str, FmuPort]], owner: object
    ) -> None:
        self._owner = owner  # keeps the memory alive to which the addresses of pictures and strings point
        self._views = {f"{unit}.{port}": views for unit, ys in outputs.items() for port, views in ys.items()}
        self._ports = {f"{unit}.{name}": p for unit, ps in ports.items() for name, p in ps.items()}
        self._numbers: dict[str, NDArray[Any]] = {
            name: self._views[name][0].reshape(port.shape)  # a view, too
            for name, port in self._ports.items()
            if port.kind not in (Kind.BINARY, Kind.STRING)
        }

    def __contains__(self, name: object) -> bool:
        """Return whether there is an output of this name."""
        return name in self._views

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a copy of a signal's value in its shape.

        A picture or other binary is an array of bytes, and an array of binaries one of such arrays. A text is a
        `numpy.str_`, which is a `str`, and an array of texts an array of these.

        Raises:
            KeyError: there is no such output.
        """
        number = self._numbers.get(name)
        if number is not None:
            return np.array(number)
        views, port = self._of(name)
        if port.kind is Kind.STRING:
            texts: Any = np.array([_text(int(a)) for a in views[0]]).reshape(port.shape)
            return texts[()]  # of an array without dimensions, its text
        found = [_bytes(int(a), int(size)) for a, size in zip(*views, strict=True)]
        if not port.shape:
            return found[0]
        binaries = np.empty(len(found), dtype=object)
        for i, binary in enumerate(found):
            binaries[i] = binary
        return binaries.reshape(port.shape)

    def plain(self, name: str) -> Any:
        """Return what `signals[name].tolist()` does, a number of Python or a list of such, in less time.

        Raises:
            KeyError: there is no such output.
        """
        number = self._numbers.get(name)
        return self[name].tolist() if number is None else number.tolist()

    def text(self, name: str) -> str:
        """Return a string signal's text, or the name of an enumeration signal's item; of an array, the first.

        Raises:
            KeyError: there is no such output.
        """
        views, port = self._of(name)
        if port.kind is Kind.STRING:
            return _text(int(views[0][0]))
        return {v: n for n, v in port.items}.get(int(views[0][0]), str(views[0][0]))

    def rasters(self) -> dict[str, Raster]:
        """Return which signals are single pictures, and of which size."""
        found = {name: Raster.of_mime(port.mime) for name, port in self._ports.items() if not port.shape}
        return {name: raster for name, raster in found.items() if raster is not None}

    def columns(self) -> list[Column]:
        """Return all real, integer, boolean and enumeration outputs as scalars."""
        columns: list[Column] = []
        for name, port in self._ports.items():
            if port.kind in (Kind.BINARY, Kind.STRING):
                continue
            values = self._views[name][0]
            columns += [Column(name + subscript(x), port, values, i) for i, x in enumerate(indices_of(port.shape))]
        return columns

    def _of(self, name: str) -> tuple[Views, FmuPort]:
        if name not in self._views:
            raise KeyError(f"no output {name!r}; {nearest(name, self._views)}")
        return self._views[name], self._ports[name]


def _text(address: int) -> str:
    """Return a unit's text; bytes that are not UTF-8, which the standards ask for, are shown as replacements."""
    return ctypes.string_at(address).decode(errors="replace") if address else ""


def _bytes(address: int, size: int) -> "NDArray[np.uint8]":
    return np.frombuffer(ctypes.string_at(address, size) if size else b"", dtype=np.uint8)


Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time in seconds and the signals that hold at that time."""


@dataclass(frozen=True)
class ObserveAfter:
    """An observer of a run that resumes at t_0 seconds: `observe` saw that point before, and is called from then on."""

    t_0: float
    observe: Observer

    def __call__(self, t: float, signals: Signals) -> None:
        """Call `observe`, unless it has seen this point."""
        if t > self.t_0:
            self.observe(t, signals)
