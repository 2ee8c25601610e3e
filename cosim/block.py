"""What a plant or a controller is, and what its declarations say: names, types, units, shapes, starts, ranges.

A block is a plain class with three dataclasses of declared fields (`Params`, `Inputs`, `Outputs`); they are found by
the annotations of `__init__` and `step`. Everything that is told of a variable elsewhere comes from `describe`.
"""

import dataclasses
import enum
import functools
import inspect
import math
import typing
from collections.abc import Mapping
from fractions import Fraction
from typing import Any, ClassVar, Protocol

import numpy as np

from cosim.ports import Declaration, Raster, Shape
from cosim.units import ONE, Unit
from cosim.width import Width


class Block(Protocol):
    """A plant or a controller with declared ports, advanced in steps.

    What a block may offer besides: `cosim.eventful_block.EventfulBlock`,
    `cosim.differentiable_block.DifferentiableBlock`.

    Class attributes: `feedthrough` names, by output, the inputs that act on it at once (within the same communication
    point); `period` is the sampling period of a block that is sampled, in seconds, else None.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]]
    period: ClassVar[Fraction | None]

    def __init__(self, params: Any) -> None: ...
    def outputs(self, t: float, u: Any) -> Any:
        """Return the outputs at the start; no time passes."""
        ...

    def step(self, t: float, dt: float, u: Any) -> Any:
        """Advance from t by dt with u held and return the outputs at t + dt.

        A sampled block is stepped by its period only, once at each tick; its outputs hold until the next one.
        """
        ...

    def get_state(self) -> bytes:
        """Return the complete state: what follows `set_state` is the same, bit for bit."""
        ...

    def set_state(self, state: bytes) -> None:
        """Go back to a state that `get_state` gave."""
        ...


_EVENT_METHODS = ("advance", "handle_event", "next_event")


class Kind(enum.Enum):
    """Kind of a variable."""

    REAL = "real"
    INTEGER = "integer"
    BOOLEAN = "boolean"
    ENUMERATION = "enumeration"
    STRING = "string"
    BINARY = "binary"


class Causality(enum.Enum):
    """Role of a variable."""

    PARAMETER = "parameter"
    INPUT = "input"
    OUTPUT = "output"


class DeclarationError(TypeError):
    """A block's field is not declared as a parameter or a port, or is of a type that no port has."""

    def __init__(self, owner: str, field: str, fault: str) -> None:
        super().__init__(f"{owner}.{field}: {fault}")
        self.owner, self.field, self.fault = owner, field, fault


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declared:
    """What is known of a parameter, input or output, be it a block's or an FMU's.

    `items` are an enumeration's; reals and integers have a `width`.
    """

    name: str
    kind: Kind
    causality: Causality
    description: str = ""
    shape: tuple[int, ...] = ()
    unit: Unit = ONE
    minimum: float | None = None
    maximum: float | None = None
    items: tuple[tuple[str, int], ...] = ()
    width: Width | None = None

    @property
    def size(self) -> int:
        """Number of entries; 1 for a scalar."""
        return math.prod(self.shape)

    @property
    def type_name(self) -> str:
        """Kind, with the width of numbers where it is not the usual one, as in `integer (Int16)`."""
        usual = self.width in (None, Width.FLOAT64, Width.INT64)
        return self.kind.value if usual or self.width is None else f"{self.kind.value} ({self.width.value})"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Variable(Declared):
    """All that a block says of one of its parameters, inputs or outputs."""

    start: Any
    enumeration: type[enum.IntEnum] | None = None
    raster: Raster | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class Description:
    """What a block class declares."""

    name: str
    doc: str
    params_type: type[Any]
    inputs_type: type[Any]
    outputs_type: type[Any]
    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    feedthrough: Mapping[str, tuple[str, ...]]
    period: Fraction | None
    has_events: bool
    has_derivatives: bool

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Parameters, inputs and outputs, in the order of their declaration."""
        return self.parameters + self.inputs + self.outputs


@functools.cache
def describe(block: type[Any]) -> Description:
    """Read a block class's declarations.

    Raises:
        DeclarationError: something that a block has is missing; a field has no `parameter`, `port` or `output`
            declaration, or a type that is no port's, or a start value or bound that its type cannot hold; the
            period is not positive.
    """
    for name in ("feedthrough", "period", "step"):
        if not hasattr(block, name):
            raise DeclarationError(block.__name__, name, "a block has this attribute; see cosim.block.Block")
    if block.period is not None and block.period <= 0:
        raise DeclarationError(block.__name__, "period", f"{block.period} s is not positive")
    params_type = _annotation(block, "__init__", "params")
    inputs_type = _annotation(block, "step", "u")
    outputs_type = _annotation(block, "step", "return")
    inputs = declared_variables(inputs_type, Causality.INPUT)
    outputs = declared_variables(outputs_type, Causality.OUTPUT)
    feedthrough: Mapping[str, tuple[str, ...]] = block.feedthrough
    for y, us in feedthrough.items():
        for name, known in [(y, outputs)] + [(u, inputs) for u in us]:
            if name not in [v.name for v in known]:
                raise DeclarationError(block.__name__, "feedthrough", f"no such port: {name!r}")
    return Description(
        name=block.__name__,
        doc=inspect.getdoc(block) or "",
        params_type=params_type,
        inputs_type=inputs_type,
        outputs_type=outputs_type,
        parameters=declared_variables(params_type, Causality.PARAMETER),
        inputs=inputs,
        outputs=outputs,
        feedthrough=feedthrough,
        period=block.period,
        has_events=_has_events(block),
        has_derivatives=hasattr(block, "directional_derivative"),
    )


def _has_events(block: type[Any]) -> bool:
    present = [name for name in _EVENT_METHODS if hasattr(block, name)]
    for name in _EVENT_METHODS:
        if present and name not in present:
            fault = f"a block that has {present[0]} has this method too; see cosim.eventful_block.EventfulBlock"
            raise DeclarationError(block.__name__, name, fault)
    if present and block.period is not None:
        raise DeclarationError(block.__name__, "period", "a block with events is not sampled: its period is None")
    return bool(present)


def _annotation(block: type[Any], method: str, name: str) -> type[Any]:
    hints = typing.get_type_hints(getattr(block, method))
    found = hints.get(name)
    if found is None or not dataclasses.is_dataclass(found):
        raise DeclarationError(
            block.__name__, method, f"{name!r} must be annotated with a dataclass of declared fields"
        )
    return typing.cast("type[Any]", found)


def declared_variables(owner: type[Any], causality: Causality) -> tuple[Variable, ...]:
    """Read the fields of one dataclass of declarations.

    Raises:
        DeclarationError: see `describe`.
    """
    hints = typing.get_type_hints(owner, include_extras=True)
    return tuple(_variable(owner.__name__, f, hints[f.name], causality) for f in dataclasses.fields(owner))


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
                raise DeclarationError(owner, made.name, f"{what} {entry!r} does not fit {width.told}")
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
        given = np.zeros(v.shape) if v.start is None else np.asarray(v.start, dtype=np.float64)
        if given.shape != v.shape:
            raise DeclarationError(v.name, "start", f"shape {given.shape} where {v.shape} is declared")
        return given
    if v.start is not None:
        return v.start
    if v.enumeration is not None:
        return next(iter(v.enumeration))
    return {Kind.REAL: 0.0, Kind.INTEGER: 0, Kind.BOOLEAN: False, Kind.STRING: ""}[v.kind]
