"""What the model descriptions of FMI 2 and FMI 3 share: units, log categories, dependencies, values as text."""

import enum
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.description import Description
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind, Variable
from handover.fmus.layout import Form, Layout

GENERATOR = "handover-cosim"

LOG_CATEGORIES = {
    "logStatusError": "rejected calls and failures, with tracebacks of exceptions; logged even while logging is off",
    "logStatusWarning": "calls that succeed, but perhaps not as expected",
    "logAll": "all other messages, and the beginning and end of a run",
}
"""Descriptions of the log categories that the runtime has (runtime/log.c)."""

_MAX_STEPS = 1000
"""Of a unit's default experiment."""

_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


class AmbiguousName(ValueError):
    """Two things of one block that an FMU distinguishes by name have the same name."""

    def __init__(self, what: str, name: str) -> None:
        super().__init__(f"{what} {name!r}: something else in the block has this name; rename one of them")
        self.what, self.name = what, name


class InvalidText(ValueError):
    """A text has characters that XML cannot carry."""

    def __init__(self, where: str, text: str) -> None:
        super().__init__(f"{where}: {text!r} has control characters, which a model description cannot hold")
        self.where, self.text = where, text


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a model description is made from.

    Attributes:
        name: the unit's name, also the name of its shared library.
        step: the default communication step, in seconds.
        token: GUID of FMI 2, instantiation token of FMI 3.
        description: the block's declarations.
        layout: its variables' places.
        form: how the variables are shown; with the layout it gives the value references.
        variable_step: whether a step may have any size.
        needs_python: whether a Python must be installed where it is used.
    """

    name: str
    summary: str
    step: Fraction
    token: str
    description: Description
    layout: Layout
    form: Form
    variable_step: bool
    needs_python: bool = True


def to_xml(root: ET.Element) -> bytes:
    """Return a document as indented XML in UTF-8.

    Raises:
        InvalidText: an attribute has a character that XML cannot carry.
    """
    for element in root.iter():
        for name, value in element.attrib.items():
            if _NOT_XML.search(value):
                raise InvalidText(f"{name} of {element.get('name', element.tag)}", value)
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def number(value: float) -> str:
    """Return the shortest decimal number that is parsed as the same float64."""
    return repr(float(value))


def boolean(value: object) -> str:
    """Return `true` or `false`, as XML Schema has them."""
    return "true" if value else "false"


def bounds(variable: Variable) -> dict[str, str]:
    """Return the attributes `min` and `max`, each if it is declared and finite."""
    pairs = {"min": variable.minimum, "max": variable.maximum}
    return {
        name: number(value) if variable.kind is Kind.REAL else str(int(value))
        for name, value in pairs.items()
        if value is not None and math.isfinite(value)
    }


def add_units(root: ET.Element, variables: Iterable[Variable]) -> None:
    """Add the units in use: value in SI = factor * value + offset, with the exponents of the base units.

    Raises:
        AmbiguousName: two different units have the same symbol.
    """
    units: dict[str, Unit] = {}
    for v in variables:
        if v.kind is Kind.REAL and units.setdefault(v.unit.symbol, v.unit) != v.unit:
            raise AmbiguousName("unit", v.unit.symbol)
    if not units:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for symbol, unit in sorted(units.items()):
        base = {name: str(exponent) for name, exponent in unit.base.nonzero().items()}
        if unit.factor != 1.0:
            base["factor"] = number(unit.factor)
        if unit.offset != 0.0:
            base["offset"] = number(unit.offset)
        ET.SubElement(ET.SubElement(definitions, "Unit", name=symbol), "BaseUnit", base)


def add_log_categories(root: ET.Element) -> None:
    """Add the runtime's log categories."""
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)


def add_default_experiment(root: ET.Element, model: Model) -> None:
    """Add the start time 0, the unit's default step, and as stop time the first of its multiples from 1 s on.

    FMPy's default is 1 s: some of its versions then ask for a last step beyond, others leave the last one out. At more
    than 1,000 steps it takes longer ones, so that is the most.
    """
    steps = min(math.ceil(1 / model.step), _MAX_STEPS)
    times = {"startTime": Fraction(0), "stopTime": steps * model.step, "stepSize": model.step}
    ET.SubElement(root, "DefaultExperiment", {name: number(float(t)) for name, t in times.items()})


def enumerations(variables: Iterable[Variable]) -> list[type[enum.IntEnum]]:
    """Return the enumeration types in use, by name.

    Raises:
        AmbiguousName: two of them have the same name, or one has a variable's name, which FMI forbids.
    """
    listed = list(variables)
    names = [v.name for v in listed]
    used: dict[str, type[enum.IntEnum]] = {}
    for items in (v.enumeration for v in listed if v.enumeration):
        if used.setdefault(items.__name__, items) is not items or items.__name__ in names:
            raise AmbiguousName("enumeration", items.__name__)
    return [items for _, items in sorted(used.items())]


def variability(model: Model, variable: Variable) -> str:
    """Return a port's variability: real ports are continuous, except the outputs of a sampled block."""
    sampled_output = variable.causality.value == "output" and model.description.period is not None
    return "continuous" if variable.kind is Kind.REAL and not sampled_output else "discrete"


def initial_dependencies(model: Model, output: str) -> list[str]:
    """Return what an output depends on during initialisation: inputs with direct feedthrough to it, all parameters."""
    inputs = model.description.feedthrough.get(output, ())
    return [*inputs, *(v.name for v in model.description.parameters)]
