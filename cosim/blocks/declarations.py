"""Reads a dataclass of declared fields: the parameters, inputs or outputs of a block, or a scenario's parameters.

What cannot be meant by a declaration's bounds or its start value, whatever block it is of.
"""

import dataclasses
import enum
import math
import numbers
import typing
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Declaration, Raster, Shape, Width
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Causality, Kind, Variable

_TYPES: dict[Kind, tuple[tuple[type[Any], ...], str]] = {
    Kind.REAL: ((numbers.Real,), "a number, such as 0.0"),
    Kind.INTEGER: ((numbers.Integral,), "a whole number, such as 0"),
    Kind.BOOLEAN: ((bool, np.bool_), "True or False"),
    Kind.STRING: ((str,), 'a text, such as ""'),
    Kind.BINARY: ((bytes,), 'bytes, such as b""'),
}


def bounds_fault(v: Variable) -> str:
    """Return what is wrong with a variable's bounds; empty if nothing is."""
    for what, bound in (("minimum", v.minimum), ("maximum", v.maximum)):
        if bound is not None and (not isinstance(bound, numbers.Real) or bound != bound):
            return f"{what} {bound!r} is not a number"
    if v.minimum is not None and v.maximum is not None and v.minimum > v.maximum:
        return f"its minimum {v.minimum!r} is above its maximum {v.maximum!r}; are they swapped?"
    return ""


def start_fault(v: Variable) -> str:
    """Return what is wrong with the type or the shape of a variable's start value; empty if nothing is."""
    start = v.start
    if v.raster is not None:
        return _array_fault(start, (v.raster.height, v.raster.width, 3))
    if v.shape:
        return _array_fault(start, v.shape)
    if v.enumeration is not None:
        first = next(iter(v.enumeration))
        wanted = f"an item of {v.enumeration.__name__}, such as {v.enumeration.__name__}.{first.name}"
        return "" if isinstance(start, v.enumeration) else f"start {_text(start)} is not {wanted}"
    types, wanted = _TYPES[v.kind]
    fits = isinstance(start, types) and (v.kind is Kind.BOOLEAN or not isinstance(start, bool))
    return "" if fits else f"start {_text(start)} is not {wanted}"


def _array_fault(start: Any, shape: tuple[int, ...]) -> str:
    try:
        given = None if start is None else _shape(start)
    except (TypeError, ValueError):
        given = None
    if given is None:
        return f"start {_text(start)} is not an array of numbers, such as np.zeros({shape})"
    return f"start has the shape {given} where {shape} is declared" if given != shape else ""


def _shape(start: Any) -> tuple[int, ...]:
    """Return the shape of what can be made an array of numbers; a picture, which is large, is left as it is."""
    return np.shape(start) if getattr(start, "dtype", None) == np.uint8 else np.asarray(start, dtype=np.float64).shape


def _text(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 80 else text[:77] + "..."


class DeclarationError(TypeError):
    """A block's field is not declared as a parameter or a port, or is of a type that no port has."""

    def __init__(self, owner: str, field: str, fault: str) -> None:
        super().__init__(f"{owner}.{field}: {fault}")
        self.owner, self.field, self.fault = owner, field, fault


def declared_variables(owner: type[Any], causality: Causality, block: str = "") -> tuple[Variable, ...]:
    """Read the fields of one dataclass of declarations; `block` names the block that it belongs to, if to one.

    Raises:
        DeclarationError: see `describe`.
    """
    hints = typing.get_type_hints(owner, include_extras=True)
    text = f"{block}: {owner.__name__}" if block else owner.__name__
    return tuple(_variable(text, f, hints[f.name], causality) for f in dataclasses.fields(owner))


def _variable(owner: str, field: "dataclasses.Field[Any]", hint: Any, causality: Causality) -> Variable:
    declaration = field.metadata.get("declaration")
    if not isinstance(declaration, Declaration):
        raise DeclarationError(owner, field.name, "declare it with parameter(...), port(...) or output(...)")
    if not field.name.isascii():
        raise DeclarationError(owner, field.name, "a name has ASCII letters, digits and underscores; so FMI wants it")
    kind, facts = _facts(owner, field.name, hint)
    made = Variable(
        name=field.name,
        kind=kind,
        causality=causality,
        description=declaration.description,
        start=declaration.start,
        minimum=declaration.minimum,
        maximum=declaration.maximum,
        **facts,
    )
    fault = bounds_fault(made) or ("" if causality is Causality.OUTPUT else start_fault(made))
    if fault:
        raise DeclarationError(owner, made.name, fault)
    made = _with_width(owner, made)
    made = dataclasses.replace(made, start=_start(made))
    _check_range(owner, made)
    return made


def _check_range(owner: str, v: Variable) -> None:
    """A start value lies within the bounds: hosts take both from a unit as they are."""
    if v.kind not in (Kind.REAL, Kind.INTEGER, Kind.ENUMERATION) or v.causality is Causality.OUTPUT:
        return
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    outside = [x for x in np.ravel(v.start).tolist() if not low <= x <= high]
    if outside:
        raise DeclarationError(owner, v.name, f"start {outside[0]!r} is not between {low:g} and {high:g}, its bounds")


def _with_width(owner: str, made: Variable) -> Variable:
    """Return a declaration with its width, its start and bounds rounded to it as a host will see them."""
    width = made.width or {Kind.REAL: Width.FLOAT64, Kind.INTEGER: Width.INT64}.get(made.kind)
    if width is None:
        return made
    if made.kind is not (Kind.REAL if width.is_real else Kind.INTEGER):
        raise DeclarationError(owner, made.name, f"{width.value} is not the type of {made.kind.value} values")
    if width is Width.FLOAT64:
        return dataclasses.replace(made, width=width)
    rounded: dict[str, Any] = {}
    for what, value in (("minimum", made.minimum), ("maximum", made.maximum), ("start", made.start)):
        if value is None:
            continue
        for entry in np.ravel(value).tolist():
            if not width.holds(entry):
                raise DeclarationError(owner, made.name, f"{what} {entry!r} does not fit {width.range_text}")
        rounded[what] = np.float32(value).astype(float) if np.ndim(value) else width.rounded(value)
    return dataclasses.replace(made, width=width, **rounded)


def _facts(owner: str, name: str, hint: Any) -> tuple[Kind, dict[str, Any]]:
    alias = typing.get_origin(hint)
    if hasattr(alias, "__value__"):  # Vector3[Metre]: the alias carries the shape, its argument the unit
        notes = _notes(alias.__value__)
        (entry,) = typing.get_args(hint)
        kind, facts = _facts(owner, name, entry)
        if "shape" in notes and kind is not Kind.REAL:
            raise DeclarationError(owner, name, f"an array of {kind.value} entries; arrays have real entries")
        return kind, facts | notes
    facts = _notes(hint)
    if "raster" in facts:
        return Kind.BINARY, facts
    plain = typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
    if isinstance(plain, type) and issubclass(plain, enum.IntEnum):
        return Kind.ENUMERATION, {"enumeration": plain, "items": tuple((e.name, int(e)) for e in plain)}
    kinds = {bool: Kind.BOOLEAN, int: Kind.INTEGER, float: Kind.REAL, str: Kind.STRING, bytes: Kind.BINARY}
    if "shape" in facts:
        return Kind.REAL, facts
    if plain not in kinds:
        raise DeclarationError(owner, name, f"{plain!r} is not the type of a port")
    return kinds[plain], facts


def _notes(hint: Any) -> dict[str, Any]:
    """Return what a type is annotated with."""
    facts: dict[str, Any] = {}
    for note in getattr(hint, "__metadata__", ()):
        if isinstance(note, Unit):
            facts["unit"] = note
        elif isinstance(note, Shape):
            facts["shape"] = note.extents
        elif isinstance(note, Raster):
            facts["raster"] = note
        elif isinstance(note, Width):
            facts["width"] = note
    return facts


def _start(v: Variable) -> Any:
    if v.kind is Kind.BINARY:
        return b""
    if v.kind is Kind.REAL and v.shape:
        return np.zeros(v.shape) if v.start is None else np.asarray(v.start, dtype=np.float64)
    if v.start is not None:
        return v.start
    if v.enumeration is not None:
        return next(iter(v.enumeration))
    return {Kind.REAL: 0.0, Kind.INTEGER: 0, Kind.BOOLEAN: False, Kind.STRING: ""}[v.kind]
