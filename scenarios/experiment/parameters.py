"""Turns `name=value` texts into a scenario's parameters, and back; all faults are reported, with valid values."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.blocks.start_values import fault_of, range_of
from handover.cosim.blocks.variable import Kind, Variable
from handover.cosim.exceptions import MOST_FAULTS, counted, first_faults, nearest, suggestion
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.needs import Need, needs_of

_SEEDS = "a run's seed is given by --seed, a sweep's runs of several seeds by --repeat"


class UnknownParameter(str):
    """The fault of a name that is not a parameter's, with the nearest of theirs; `name` is the name."""

    name: str

    def __new__(cls, what: str, name: str, known: Iterable[str], hint: str = "") -> "UnknownParameter":
        """Return it: what has no parameter, up to the name, and a hint or else the nearest names."""
        fault = super().__new__(cls, f"{what} {short_repr(name)}; {hint or nearest(name, known)}")
        fault.name = name
        return fault


class InvalidParameter(ValueError):
    """Unknown parameters, or values out of their range; `faults` lists them all, `unknown` the names of the former."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(first_faults(faults)))
        self.faults = tuple(faults)
        self.unknown = tuple(fault.name for fault in faults if isinstance(fault, UnknownParameter))


def parse_parameters(experiment: type[Experiment[Any]], given: Sequence[str]) -> Any:
    """Return the scenario's parameters with the given ones set, the others at their defaults.

    Numbers are in SI units; arrays are numbers separated by commas; enumerations are given by name.

    Raises:
        InvalidParameter: with all faults of the given texts.
    """
    known = {v.name: v for v in experiment.parameters()}
    texts, faults = texts_by_name(experiment, given)
    values: dict[str, Any] = {}
    for name, text in texts.items():
        values[name], fault = parse_value(known[name], text)
        if fault:
            faults.append(f"{name}: {fault}")
    if faults:
        raise InvalidParameter(faults)
    return experiment.parameters_type(**values)


def texts_by_name(
    experiment: type[Experiment[Any]], given: Sequence[str], form: str = "name=value"
) -> tuple[dict[str, str], list[str]]:
    """Return the text after `name=` by the parameters' names, and the faults of these names.

    Args:
        experiment: whose parameters they are.
        given: texts.
        form: of each text, as a fault quotes it.
    """
    known = [v.name for v in experiment.parameters()]
    texts: dict[str, str] = {}
    faults: list[str] = []
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            faults.append(f"{text!r} is not of the form {form}")
        elif name not in known:
            near = known if len(faults) < MOST_FAULTS else ()  # of others the message has not the names
            hint = _SEEDS if name == "seed" and experiment.is_seeded else ""
            faults.append(UnknownParameter(f"{experiment.name} has no parameter", name, near, hint))
        elif name in texts:
            faults.append(f"{name} is given twice")
        else:
            texts[name] = value
    return texts, faults


def parameters_of(experiment: type[Experiment[Any]], kept: Mapping[str, Any]) -> Any:
    """Return the scenario's parameters from what `run.json` keeps of them.

    Raises:
        InvalidParameter: some are unknown to the scenario or out of range, as in a run of another version.
    """
    return parse_parameters(experiment, [f"{name}={_as_text(value)}" for name, value in kept.items()])


def idle_parameters(experiment: type[Experiment[Any]], parameters: Any) -> dict[str, str]:
    """Return the parameters that are not at their defaults though nothing comes of them, with what each needs."""
    variables = {v.name: v for v in experiment.parameters()}
    found: dict[str, str] = {}
    for name, needs in needs_of(parameters).items():
        v, lacking = variables[name], [need for need in needs if not need.is_met(parameters)]
        if lacking and text_of(v, getattr(parameters, name)) != text_of(v, v.start):
            found[name] = " and ".join(_needed(need, variables) for need in lacking)
    return found


def check_effects(experiment: type[Experiment[Any]], parameters: Any) -> None:
    """Reject parameters of which nothing comes, as others are.

    Raises:
        InvalidParameter: with what each needs to have an effect.
    """
    if idle := idle_parameters(experiment, parameters):
        raise InvalidParameter([idle_fault(name, needed) for name, needed in idle.items()])


def idle_fault(name: str, needed: str) -> str:
    """Return the fault of a parameter of which nothing comes."""
    return f"{name}: nothing comes of it unless {needed}"


def _needed(need: Need, variables: Mapping[str, Variable]) -> str:
    return " or ".join(_condition(variables[name], need.values) for name in need.names)


def _condition(v: Variable, values: Sequence[Any]) -> str:
    texts = [text_of(v, value) for value in values] or [item.lower() for item, number in v.items if number]
    if not texts:
        return f"{v.name} is set"
    return f"{v.name}={' or '.join(texts)}" if all(texts) else f"{v.name} is empty"


def parse_value(variable: Variable, text: str) -> tuple[Any, str | None]:
    """Return a parameter's value from its text, and its fault with the valid values, None if there is none."""
    value: Any = text
    given = 1
    if variable.kind is Kind.BOOLEAN:
        value = {"true": True, "false": False}.get(text.lower(), text)
    elif variable.kind in (Kind.REAL, Kind.INTEGER):
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        given = len(numbers)
        if variable.shape and numbers:
            value = np.array(numbers).reshape(variable.shape) if len(numbers) == variable.size else np.array(numbers)
        elif len(numbers) == 1:
            [number] = numbers
            value = int(number) if variable.kind is Kind.INTEGER and number.is_integer() else number
    fault = fault_of(variable, value)
    if fault is None and variable.enumeration is not None:
        value = next(e for e in variable.enumeration if e.name == str(text).upper())
    if fault is None and variable.kind is Kind.INTEGER:
        value = int(value)
    valid_range = range_of(variable)
    if fault and valid_range and valid_range not in fault:
        fault += f", {valid_range}"
    if fault and variable.shape and given not in (0, variable.size):
        fault += f": it takes {variable.size} numbers, {counted(given, 'is', 'are')} given"
    if fault and variable.shape and len(text.split()) > 1:
        fault += "; commas stand between the numbers"
    if fault and variable.items and (hint := suggestion(text, [n.lower() for n, _ in variable.items])):
        fault += f"; {hint}"
    return value, fault


def text_of(variable: Variable, value: Any) -> str:
    """Return the canonical text of a parameter's value: one for all texts that `parse_value` reads as this value."""
    if variable.kind is Kind.STRING:
        return str(value)
    if variable.kind is Kind.BOOLEAN:
        return str(bool(value)).lower()
    if variable.enumeration is not None:
        return str(value.name).lower()
    return ",".join(map(number_text, np.asarray(value).reshape(-1).tolist()))


def number_text(number: float) -> str:
    """Return the shortest text of a number that is read as it."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def _as_text(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(_as_text(v) for v in cast(list[Any], value))
    return repr(value) if isinstance(value, float) else str(value)
