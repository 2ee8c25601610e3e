"""Parameter sets (SSV) and mappings of their names (SSM), in files of their own or in the system's description."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from handover.cosim.blocks.units import UNKNOWN, BaseExponents, Unit
from handover.cosim.exceptions import MOST_FAULTS, nearest
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.ssp.xml import SspPart, local, short_name
from handover.cosim.system.conversion import LinearTransformation

_log = logging.getLogger(__name__)

_MAX_NAMES = 5
"""Parameters that a mapping leaves out which a warning names; of more there is the number."""

_SINGLE = ("String", "Enumeration", "Binary")
"""Types whose value is one text; of others it is a list with blanks between."""

_TYPES = (
    *("Real", "Float64", "Float32", "Integer", "Boolean", *_SINGLE),
    *(f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")),
)


@dataclass(frozen=True)
class SspValue:
    """A parameter's value as written in the file, one text for each entry, in a unit that may be UNKNOWN.

    `linear` is applied after a conversion to the target's unit, or where `keeps_units` instead of one.
    """

    type_name: str
    texts: tuple[str, ...]
    unit: Unit
    where: str
    linear: LinearTransformation | None = None
    keeps_units: bool = False


@dataclass(frozen=True)
class Mapped:
    """The name that a mapping gives a parameter, and how it transforms the value; `where` it does so."""

    target: str
    linear: LinearTransformation | None
    keeps_units: bool
    where: str


def read_units(part: SspPart, parent: XmlElement, prefix: str) -> dict[str, Unit]:
    """Return the units that a description or a parameter set defines."""
    units: dict[str, Unit] = {}
    for element in part.children(parent, f"{prefix}:Units", "ssc:Unit"):
        name = part.text(element, "name")
        for base in part.children(element, "ssc:BaseUnit"):
            exponents = {n: int(part.number(base, n, 0)) for n in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
            factor = part.number(base, "factor", 1.0)
            if factor == 0:
                raise part.fault(base, f"the factor of unit {name!r} is 0")
            units[name] = Unit(name, BaseExponents(**exponents), factor, part.number(base, "offset", 0.0))
    return units


def unit_named(element: XmlElement, units: Mapping[str, Unit]) -> Unit:
    """Return the unit that a type names: UNKNOWN if none, and an undefined one if there is none of that name."""
    symbol = element.get("unit")
    return units.get(symbol, Unit(symbol, defined=False)) if symbol else UNKNOWN


def read_parameter_set(part: SspPart, root: XmlElement, units: Mapping[str, Unit]) -> dict[str, SspValue]:
    """Return the values of a parameter set by name; `units` are those of the description around it.

    Raises:
        InvalidSsp: a value is missing, of an unknown type, or there twice.
    """
    known = {**units, **read_units(part, root, "ssv")}
    values: dict[str, SspValue] = {}
    for parameter in part.children(root, "ssv:Parameters", "ssv:Parameter"):
        name = part.text(parameter, "name")
        if name in values:
            raise part.fault(parameter, f"parameter {name!r} is there twice")
        values[name] = _value(part, parameter, known)
    return values


def _value(part: SspPart, parameter: XmlElement, units: Mapping[str, Unit]) -> SspValue:
    types = [c for c in parameter.children if local(c.tag) in _TYPES]
    if len(types) != 1:
        valid = f"expected one of {', '.join(_TYPES)}"
        raise part.fault(parameter, f"parameter {part.text(parameter, 'name')!r} has {len(types)} types; {valid}")
    (element,) = types
    type_name = local(element.tag)
    entries = list(part.children(element, "ssv:Value"))
    if entries:
        texts = [part.text(e, "value") for e in entries]
    elif type_name in _SINGLE:
        texts = [part.text(element, "value")]
    else:
        texts = part.text(element, "value").split()
    return SspValue(type_name, tuple(texts), unit_named(element, units), part.where(parameter, ""))


def read_mapping(part: SspPart, root: XmlElement) -> dict[str, list[Mapped]]:
    """Return the targets of a mapping, by the parameters' names in the parameter set.

    Raises:
        InvalidSsp: two parameters are mapped to one name.
    """
    mapping: dict[str, list[Mapped]] = {}
    targets: set[str] = set()
    for entry in part.children(root, "ssm:MappingEntry"):
        source, target = part.text(entry, "source"), part.text(entry, "target")
        if target in targets:
            raise part.fault(entry, f"two parameters are mapped to {target!r}")
        targets.add(target)
        keeps_units = part.flag(entry, "suppressUnitConversion")
        mapped = Mapped(target, read_linear(part, entry), keeps_units, part.where(entry, ""))
        mapping.setdefault(source, []).append(mapped)
    return mapping


def read_linear(part: SspPart, owner: XmlElement) -> LinearTransformation | None:
    """Return the linear transformation of a mapping entry or a connection, None if it has none."""
    for child in owner.children:
        name = local(child.tag)
        if name == "LinearTransformation":
            return LinearTransformation(part.number(child, "factor", 1.0), part.number(child, "offset", 0.0))
        if name.endswith("Transformation"):
            part.leave_out(child, f"<{short_name(child.tag)}> is not supported; <ssc:LinearTransformation> is")
    return None


def mapped_values(
    values: Mapping[str, SspValue], mapping: Mapping[str, Sequence[Mapped]], owner: str
) -> dict[str, SspValue]:
    """Return the values under the names that they are mapped to; others are left out, as the standard has it.

    What of one has no counterpart in the other is warned of, as of the element `owner` that the values are for.
    """
    unmet = [(source, m) for source, targets in mapping.items() if source not in values for m in targets]
    for source, m in unmet[:MOST_FAULTS]:
        near = nearest(source, values)
        text = "%s%s: no parameter is called %r; its mapping to %r is left out%s"
        _log.warning(text, m.where, owner, source, m.target, near and f"; {near}")
    if (more := len(unmet) - MOST_FAULTS) > 0:
        _log.warning("and %s more mappings are left out", f"{more:,}")
    left_out = [name for name in values if name not in mapping]
    if left_out:
        names = ", ".join(repr(name) for name in left_out[:_MAX_NAMES])
        more = f" and {len(left_out) - _MAX_NAMES} more" if len(left_out) > _MAX_NAMES else ""
        _log.warning("%s%s: no entry maps %s, left out", values[left_out[0]].where, owner, names + more)
    return {
        m.target: replace(values[source], linear=m.linear, keeps_units=m.keeps_units)
        for source, targets in mapping.items()
        for m in targets
        if source in values
    }
