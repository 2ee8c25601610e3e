"""Types of what a scenario's author returns and declares: a wrong one is refused with the right one, and an example."""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from types import FunctionType, MethodType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray


def _article(name: str) -> str:
    return "an" if name[0] in "AEIOU" else "a"


def _is_list(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


class WrongType(TypeError):
    """Something that a scenario's author returns or declares is of the wrong type, or an array of the wrong shape.

    Args:
        what: a method with its place, or a field.
        found: what it is.
        right: the type that it must have, in words.
        example: a value of that type, as one writes it.
    """

    def __init__(self, what: str, found: object, right: str, example: str) -> None:
        super().__init__(f"{what} {described(found)}; expected {right}, such as {example}")


@dataclass(frozen=True)
class Expected:
    """A type: in words, by an example, and as what decides whether a value is of it."""

    right: str
    example: str
    fits: Callable[[Any], bool]

    def check(self, what: str, value: object) -> None:
        """Refuse a value of another type; `what` ends with a verb, as in "Reach.replay returned".

        Raises:
            WrongType: it is.
        """
        if not self.fits(value):
            raise WrongType(what, value, self.right, self.example)


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


SECONDS = Expected("a number of seconds", "Fraction(5) or 0.5", lambda v: is_number(v) and math.isfinite(v))
FLAG = Expected("True or False", "self.is_there", lambda v: isinstance(v, bool | np.bool_))
NUMBER = Expected("a number", "float(np.linalg.norm(p))", lambda v: is_number(v))
TEXT = instance_of(str, '"the tip is 3 mm from the goal"')
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
    code = method.__code__

    @functools.wraps(method)
    def call(self: Any, *args: Any, **given: Any) -> Any:
        value = method(self, *args, **given)
        if not expected.fits(value):
            place = f"({Path(code.co_filename).name}, line {code.co_firstlineno})"
            what = f"{type(self).__name__}.{method.__name__} {place} returned"
            raise WrongType(what, value, expected.right, expected.example)
        return value

    return call


def check_methods(owner: type[Any], expected: Mapping[str, Expected]) -> None:
    """Let the methods and properties that a class defines refuse to return anything of another type."""
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
