"""Transfers of values from outputs of loaded units to the inputs that they feed: checks, copies, linear conversions.

Before a unit's inputs are set, its `Feeding` fills its buffers; after its outputs are fetched, its `FiniteCheck` finds
NaN and infinity in those that feed others.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Kind, indices_of
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.buffers import Copy, Views, joined
from handover.cosim.fmu.failures import NotFinite
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.instance import Instance
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import TimeSeries

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Narrowing:
    """An integer output that feeds a narrower input: copied, a number that does not fit would lose its upper bits.

    Attributes:
        source: the output, `unit.port`.
        unit, port: the input.
        values: the output's values, as they are.
    """

    source: str
    unit: str
    port: str
    width: Width
    values: NDArray[Any]

    def check(self, t: float) -> None:
        """Check that all values fit the input.

        Raises:
            UnitFailure: one does not.
        """
        for number in self.values.tolist():
            if not self.width.holds(number):
                fault = f"{self.source} is {number}, which does not fit {self.width.range_text}"
                raise UnitFailure(self.unit, f"setting {self.port}", t, "Error", (fault,))


def narrows(output: FmuPort, width: Width) -> bool:
    """Return whether an integer output can have values that do not fit the width of the input which it feeds."""
    own = output.width
    return (
        output.kind is Kind.INTEGER and own is not None and not (width.holds(own.lowest) and width.holds(own.highest))
    )


class ScaledCopy:
    """Writes factor * source + offset to a target, entry by entry.

    The product is rounded to a double before the offset, also of 0, is added, and the sum once more if the target is
    narrower: whoever does the same in C must keep the compiler from fusing the two operations.
    """

    def __init__(self, target: NDArray[Any], source: NDArray[Any], linear: LinearTransformation) -> None:
        self.target, self.source, self.linear = target, source, linear
        self._between: NDArray[np.float64] = np.empty(len(source))

    def __call__(self) -> None:
        """Write the target."""
        np.multiply(self.source, self.linear.factor, out=self._between, dtype=np.float64)
        np.add(self._between, self.linear.offset, out=self._between)
        self.target[...] = self._between


class FiniteCheck:
    """Checks the connected real outputs of one unit.

    Args:
        unit: the instance.
        fmi: version of its standard.
        views: where its outputs lie.
        read: its connected outputs, with the inputs that each feeds as `unit.port`.
    """

    def __init__(
        self, unit: str, fmi: int, views: Mapping[str, Views], read: Mapping[str, tuple[FmuPort, Sequence[str]]]
    ) -> None:
        self._unit, self._fmi = unit, fmi
        real = [(port, readers) for port, readers in read.values() if port.kind is Kind.REAL]
        self._ports = [(port, views[port.name][0], readers) for port, readers in real]
        self.blocks: list[NDArray[Any]] = [block for block, _ in joined((v, v) for _, v, _ in self._ports)]
        """The values, as few contiguous arrays."""

    def __call__(self, t: float, log: Sequence[str] = ()) -> None:
        """Check the values that were fetched at simulated time t in seconds.

        Raises:
            NotFinite: one is NaN or infinite.
        """
        for block in self.blocks:
            if not np.isfinite(block).all():
                failure = self.failure(t, log)
                if failure is not None:
                    raise failure

    def failure(self, t: float, log: Sequence[str] = ()) -> UnitFailure | None:
        """Return the failure for the first value that is not finite, None if all are."""
        for port, values, readers in self._ports:
            wrong = np.flatnonzero(~np.isfinite(values))
            if len(wrong):
                at = int(wrong[0])
                index, call = list(indices_of(port.shape))[at], f"fmi{self._fmi}Get{port.fmi_type}"
                return NotFinite(self._unit, call, t, port.name, index, float(values[at]), readers=readers, log=log)
        return None


class Following(NamedTuple):
    """An input that follows values over time."""

    target: NDArray[Any]
    series: TimeSeries


class Feeding(NamedTuple):
    """What happens before a unit's inputs are set: checks, then copies, then scaled copies, then values over time."""

    narrowings: Sequence[Narrowing]
    copies: Sequence[Copy]
    scaled: Sequence[ScaledCopy]
    followings: Sequence[Following] = ()

    def transfer(self, t: float) -> None:
        """Fill a unit's buffers at t.

        Raises:
            UnitFailure: a number does not fit its input.
        """
        for narrowing in self.narrowings:
            narrowing.check(t)
        for target, source in self.copies:
            target[...] = source
        for scaled in self.scaled:
            scaled()
        for target, series in self.followings:
            target[...] = series.at(t)


def feedings(system: System, instances: Mapping[str, Instance]) -> dict[str, Feeding]:
    """Return how each unit is fed; conversions of units of measure are logged."""
    changes = {c.target: change for c in system.connections if (change := system.transformation_of(c))}
    return {name: _feeding(system, instances, name, changes) for name in instances}


def finite_checks(system: System, instances: Mapping[str, Instance]) -> dict[str, FiniteCheck]:
    """Return for each unit the check of its connected outputs."""
    read: dict[str, dict[str, tuple[FmuPort, list[str]]]] = {name: {} for name in instances}
    for name in instances:
        for port, source in system.sources_of(name).items():
            output = instances[source.unit].description.outputs[source.port]
            read[source.unit].setdefault(source.port, (output, []))[1].append(f"{name}.{port}")
    return {name: FiniteCheck(name, i.description.fmi, i.y, read[name]) for name, i in instances.items()}


def _feeding(
    system: System, instances: Mapping[str, Instance], name: str, changes: Mapping[PortName, LinearTransformation]
) -> Feeding:
    instance = instances[name]
    copies: list[Copy] = []
    scaled: list[ScaledCopy] = []
    narrowings: list[Narrowing] = []
    for port, source in system.sources_of(name).items():
        other, target = instances[source.unit], instance.description.inputs[port]
        output, change = other.description.outputs[source.port], changes.get(PortName(name, port))
        if change is not None:
            scaled.append(ScaledCopy(instance.u[port][0], other.y[source.port][0], change))
            _log.info("%s (%s) -> %s.%s (%s): %s", source, output.unit, name, port, target.unit, change)
        else:
            copies += zip(instance.u[port], other.y[source.port], strict=True)
        width = target.width
        if target.kind is Kind.ENUMERATION:
            width = Width.INT32 if instance.description.fmi == 2 else Width.INT64
        if width and narrows(output, width):
            narrowings.append(Narrowing(str(source), name, port, width, other.y[source.port][0]))
    followings = [Following(instance.u[e.port][0], series) for e, series in system.followed.items() if e.unit == name]
    return Feeding(narrowings, joined(copies), scaled, followings)
