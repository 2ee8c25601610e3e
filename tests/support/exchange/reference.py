"""How a unit behaves alone in our own master: what every foreign host must reproduce."""

import functools
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.variable import Kind, Variable
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PortName, System
from handover.fmus.build import build_block, cached
from handover.fmus.catalog import UNITS, import_class
from support.exchange import drive

TOLERANCE = 1e-12
"""Absolute for values up to 1, relative beyond."""

ARITHMETIC = {name: value for name, value in os.environ.items() if name.startswith("OPENBLAS_")}
"""What of the environment a host with one of its own must have besides: other kernels of OpenBLAS round otherwise."""

FMI2_UNITS = [n for n in UNITS if n not in ("StereoCamera", "HandoverVision")]
"""FMI 2 knows no pictures."""


@dataclass(frozen=True)
class Record:
    """Outputs at every communication point, the first after initialisation.

    Attributes:
        rows: scalar outputs (real, integer, boolean, enumeration) by name.
        pictures: binary outputs by name.
    """

    rows: Sequence[Mapping[str, float]]
    pictures: Sequence[Mapping[str, bytes]]

    @property
    def table(self) -> NDArray[np.float64]:
        """Rows as an array, columns in order of their names."""
        return np.array([[row[name] for name in sorted(row)] for row in self.rows])

    def without(self, names: Sequence[str]) -> "Record":
        """Return the record without some scalar outputs."""
        return Record([{n: value for n, value in row.items() if n not in names} for row in self.rows], self.pictures)

    def is_like(self, other: "Record") -> bool:
        """Return whether two records agree within TOLERANCE, and their pictures byte by byte."""
        a, b = self.table, other.table
        same = a.shape == b.shape and np.allclose(a, b, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
        return same and list(self.pictures) == list(other.pictures)


def expect_same(found: Sequence[Mapping[str, float]], wanted: Record, first: int = 0) -> None:
    """Assert that a host's rows, from communication point `first` on, are those of our own master."""
    assert len(found) == len(wanted.rows) - first
    for k, (row, right) in enumerate(zip(found, wanted.rows[first:], strict=True), first):
        assert row.keys() == right.keys()
        off = {n: (row[n], right[n]) for n in right if not abs(row[n] - right[n]) <= TOLERANCE * max(1, abs(right[n]))}
        off = {n: pair for n, pair in off.items() if not np.isnan(pair).all()}
        assert not off, f"at communication point {k} (host, own master): {off}"


def description(unit: str) -> Description:
    """Return what a unit's block declares."""
    return describe(import_class(UNITS[unit].block))


def variables(unit: str) -> dict[str, Variable]:
    """Return all that a unit's block declares, by name."""
    return {v.name: v for v in description(unit).variables}


class References:
    """Runs of single units in our own master, each made once.

    Args:
        folder: where the units are kept that play inputs.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._played = functools.cache(self._run_played)
        self._held = functools.cache(self._run_held)

    def varying(self, unit: str, fmi: int) -> Record:
        """Return the run in which step k is made with `drive.inputs(..., k)`, also set before the initialisation."""
        return self._played(unit, fmi) if description(unit).inputs else self._held(unit, fmi, True)

    def held(self, unit: str, fmi: int) -> Record:
        """Return the run in which the inputs of step 0 hold all the time."""
        return self._held(unit, fmi, True)

    def untouched(self, unit: str, fmi: int) -> Record:
        """Return the run with nothing set."""
        return self._held(unit, fmi, False)

    def _run_held(self, unit: str, fmi: int, is_driven: bool) -> Record:
        d, system = description(unit), System()
        start = {**drive.parameters(d), **drive.inputs(d, 0)} if is_driven else {}
        pictures = {v.name for v in d.inputs if v.kind is Kind.BINARY}
        start = {n: v.tobytes() if n in pictures else v for n, v in start.items()}
        system.add("unit", cached(unit, fmi), period=UNITS[unit].step, **start)
        return _run(system, unit)

    def varying_in(self, unit: str, fmu: Path) -> Record:
        """Return the like run of another form of the unit."""
        return _run(self.played(unit, fmu), unit)

    def played(self, unit: str, fmu: Path) -> System:
        """Return a system of the unit, with its parameters, and of another one that plays its inputs."""
        d, entry, system = description(unit), UNITS[unit], System()
        if d.inputs:
            system.add("player", self._player(unit), period=entry.step)
        system.add("unit", fmu, period=entry.step, **drive.parameters(d))
        for v in d.inputs:
            system.connect(PortName("player", v.name), PortName("unit", v.name))
        return system

    def _run_played(self, unit: str, fmi: int) -> Record:
        return self.varying_in(unit, cached(unit, fmi))

    def _player(self, unit: str) -> Path:
        module, _, block = UNITS[unit].block.partition(":")
        source = self._folder / f"play_{unit}.py"
        lines = [
            "from support.exchange.player import player",
            f"from {module} import {block}",
            f"Player = player({block}, {unit!r})",
        ]
        source.write_text("\n".join(lines) + "\n")
        if str(self._folder) not in sys.path:
            sys.path.append(str(self._folder))
        return build_block(f"{source.stem}:Player", 3, self._folder, step=UNITS[unit].step, name=source.stem)


def _run(system: System, unit: str) -> Record:
    rows: list[Mapping[str, float]] = []
    pictures: list[Mapping[str, bytes]] = []
    outputs = describe_fmu(system.units["unit"].description.path).outputs
    binaries = [name for name, port in outputs.items() if port.kind is Kind.BINARY]

    def observe(_: float, signals: Signals) -> None:
        columns = [c for c in signals.columns() if c.name.startswith("unit.")]
        rows.append({c.name.removeprefix("unit."): float(c.values[c.index]) for c in columns})
        pictures.append({name: signals[f"unit.{name}"].tobytes() for name in binaries})

    with Master(
        system, MasterOptions(algorithm=Algorithm.JACOBI)
    ) as master:  # step k takes the inputs that hold at its start
        master.run(drive.STEPS * UNITS[unit].step, [observe])
    return Record(rows, pictures)
