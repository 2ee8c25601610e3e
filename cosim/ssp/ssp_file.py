"""An SSP as a system that the master runs."""

import tempfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType

from handover.cosim.exceptions import InvalidFmu, InvalidSsp, WiringError
from handover.cosim.fmu.description import FmuDescription, describe_fmu
from handover.cosim.ssp.archive import SspArchive
from handover.cosim.ssp.connected_ports import find_entry, taken_apart
from handover.cosim.ssp.flattening import FlatSystem, components_of, flatten
from handover.cosim.ssp.given_values import start_values
from handover.cosim.ssp.grouping import Grouping
from handover.cosim.ssp.structure_reading import read_structure
from handover.cosim.system.system import System

_MOST_DENOMINATOR = 10**6


class SspFile:
    """A System Structure and Parameterization file, version 1.0 or 2.0, of co-simulation FMUs. A context manager.

    Systems within systems are taken apart: their units are named `system.unit`. Its FMUs lie in a temporary folder
    until it is closed, so `system` is to be run before.

    Not supported, and refused: signal dictionaries, components that are SSPs, mappings of booleans, integers or
    enumerations, connected parameters, single entries of FMI 3 arrays, clocks, files outside of the archive.

    Args:
        path: the file.
        step: communication step of all units, s; without it each has the one that its FMU proposes, or that an
            annotation of `write_ssp` tells.

    Attributes:
        name: the system's name.
        system: the system, checked.
        stop: the stop time of its default experiment, s, if it has one.

    Raises:
        InvalidSsp: with what is wrong with it.
    """

    def __init__(self, path: Path, step: Fraction | None = None) -> None:
        archive = SspArchive(path)
        structure = read_structure(archive)
        self.path, self.name = path, structure.name
        self.stop = None if structure.stop is None else _exact(structure.stop)
        self._folder = tempfile.TemporaryDirectory(prefix="handover-ssp-", ignore_cleanup_errors=True)
        try:
            archive.unpack(Path(self._folder.name))
            descriptions = self._describe({n: c.member for n, c in components_of(structure.system)})
            self.system = self._build(flatten(structure.system, descriptions), descriptions, step)
        except BaseException:
            self.close()
            raise

    @property
    def folder(self) -> Path:
        """Where its FMUs are unpacked until it is closed."""
        return Path(self._folder.name)

    def close(self) -> None:
        """Remove the unpacked FMUs."""
        self._folder.cleanup()

    def __enter__(self) -> "SspFile":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _describe(self, members: dict[str, str]) -> dict[str, FmuDescription]:
        if not members:
            raise InvalidSsp(self.path, ["there is no component in its system"])
        described: dict[str, FmuDescription] = {}
        for member in dict.fromkeys(members.values()):
            try:
                described[member] = describe_fmu(Path(self._folder.name) / member)
            except InvalidFmu as e:
                raise InvalidSsp(self.path, [f"{member}: {e.fault}"]) from e
        return {name: described[member] for name, member in members.items()}

    def _build(self, flat: FlatSystem, descriptions: dict[str, FmuDescription], step: Fraction | None) -> System:
        faults = list(flat.faults)
        starts, partly = dict[str, dict[str, object]](), dict[str, set[str]]()
        for unit, given in flat.given.items():
            ports = {**descriptions[unit].parameters, **descriptions[unit].inputs}
            found = {name: (entry, g) for name, g in given.items() if (entry := find_entry(ports, name)) is not None}
            starts[unit], partly[unit], wrong = start_values(found)
            faults += wrong
        grouping = Grouping(flat.connections, descriptions, partly)
        faults += grouping.faults
        if faults:
            raise InvalidSsp(self.path, faults)
        system = System()
        for name, component in flat.components.items():
            path = Path(self._folder.name) / component.member
            unit = system.add(name, path, period=step or component.period, sampled=component.sampled)
            parted = taken_apart(descriptions[name], grouping.apart.get(name, ()))
            system.units[name] = replace(unit, description=parted, start=starts.get(name, {}))
        for source, target, linear in grouping.wires:
            system.connect(source, target, linear)
        try:
            system.check()
        except WiringError as e:
            raise InvalidSsp(self.path, e.faults) from e
        return system


def _exact(seconds: float) -> Fraction:
    """Return a time as the fraction meant, such as 1/3 for 0.3333333333333333."""
    near = Fraction(seconds).limit_denominator(_MOST_DENOMINATOR)
    return near if float(near) == seconds else Fraction(repr(seconds))
