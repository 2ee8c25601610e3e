"""Types of what a scenario's author returns and declares: a wrong one is refused with the right one, and an example."""

import functools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from types import FunctionType, MethodType, NoneType
from typing import Any, ClassVar, Literal, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.description import place_of, signature_fault


def _article(name: str) -> str:
    return "an" if name[0] in "AEIOU" else "a"


def _is_list(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


class WrongType(TypeError):
    """Something that a scenario's author returns or declares is of the wrong type, or an array of the wrong shape.

    Args:
        what: a method with its place, or a field.
        found: what it is, in words.
        right: the type that it must have, in words.
        example: a value of that type, as one writes it.
    """

    def __init__(self, what: str, found: str, right: str, example: str) -> None:
        super().__init__(f"{what} {found}; expected {right}, such as {example}")


class WrongArguments(TypeError):
    """A method of a scenario or an evaluator takes other arguments than it is called with."""


@dataclass(frozen=True)
class Expected:
    """A type: in words, by an example, and as what decides whether a value is of it; `says` what another value is."""

    right: str
    example: str
    fits: Callable[[Any], bool]
    says: Callable[[Any], str] = lambda value: described(value)

    def check(self, what: str, value: object) -> None:
        """Refuse a value of another type; `what` ends with a verb, as in "Reach.replay returned".

        Raises:
            WrongType: it is.
        """
        if not self.fits(value):
            raise WrongType(what, self.says(value), self.right, self.example)


def instance_of(kind: type[Any], example: str, *, optional: bool = False) -> Expected:
    """Return the type of one value, or of None."""
    right = f"{_article(kind.__name__)} {kind.__name__}{' or None' if optional else ''}"
    return Expected(right, example, lambda v: isinstance(v, kind) or (optional and v is None))


def sequence_of(kind: type[Any], example: str) -> Expected:
    """Return the type of a list or tuple of such values."""
    right = f"a list or tuple of {kind.__name__}"
    return Expected(right, example, lambda v: _is_list(v) and all(isinstance(x, kind) for x in v))


def mapping_to(kind: type[Any], example: str) -> Expected:
    """Return the type of a mapping of names to such values."""

    def fits(value: object) -> bool:
        if not isinstance(value, Mapping):
            return False
        items = cast(Mapping[object, object], value).items()
        return all(isinstance(name, str) and isinstance(x, kind) for name, x in items)

    return Expected(f"a mapping of names to {kind.__name__}", example, fits)


class Checked:
    """A dataclass that refuses values of other types for its fields than they are declared with, as it is made.

    Checked are fields of texts, numbers, truth values, literals, other classes, and lists of these. What another field
    may be, or what would be a better example, is in `expected` by the field's name.
    """

    expected: ClassVar[Mapping[str, Expected]] = {}

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            WrongType: one is of another type.
        """
        fields = vars(self)
        for name, kind in _expected_fields(type(self)).items():
            if not kind.fits(fields[name]):
                name_of = next((f" {v!r}" for n, v in fields.items() if n in _NAMES and n != name), "")
                verb = "are" if name[-1] == "s" and kind is not FLAG else "is"
                kind.check(f"the {name} of {type(self).__name__}{name_of} {verb}", fields[name])


_NAMES = ("label", "title", "name")
"""Fields by which messages name an object."""


@functools.cache
def _expected_fields(owner: type[Checked]) -> Mapping[str, Expected]:
    declared = {name: _expected_of(hint) for name, hint in get_type_hints(owner).items() if name != "expected"}
    return {name: kind for name, kind in declared.items() if kind is not None} | dict(owner.expected)


def _expected_of(hint: Any) -> Expected | None:
    """Return what a field's declaration says; None where it says too little."""
    of = get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint]
    if get_origin(hint) is Literal:
        return Expected(f"one of {', '.join(map(repr, of))}", repr(of[0]), lambda v: isinstance(v, str) and v in of)
    if len(of) == 2 and NoneType in of:
        kind = _expected_of(of[0])
        return kind and Expected(f"{kind.right} or None", kind.example, lambda v: v is None or kind.fits(v))
    is_list = get_origin(hint) is Sequence or (get_origin(hint) is tuple and of[1:] == (...,))
    if is_list and isinstance(of[0], type):
        example = _PLAIN[of[0]].example if of[0] in _PLAIN else f"{of[0].__name__}(...)"
        return sequence_of(of[0], f"[{example}]")
    return instance_of(hint, f"{hint.__name__}(...)") if isinstance(hint, type) and not of else None


FLAG = Expected("True or False", "True", lambda v: isinstance(v, bool | np.bool_))
NUMBER = Expected("a number", "float(np.linalg.norm(p))", lambda v: is_number(v))
_PLAIN: Mapping[Any, Expected] = {
    str: instance_of(str, '"distance"'),
    bool: FLAG,
    int: Expected("a whole number", "2", lambda v: isinstance(v, Integral)),
    float: NUMBER,
}

COLOUR = Expected(
    'a colour as "#rrggbb"',
    '"#2f6db5"',
    lambda v: isinstance(v, str) and re.fullmatch("#[0-9a-fA-F]{6}", v) is not None,
)
VECTOR = Expected("three numbers", "(1.3, 1.3, 0.6)", lambda v: is_series(v, (3,)))
SECONDS = Expected("a number of seconds", "Fraction(5) or 0.5", lambda v: is_number(v) and math.isfinite(v))
NAMES = sequence_of(str, '("controller",)')
FILES = mapping_to(Path, '{"model": Path("model.json")}')


def is_number(value: object) -> bool:
    """Return whether a value is a real number."""
    return isinstance(value, Real)


def is_series(values: object, shape: tuple[int | None, ...]) -> bool:
    """Return whether values are numbers in an array of a shape, of which None is any length."""
    if not isinstance(values, (np.ndarray, list, tuple)):
        return False
    try:
        array: NDArray[Any] = np.asarray(cast(Any, values))
    except ValueError:  # rows of several lengths
        return False
    fits = all(n is None or n == m for n, m in zip(shape, array.shape, strict=False))
    return array.dtype.kind in "biuf" and array.ndim == len(shape) and fits


def checked_method(method: Callable[..., Any], expected: Expected) -> Callable[..., Any]:
    """Return a method that refuses to return anything of another type.

    Raises:
        WrongType: when it is called, with the class, and where the method is.
    """

    @functools.wraps(method)
    def call(self: Any, *args: Any, **given: Any) -> Any:
        value = method(self, *args, **given)
        if not expected.fits(value):
            expected.check(f"{type(self).__name__}.{method.__name__}{place_of(method)} returned", value)
        return value

    return call


def check_methods(owner: type[Any], base: type[Any], expected: Mapping[str, Expected]) -> None:
    """Let the methods and properties that a class defines refuse to return anything of another type.

    Raises:
        WrongArguments: a method cannot be called as its base class's can.
    """
    for name in vars(owner).keys() & vars(base).keys() - {"__init__", "__init_subclass__"}:
        defined, like = (f.fget if isinstance(f, property) else f for f in (vars(owner)[name], vars(base)[name]))
        are_methods = isinstance(defined, FunctionType) and isinstance(like, FunctionType)
        if are_methods and (fault := signature_fault(defined, like)):
            raise WrongArguments(f"{owner.__name__}.{name}{place_of(defined)} {fault}")
    for name, kind in expected.items():
        defined = vars(owner).get(name)
        if isinstance(defined, FunctionType):
            setattr(owner, name, checked_method(defined, kind))
        elif isinstance(defined, property) and defined.fget is not None:
            setattr(owner, name, property(checked_method(defined.fget, kind), defined.fset, defined.fdel))


def described(value: object) -> str:
    """Return what a value is, in words: `a list of TimePlot`."""
    if value is None:
        return "None"
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if isinstance(value, FunctionType | MethodType):
        return "a method"
    if isinstance(value, np.ndarray):
        array = cast(Any, value)
        return f"an array of {array.dtype} of shape {array.shape}"
    name = type(value).__name__
    if _is_list(value) or isinstance(value, Mapping):
        held = cast(Any, value).values() if isinstance(value, Mapping) else cast(Any, value)
        kinds = list(dict.fromkeys(type(x).__name__ for x in held))
        return f"a {name} of {' and '.join(kinds)}" if kinds else f"an empty {name}"
    if isinstance(value, str | bool | int | float):
        text = repr(value)
        return f"the {name} {text if len(text) < 40 else f'{text[:36]}...'}"
    return f"{_article(name)} {name}"
