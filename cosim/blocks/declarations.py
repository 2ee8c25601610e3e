"""Reads a dataclass of declared fields: the parameters, inputs or outputs of a block, or a scenario's parameters.

Each field becomes a `Variable`: kind, unit, shape and width come from its type, the rest from `parameter`, `port` or
`output` (`handover.cosim.blocks.ports`). Declarations are checked as they are read: swapped bounds, and start values of
the wrong type or shape, out of range, or not representable in the declared width raise `DeclarationError`.
"""

import dataclasses
import enum
import math
import numbers
import typing
from functools import cache
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Declaration, Raster, Shape, Width
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Causality, Kind, Variable


class DeclarationError(TypeError):
    """A block's attribute, method or field is missing, is not declared as a port, or has a type that no port has."""

    def __init__(self, owner: str, field: str, fault: str) -> None:
        super().__init__(f"{owner}.{field}: {fault}")
        self.owner, self.field, self.fault = owner, field, fault


@cache
def declared_variables(owner: type[Any], causality: Causality, block: str = "") -> tuple[Variable, ...]:
    """Read the fields of one dataclass of declarations; `block` names the block that it belongs to, if to one.

    Raises:
        DeclarationError: see `describe`.
    """
    hints = typing.get_type_hints(owner, include_extras=True)
    owner_name = f"{block}: {owner.__name__}" if block else owner.__name__
    fields = dataclasses.fields(owner)
    return tuple(_variable(owner_name, f, f.metadata.get("type", hints[f.name]), causality) for f in fields)


def _variable(owner: str, field: "dataclasses.Field[Any]", hint: Any, causality: Causality) -> Variable:
    declaration = field.metadata.get("declaration")
    if not isinstance(declaration, Declaration):
        raise DeclarationError(owner, field.name, "declare it with parameter(...), port(...) or output(...)")
    if not field.name.isascii():
        raise DeclarationError(owner, field.name, "use ASCII letters, digits and underscores: FMI allows no others")
    kind, attributes = _kind_and_attributes(owner, field.name, hint)
    variable = Variable(
        name=field.name,
        kind=kind,
        causality=causality,
        description=declaration.description,
        start=declaration.start,
        minimum=declaration.minimum,
        maximum=declaration.maximum,
        origin=declaration.origin,
        **attributes,
    )
    fault = bounds_fault(variable) or ("" if causality is Causality.OUTPUT else start_fault(variable))
    if fault:
        raise DeclarationError(owner, variable.name, fault)
    variable = _with_width(owner, variable)
    variable = dataclasses.replace(variable, start=_start(variable))
    _check_range(owner, variable)
    return variable


def _check_range(owner: str, v: Variable) -> None:
    """Check that a start value lies within the bounds; hosts use both without checking them again."""
    if v.kind not in (Kind.REAL, Kind.INTEGER, Kind.ENUMERATION) or v.causality is Causality.OUTPUT:
        return
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    outside = [x for x in np.ravel(v.start).tolist() if not low <= x <= high]
    if outside:
        raise DeclarationError(owner, v.name, f"start {outside[0]!r} is not between {low:g} and {high:g}, its bounds")


def _with_width(owner: str, v: Variable) -> Variable:
    """Return a variable with its width, and with start and bounds rounded to it as a host will see them."""
    width = v.width or {Kind.REAL: Width.FLOAT64, Kind.INTEGER: Width.INT64}.get(v.kind)
    if width is None:
        return v
    if v.kind is not (Kind.REAL if width.is_real else Kind.INTEGER):
        raise DeclarationError(owner, v.name, f"{width.value} is not the type of {v.kind.value} values")
    if width is Width.FLOAT64:
        return dataclasses.replace(v, width=width)
    rounded: dict[str, Any] = {}
    for what, value in (("minimum", v.minimum), ("maximum", v.maximum), ("start", v.start)):
        if value is None:
            continue
        for entry in np.ravel(value).tolist():
            if not width.holds(entry):
                raise DeclarationError(owner, v.name, f"{what} {entry!r} does not fit {width.range_text}")
        rounded[what] = np.float32(value).astype(float) if np.ndim(value) else width.rounded(value)
    return dataclasses.replace(v, width=width, **rounded)


def _kind_and_attributes(owner: str, name: str, hint: Any) -> tuple[Kind, dict[str, Any]]:
    """Return what a field's type says: its kind, and other fields of `Variable` by their names."""
    alias = typing.get_origin(hint)
    if hasattr(alias, "__value__"):  # Vector3[Metre]: the alias carries the shape, its argument the unit
        outer = _annotations(alias.__value__)
        (entry,) = typing.get_args(hint)
        kind, inner = _kind_and_attributes(owner, name, entry)
        if "shape" in outer and kind is not Kind.REAL:
            raise DeclarationError(owner, name, f"an array of {kind.value} entries; arrays have real entries")
        return kind, inner | outer
    attributes = _annotations(hint)
    if "raster" in attributes:
        return Kind.BINARY, attributes
    plain = typing.get_args(hint)[0] if hasattr(hint, "__metadata__") else hint
    if isinstance(plain, type) and issubclass(plain, enum.IntEnum):
        return Kind.ENUMERATION, {"enumeration": plain, "items": tuple((e.name, int(e)) for e in plain)}
    kinds = {bool: Kind.BOOLEAN, int: Kind.INTEGER, float: Kind.REAL, str: Kind.STRING, bytes: Kind.BINARY}
    if "shape" in attributes:
        return Kind.REAL, attributes
    if plain not in kinds:
        raise DeclarationError(owner, name, f"{plain!r} is not the type of a port")
    return kinds[plain], attributes


def _annotations(hint: Any) -> dict[str, Any]:
    """Return the unit, shape, raster and width that a type is annotated with."""
    attributes: dict[str, Any] = {}
    for annotation in getattr(hint, "__metadata__", ()):
        if isinstance(annotation, Unit):
            attributes["unit"] = annotation
        elif isinstance(annotation, Shape):
            attributes["shape"] = annotation.extents
        elif isinstance(annotation, Raster):
            attributes["raster"] = annotation
        elif isinstance(annotation, Width):
            attributes["width"] = annotation
    return attributes


def _start(v: Variable) -> Any:
    """Return the start value, or zero, false, empty, the first item where none is declared; pictures start empty."""
    if v.kind is Kind.BINARY:
        return b""
    if v.kind is Kind.REAL and v.shape:
        return np.zeros(v.shape) if v.start is None else np.asarray(v.start, dtype=np.float64)
    if v.start is not None:
        return v.start
    if v.enumeration is not None:
        return next(iter(v.enumeration))
    return {Kind.REAL: 0.0, Kind.INTEGER: 0, Kind.BOOLEAN: False, Kind.STRING: ""}[v.kind]


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
        return "" if isinstance(start, v.enumeration) else f"start {short_repr(start)} is not {wanted}"
    types, wanted = _TYPES[v.kind]
    fits = isinstance(start, types) and (v.kind is Kind.BOOLEAN or not isinstance(start, bool))
    return "" if fits else f"start {short_repr(start)} is not {wanted}"


def _array_fault(start: Any, shape: tuple[int, ...]) -> str:
    try:
        start_shape = None if start is None else _shape(start)
    except (TypeError, ValueError):
        start_shape = None
    if start_shape is None:
        return f"start {short_repr(start)} is not an array of numbers, such as np.zeros({shape})"
    return f"start has the shape {start_shape} where {shape} is declared" if start_shape != shape else ""


def _shape(start: Any) -> tuple[int, ...]:
    """Return the shape of an array-like of numbers; a picture, which is large, is not converted for it."""
    return np.shape(start) if getattr(start, "dtype", None) == np.uint8 else np.asarray(start, dtype=np.float64).shape


def short_repr(value: Any) -> str:
    """Return a value as text for a message: an array as lists, cut after 80 characters."""
    shown = repr(value.tolist() if isinstance(value, np.ndarray) else value)
    return shown if len(shown) < 80 else shown[:77] + "..."
