"""What both standards' model descriptions share: units, log categories, numbers as text."""

import enum
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from cosim.block import Description, Kind, Variable
from fmus.layout import Form, Layout

GENERATOR = "handover-cosim"

LOG_CATEGORIES = {
    "logStatusError": "refused calls and failures, with the traceback of an exception",
    "logStatusWarning": "calls that are answered, but perhaps not as expected",
    "logAll": "beginning and end of a run, besides the others",
}


@dataclass(frozen=True, kw_only=True)
class Model:
    """What a model description is made from.

    Attributes:
        name: the unit's name, also the name of its shared library.
        step: the communication step that suits the unit, in seconds.
        token: GUID of FMI 2, instantiation token of FMI 3.
        description: the block's declarations.
        layout: its variables' places.
        form: how the variables are shown; with the layout it gives the value references.
        variable_step: whether a step may have any size.
    """

    name: str
    summary: str
    step: Fraction
    token: str
    description: Description
    layout: Layout
    form: Form
    variable_step: bool


def text(root: ET.Element) -> bytes:
    """Return a document as indented UTF-8."""
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def number(value: float) -> str:
    """Return the shortest text from which the same float64 is read."""
    return repr(float(value))


def boolean(value: object) -> str:
    """Return `true` or `false`."""
    return "true" if value else "false"


def bounds(variable: Variable) -> dict[str, str]:
    """Return the attributes `min` and `max` as far as they are declared."""
    pairs = {"min": variable.minimum, "max": variable.maximum}
    return {
        name: number(value) if variable.kind is Kind.REAL else str(int(value))
        for name, value in pairs.items()
        if value is not None
    }


def add_units(root: ET.Element, variables: Iterable[Variable]) -> None:
    """Add the units in use: value in SI = factor * value + offset, with the exponents of the base units."""
    units = {v.unit.symbol: v.unit for v in variables if v.kind.value == "real"}
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
    """Add the log categories that the runtime knows (runtime/log.c)."""
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)


def add_default_experiment(root: ET.Element, model: Model) -> None:
    """Add the start time 0 and the step that suits the unit."""
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=number(float(model.step)))


def enumerations(variables: Iterable[Variable]) -> list[type[enum.IntEnum]]:
    """Return the enumeration types in use, by name."""
    used = {v.enumeration.__name__: v.enumeration for v in variables if v.enumeration}
    return [items for _, items in sorted(used.items())]


def variability(model: Model, variable: Variable) -> str:
    """Return a port's variability: real ports are continuous but the outputs of a sampled block."""
    sampled_output = variable.causality.value == "output" and model.description.period is not None
    return "continuous" if variable.kind.value == "real" and not sampled_output else "discrete"


def known_at_start(model: Model, output: str) -> list[str]:
    """Return what an output's first value is worked out from: the inputs that feed through to it, all parameters."""
    inputs = model.description.feedthrough.get(output, ())
    return [*inputs, *(v.name for v in model.description.parameters)]
