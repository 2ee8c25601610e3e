"""The content of a SystemStructure.ssd: nested systems of components, their connectors, connections and parameters.

`where` is the file and line of an element, with which messages begin.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.units import Unit
from handover.cosim.ssp.parameter_set import SspValue
from handover.cosim.system.conversion import LinearTransformation


@dataclass(frozen=True)
class SspConnector:
    """A connector of a component or a system; `unit` is UNKNOWN where it names none."""

    name: str
    kind: str
    type_name: str
    unit: Unit
    where: str


@dataclass(frozen=True)
class SspEnd:
    """One end of a connection: a connector of an element, or of the enclosing system where there is no element."""

    element: str | None
    connector: str

    def __str__(self) -> str:
        return self.connector if self.element is None else f"{self.element}.{self.connector}"


@dataclass(frozen=True)
class SspConnection:
    """Two ends; the kinds of their connectors decide which one is the source. `keeps_units` forbids conversions."""

    start: SspEnd
    end: SspEnd
    linear: LinearTransformation | None
    keeps_units: bool
    where: str


@dataclass(frozen=True)
class SspElement:
    """What components and systems have in common; of two bindings of one name the later one counts."""

    name: str
    connectors: Mapping[str, SspConnector]
    bindings: tuple[Mapping[str, SspValue], ...]
    where: str


@dataclass(frozen=True)
class SspComponent(SspElement):
    """An FMU of the SSP: a member of its archive.

    Where they are annotated it has a communication step by `write_ssp` (`period`) and the one that libcosim would take
    as far as its base step allows (`hint`), in seconds.
    """

    member: str
    period: Fraction | None
    sampled: bool | None
    hint: Fraction | None = None


@dataclass(frozen=True)
class SspNestedSystem(SspElement):
    """A system: its elements by name, and connections between their connectors and its own."""

    elements: Mapping[str, "SspComponent | SspNestedSystem"]
    connections: tuple[SspConnection, ...]


@dataclass(frozen=True)
class SspStructure:
    """The whole: its name, its outermost system, and start and stop time of its default experiment, s.

    `parallel_step` is the communication step of all units where they step in parallel, if `write_ssp` annotated one.
    `step` is that of the system, as its default experiment states it or as it is annotated for OMSimulator or libcosim.
    Both are in seconds.
    `unsupported` are faults: what was left out of it; `tolerated` is what is not as it should be and does not matter.
    """

    name: str
    system: SspNestedSystem
    start: float
    stop: float | None
    parallel_step: Fraction | None = None
    step: Fraction | None = None
    unsupported: tuple[str, ...] = ()
    tolerated: tuple[str, ...] = ()
