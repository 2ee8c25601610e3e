"""Reads what a block class declares: ports, parameters, direct feedthrough, period, events, derivatives.

`describe` is the one source of this for model descriptions, the FMU's runtime and documentation. It first checks the
class's form, that is its attributes and methods, then reads the dataclasses of its ports. `with_start_values` gives
parameters and inputs other start values than the class declares.
"""

import dataclasses
import functools
import inspect
import sys
import typing
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from types import FunctionType
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.block import Block, DifferentiableBlock, EventfulBlock
from handover.cosim.blocks.declarations import DeclarationError, declared_variables
from handover.cosim.blocks.start_values import fault_of, numbers_of
from handover.cosim.blocks.terminals import Terminal, terminal_faults
from handover.cosim.blocks.variable import Causality, Kind, Variable

_ATTRIBUTES = ("feedthrough", "period")
_METHODS = ("outputs", "step", "get_state", "set_state")
_EXPECTED = {
    "feedthrough": 'feedthrough = {"y": ("u",)}, or {} where no input acts on an output at once',
    "period": "period = Fraction(1, 100) of a block that is sampled, or None",
    "outputs": "def outputs(self, t, u)",
    "step": "def step(self, t, dt, u)",
    "get_state": "def get_state(self)",
    "set_state": "def set_state(self, state)",
}
_EVENT_METHODS = ("advance", "handle_event", "next_event")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Description:
    """What a block class declares.

    Attributes:
        name: the class's name.
        doc, module_doc: docstrings of the class and of its module; empty where there is none.
        params_type, inputs_type, outputs_type: the dataclasses of declared fields.
        parameters, inputs, outputs: their fields, in the order of their declaration.
        feedthrough: by output, the inputs with direct feedthrough to it.
        period: of a sampled block, in seconds.
        terminals: its ports that are connected together.
        has_events: whether it is an `EventfulBlock`.
        has_derivatives: whether it is a `DifferentiableBlock`.
    """

    name: str
    doc: str
    module_doc: str
    params_type: type[Any]
    inputs_type: type[Any]
    outputs_type: type[Any]
    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    feedthrough: Mapping[str, tuple[str, ...]]
    period: Fraction | None
    terminals: tuple[Terminal, ...]
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
        DeclarationError: an attribute or method of a block is missing; a field has no `parameter`, `port` or `output`
            declaration, or a type that no port has, or a start value or bound that its type cannot hold; period,
            feedthrough or terminals are invalid.
    """
    check_form(block)
    params_type = _annotation(block, "__init__", "params")
    inputs_type = _annotation(block, "step", "u")
    outputs_type = _annotation(block, "step", "return")
    parameters = declared_variables(params_type, Causality.PARAMETER, block.__name__)
    inputs = declared_variables(inputs_type, Causality.INPUT, block.__name__)
    outputs = declared_variables(outputs_type, Causality.OUTPUT, block.__name__)
    feedthrough: Mapping[str, tuple[str, ...]] = block.feedthrough
    for y, us in feedthrough.items():
        for name, known in [(y, outputs)] + [(u, inputs) for u in us]:
            if name not in [v.name for v in known]:
                raise DeclarationError(block.__name__, "feedthrough", f"no such port: {name!r}")
    terminals = getattr(block, "terminals", ())
    if faults := terminal_faults(terminals, inputs, outputs, [v.name for v in parameters]):
        raise DeclarationError(block.__name__, "terminals", "; ".join(faults))
    return Description(
        name=block.__name__,
        doc=inspect.getdoc(block) or "",
        module_doc=_module_doc(block),
        params_type=params_type,
        inputs_type=inputs_type,
        outputs_type=outputs_type,
        parameters=parameters,
        inputs=inputs,
        outputs=outputs,
        feedthrough=feedthrough,
        period=block.period,
        terminals=tuple(terminals),
        has_events=_has_events(block),
        has_derivatives=hasattr(block, "directional_derivative"),
    )


def with_start_values(description: Description, start: Mapping[str, Any]) -> Description:
    """Return a description in which parameters and inputs start from these values, by name; enumerations by number.

    Raises:
        DeclarationError: there is no parameter or input of a name, or it cannot start from the value.
    """
    settable = {v.name: v for v in description.parameters + description.inputs if v.kind is not Kind.BINARY}
    for name, value in start.items():
        if name not in settable:
            fault = f"nothing of this name has a start value; these have one: {', '.join(settable)}"
            raise DeclarationError(description.name, name, fault)
        if fault := fault_of(settable[name], value):
            raise DeclarationError(description.name, name, f"start {fault}")

    def started(variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        return tuple(_started(v, start[v.name]) if v.name in start else v for v in variables)

    return dataclasses.replace(
        description, parameters=started(description.parameters), inputs=started(description.inputs)
    )


def _started(v: Variable, value: Any) -> Variable:
    if v.enumeration is not None:
        value = v.enumeration(int(numbers_of(v, value)[0]))
    elif v.shape:
        value = np.asarray(value, dtype=np.float64)
    return dataclasses.replace(v, start=value)


def check_form(block: type[Any]) -> None:
    """Check a block class's attributes and methods.

    Raises:
        DeclarationError: some are missing (the message lists all of them), an attribute's value is invalid, or a method
            takes other arguments.
    """
    missing = [name for name in _ATTRIBUTES if not hasattr(block, name)]
    missing += [name for name in _METHODS if not callable(getattr(block, name, None))]
    if missing:
        right = "; ".join(_EXPECTED[name] for name in missing)
        raise DeclarationError(block.__name__, ", ".join(missing), f"missing; expected {right}")
    faults = [("period", _period_fault(block.period)), ("feedthrough", _feedthrough_fault(block))]
    for like in (Block, EventfulBlock, DifferentiableBlock):
        for name, method in ((n, m) for n, m in vars(like).items() if isinstance(m, FunctionType) and n[0] != "_"):
            own = inspect.getattr_static(block, name, None)
            if isinstance(own, FunctionType):
                faults.append((name + place_of(own), signature_fault(own, method)))
    for name, fault in faults:
        if fault:
            raise DeclarationError(block.__name__, name, fault)


def signature_fault(method: Callable[..., Any], like: Callable[..., Any]) -> str:
    """Return that a method cannot be called with another's arguments, given in their order; "" if it can."""
    wanted = inspect.signature(like).parameters
    try:
        taken = inspect.signature(method)
        taken.bind(*wanted)
    except TypeError:
        return f"takes ({_listed(inspect.signature(method).parameters)}); expected ({_listed(wanted)})"
    except ValueError:  # of a compiled function
        return ""
    return ""


def _listed(parameters: Iterable[str]) -> str:
    return ", ".join(name for name in parameters if name != "self")


def place_of(method: object) -> str:
    """Return where a method is defined, as " (arm.py, line 3)"; "" where that is not known, as of a compiled one."""
    code = getattr(inspect.unwrap(method) if callable(method) else None, "__code__", None)
    return "" if code is None else f" ({Path(code.co_filename).name}, line {code.co_firstlineno})"


def _period_fault(period: object) -> str:
    if period is None:
        return ""
    if isinstance(period, Fraction):
        return "" if period > 0 else f"{period} s is not positive"
    try:
        exact = Fraction(str(period))
    except (ValueError, ZeroDivisionError):
        exact = Fraction(0)
    valid = repr(exact if exact > 0 else Fraction(1, 100))
    return f"{period!r} is not a fraction of seconds; use {valid}, or None for a block that is not sampled"


def _feedthrough_fault(block: type[Any]) -> str:
    feedthrough: object = block.feedthrough
    example = 'such as {"y": ("u",)}, or {} where no input has direct feedthrough to an output'
    if not isinstance(feedthrough, Mapping):
        return f"{feedthrough!r} is not a mapping of outputs' names to tuples of inputs' names, {example}"
    for y, us in cast("Mapping[object, object]", feedthrough).items():
        if isinstance(us, str):
            return f"{y!r}: {us!r} is a string, not a tuple of inputs' names; use ({us!r},)"
        if not isinstance(us, (tuple, list)):
            return f"{y!r}: {us!r} is not a tuple of inputs' names, {example}"
    return ""


def _module_doc(block: type[Any]) -> str:
    module = sys.modules.get(block.__module__)
    return inspect.cleandoc(module.__doc__ or "") if module else ""


def _has_events(block: type[Any]) -> bool:
    present = [name for name in _EVENT_METHODS if hasattr(block, name)]
    for name in _EVENT_METHODS:
        if present and name not in present:
            fault = f"a block with {present[0]} needs this method too; see handover.cosim.blocks.block.EventfulBlock"
            raise DeclarationError(block.__name__, name, fault)
    if present and block.period is not None:
        raise DeclarationError(block.__name__, "period", "a block with events is not sampled: its period is None")
    return bool(present)


def _annotation(block: type[Any], method: str, name: str) -> type[Any]:
    hints = typing.get_type_hints(getattr(block, method))
    annotation = hints.get(name)
    if annotation is None or not dataclasses.is_dataclass(annotation):
        raise DeclarationError(
            block.__name__, method, f"{name!r} must be annotated with a dataclass of declared fields"
        )
    return typing.cast("type[Any]", annotation)
