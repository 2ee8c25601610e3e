"""Units as they are placed in a system, connections, and their ends by name: a port, or all of one side."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, NoReturn

from handover.cosim.blocks.variable import Causality
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.file.description import FmuDescription
from handover.cosim.system.conversion import LinearTransformation

BY_ENTRIES = "arrays are connected as a whole; to connect entries, put a block of yours between the two that gives them"


@dataclass(frozen=True)
class PortName:
    """One end of a connection: a port of a unit in a system, or one of its terminals. It has no entries.

    `system` is the number of the system whose unit it was taken from; None where it was made by names alone.
    """

    unit: str
    port: str
    system: int | None = field(default=None, compare=False, repr=False, kw_only=True)

    def __str__(self) -> str:
        return f"{self.unit}.{self.port}"

    def __getitem__(self, index: object) -> NoReturn:
        """Raise TypeError, which says how entries of arrays are connected."""
        raise TypeError(f"{self}[{index!r}]: {BY_ENTRIES}")


@dataclass(frozen=True)
class Connection:
    """An output that feeds an input.

    Real values are converted to the input's unit; a `transformation` replaces that.
    """

    source: PortName
    target: PortName
    transformation: LinearTransformation | None = None


class PortNames:
    """Makes names of ports and terminals by attribute or key: `arm.y.p_WG`, `arm.y["any name"]`.

    `System.check` checks whether there is such a one. By itself it stands for all inputs, or all outputs, of its unit:
    `System.connect(arm.y, camera.u)`.
    """

    def __init__(self, unit: str, causality: Causality, system: int | None = None) -> None:
        self._unit = unit
        self._causality = causality
        self._system = system

    def __getattr__(self, port: str) -> PortName:
        if port.startswith("__"):
            raise AttributeError(port)
        return PortName(self._unit, port, system=self._system)

    def __getitem__(self, port: str) -> PortName:
        return PortName(self._unit, port, system=self._system)

    def __repr__(self) -> str:
        return f"{self._unit}.{'y' if self._causality is Causality.OUTPUT else 'u'}"


@dataclass(frozen=True)
class PlacedUnit:
    """A unit of a system: its FMU's description, its start values, and its communication step in seconds.

    A sampled unit computes its outputs from the inputs at the instant at which a step begins. `system` is the
    number of the system that it was added to.
    """

    name: str
    description: FmuDescription
    start: Mapping[str, Any]
    period: Fraction
    sampled: bool
    system: int | None = field(default=None, compare=False, repr=False)

    @property
    def uses_events(self) -> bool:
        """Whether it runs in event mode, in which clocks tick and steps end at events.

        A sampled unit does without: it ticks by itself, see `FmuDescription`.
        """
        return self.description.capabilities.event_mode and not self.sampled

    @property
    def u(self) -> PortNames:
        """Its inputs, by attribute."""
        return PortNames(self.name, Causality.INPUT, self.system)

    @property
    def y(self) -> PortNames:
        """Its outputs, by attribute."""
        return PortNames(self.name, Causality.OUTPUT, self.system)

    def _repr_html_(self) -> str:
        from handover.cosim.fmu.file.port_table import description_html  # of notebooks alone

        return description_html(self.description)


def check_end(end: Any, ports: str, units: Mapping[str, PlacedUnit], system: int) -> None:
    """Check an end of a connection: a port, or all outputs or inputs of a unit.

    Args:
        end: of which is checked what it is.
        ports: `y` or `u`, what it should be of.
        units: those of the system, by name.
        system: its number.

    Raises:
        TypeError: it is something else.
        ValueError: it is of another system, or all of a unit that the system does not have.
    """
    if isinstance(end, PlacedUnit):
        right = f"{end.name}.{ports}, or {end.name}.{ports}.NAME for one port"
        raise TypeError(f"{end.name} is a unit, and its ports are connected: give {right}")
    if isinstance(end, PortNames):
        if (unit := vars(end)["_unit"]) not in units:
            raise ValueError(f"{end!r}: this system has no unit {unit!r}; {nearest(unit, units)}")
        _check_system(end, vars(end)["_system"], units[unit], system)
    else:
        check_port(end, f"unit.{ports}.NAME", units, system)


def check_port(end: Any, right: str, units: Mapping[str, PlacedUnit], system: int) -> None:
    """Check that an end is a port; `right` is what would be, the others are as of `check_end`.

    Raises:
        TypeError: it is something else.
        ValueError: it is of another system.
    """
    if not isinstance(end, PortName):
        raise TypeError(f"{end!r:.60} is not a port: give {right} of what add returned")
    _check_system(end, end.system, units.get(end.unit), system)


def _check_system(end: PortName | PortNames, given: int | None, unit: PlacedUnit | None, system: int) -> None:
    """Check that an end is of a system's own unit, of one that it was copied with, or made by its name alone."""
    if given not in (None, system if unit is None else unit.system):
        raise ValueError(f"{end!s} is of another System: give the port of what this system's add returned")


def unit_of(ports: PortNames, causality: Causality) -> str:
    """Return the unit whose ports of a causality these are.

    Raises:
        TypeError: they are something else.
    """
    if not isinstance(ports, PortNames):  # type: ignore
        raise TypeError(
            f"{ports} is one port or terminal, and the other end all of a unit: connect UNIT.y with UNIT.u, or "
            "UNIT.y.NAME with UNIT.u.NAME"
        )
    unit, own = vars(ports)["_unit"], vars(ports)["_causality"]
    if own is not causality:
        wanted = f"{unit}.{'y' if causality is Causality.OUTPUT else 'u'}"
        raise TypeError(f"{ports!r} are its {own.value}s: what feeds stands first; did you mean {wanted}?")
    return unit


def ambiguity(target: PortName, sources: Collection[PortName]) -> str:
    """Return that several outputs match an input, and how to choose."""
    *others, last = sorted(f"{s.unit}.y.{s.port}" for s in sources)
    by = " by name" if all(s.port == target.port for s in sources) else ""
    return (
        f"{target}: {', '.join(others)} and {last} match it{by}; connect the one that is meant: "
        f"connect({others[0]}, {target.unit}.u.{target.port})"
    )
