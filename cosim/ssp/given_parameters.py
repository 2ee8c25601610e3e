"""Parameters of an SSP that a call gives besides the file: which there are, and values for them from texts.

They are the parameters of components, by the component's path (`arm.joint.k`), and connectors of kind `parameter` of
systems: those of the outermost by their own names, those of nested ones by the system's path. A value is in the unit of
the FMU's variable, or of the system's connector, and comes before all that the file binds.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handover.cosim.blocks.units import UNKNOWN
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import MOST_FAULTS, nearest
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.ssp.connected_ports import Entry, find_entry, unfed
from handover.cosim.ssp.parameter_set import SspValue
from handover.cosim.ssp.start_values import Given
from handover.cosim.ssp.structure import SspComponent, SspConnector, SspNestedSystem

_TYPES = {Kind.REAL: "Real", Kind.INTEGER: "Integer", Kind.BOOLEAN: "Boolean", Kind.STRING: "String"}
_KIND_OF_TYPE = {"String": Kind.STRING, "Boolean": Kind.BOOLEAN, "Enumeration": Kind.STRING, "Binary": Kind.BINARY}


@dataclass(frozen=True)
class SettableParameter:
    """A parameter that can be given: a component's variable, or a connector of a system.

    Attributes:
        path: of the component or the system; empty for the outermost system.
        name: of the variable or the connector.
        declared: the variable; None for a connector.
    """

    path: str
    name: str
    declared: FmuPort | SspConnector

    @property
    def full_name(self) -> str:
        """The name by which it is given."""
        return f"{self.path}.{self.name}" if self.path else self.name

    def value(self, text: str) -> SspValue:
        """Return a value from its text; of arrays, values stand with commas between them."""
        if isinstance(self.declared, SspConnector):
            type_name = self.declared.type_name or "Real"
            return SspValue(type_name, _parts(type_name, text), UNKNOWN, f"{self.full_name} = {text[:40]!r}: ")
        whole = text.strip().lstrip("+-").isdigit()
        of_enumeration = "Integer" if whole else "Enumeration"
        type_name = {**_TYPES, Kind.ENUMERATION: of_enumeration, Kind.BINARY: "Binary"}[self.declared.kind]
        return SspValue(type_name, _parts(type_name, text), UNKNOWN, f"{self.path}.")

    def described(self, value: Any) -> FmuPort:
        """Return its declaration under its full name, with the value from which it starts, None if that is unknown."""
        start = None if value is None else _text_of(value)
        d = self.declared
        if isinstance(d, FmuPort):
            return replace(d, name=self.full_name, start=d.start if start is None else start)
        whole = Kind.INTEGER if "Int" in d.type_name else Kind.REAL
        kind = _KIND_OF_TYPE.get(d.type_name, whole)
        return FmuPort(
            name=self.full_name,
            kind=kind,
            causality=Causality.PARAMETER,
            description="parameter of the system",
            unit=d.unit,
            fmi_type=d.type_name,
            references=(),
            start=start,
        )


def settable_parameters(
    system: SspNestedSystem, descriptions: Mapping[str, FmuDescription], path: str = ""
) -> Iterator[SettableParameter]:
    """Yield the parameters of a system, of its components and of the systems in it."""
    for connector in system.connectors.values():
        if connector.kind == "parameter":
            yield SettableParameter(path, connector.name, connector)
    for element in system.elements.values():
        here = f"{path}.{element.name}" if path else element.name
        if isinstance(element, SspComponent):
            for port in descriptions[here].parameters.values():
                yield SettableParameter(here, port.name, port)
        else:
            yield from settable_parameters(element, descriptions, here)


def named_parameter(
    known: Mapping[str, SettableParameter], descriptions: Mapping[str, FmuDescription], name: str
) -> SettableParameter | None:
    """Return the parameter of a name, which is that of an entry of an array too, or of a variable; None for none."""
    return known.get(name) or _entry(descriptions, name)


def named_parameters(
    known: Mapping[str, SettableParameter], descriptions: Mapping[str, FmuDescription], texts: Mapping[str, str]
) -> tuple[dict[tuple[str, str], SspValue], list[str]]:
    """Return values by path and name of the parameters that texts name, and what is wrong with the names.

    A name such as `arm.p[1]` is a parameter by itself: that entry of an array. So is that of an output or a local
    variable whose start value can be given; these are many in some FMUs, so they are not among the known.
    """
    values: dict[tuple[str, str], SspValue] = {}
    faults: list[str] = []
    for name, text in texts.items():
        parameter = named_parameter(known, descriptions, name)
        if parameter is None:
            near = nearest(name, known) if len(faults) < MOST_FAULTS else ""
            faults.append(f"no parameter {name!r}; {near}")
        elif (array := f"{parameter.path}.{parameter.declared.name}") in texts and array != name:
            faults.append(f"{array} and {name} are both given; give the array, or entries of it")
        else:
            values[parameter.path, parameter.name] = parameter.value(text)
    return values, faults


def put(given: dict[str, Given], entry: Entry, name: str, value: SspValue) -> None:
    """Let a value replace what a component's variable was given, as a whole or by its entries.

    Args:
        given: values of the component's variables, which is changed.
        entry: the variable, and the entry that `name` stands for.
        name: as it was given.
        value: the new one.
    """
    port, index = entry
    if index is None:
        for other in port.entry_names:
            given.pop(other, None)
    elif (whole := given.pop(port.name, None)) is not None and len(whole.value.texts) == port.size:
        for other, text in zip(port.entry_names, whole.value.texts, strict=True):
            given[other] = replace(whole, value=replace(whole.value, texts=(text,)))
    given[name] = Given(value)


def _entry(descriptions: Mapping[str, FmuDescription], name: str) -> SettableParameter | None:
    """Return an entry of a component's array, or an output or local with a start value, by its name."""
    for path, d in descriptions.items():
        variable = name.removeprefix(f"{path}.")
        if variable != name and (found := find_entry(unfed(d), variable)) is not None:
            return SettableParameter(path, variable, found[0])
    return None


def _parts(type_name: str, text: str) -> tuple[str, ...]:
    """Return the texts of an array's entries, or of a single value."""
    if type_name in ("String", "Enumeration", "Binary"):
        return (text,)
    parts = tuple(part.strip() for part in text.split(","))
    return tuple(part.lower() for part in parts) if type_name == "Boolean" else parts


def _text_of(value: Any) -> str:
    """Return a start value as a model description writes it."""
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, np.ndarray):
        return " ".join(_text_of(v) for v in value.reshape(-1).tolist())
    return str(value).lower() if isinstance(value, bool) else str(value)
