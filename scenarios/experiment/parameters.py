"""Turns `name=value` texts into a scenario's parameters; every fault is told at once, with what would be right."""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.start_values import fault_of, range_of
from handover.cosim.blocks.variable import Kind, Variable
from handover.cosim.exceptions import nearest
from handover.scenarios.experiment.experiment import Experiment


class InvalidParameter(ValueError):
    """Parameters that a scenario does not have, or values that they cannot take; `faults` lists them."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(faults)


def parse_parameters(experiment: type[Experiment[Any]], given: Sequence[str]) -> Any:
    """Return the scenario's parameters with the given ones set.

    Numbers are in SI units; arrays are numbers between commas; enumerations are given by name.

    Raises:
        InvalidParameter: with every fault of the given texts.
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
    """Return what stands behind `name=` by the parameters' names, and what is wrong with these.

    Args:
        experiment: whose parameters they are.
        given: texts.
        form: of each, as a fault tells it.
    """
    known = [v.name for v in experiment.parameters()]
    texts: dict[str, str] = {}
    faults: list[str] = []
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            faults.append(f"{text!r} is not of the form {form}")
        elif name not in known:
            faults.append(f"{experiment.name} has no parameter {name!r}; {nearest(name, known)}")
        elif name in texts:
            faults.append(f"{name} is given twice")
        else:
            texts[name] = value
    return texts, faults


def parameters_of(experiment: type[Experiment[Any]], kept: Mapping[str, Any]) -> Any:
    """Return the scenario's parameters as `run.json` keeps them.

    Raises:
        InvalidParameter: it keeps some that the scenario does not have, or values that they cannot take.
    """
    return parse_parameters(experiment, [f"{name}={_as_text(value)}" for name, value in kept.items()])


def parse_value(variable: Variable, text: str) -> tuple[Any, str | None]:
    """Return a parameter's value from its text, and what is wrong with it, saying what would be right, or None."""
    value: Any = text
    if variable.kind is Kind.BOOLEAN:
        value = {"true": True, "false": False}.get(text.lower(), text)
    elif variable.kind in (Kind.REAL, Kind.INTEGER):
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if variable.shape and numbers:
            value = np.array(numbers).reshape(variable.shape) if len(numbers) == variable.size else np.array(numbers)
        elif len(numbers) == 1:
            value = numbers[0]
    fault = fault_of(variable, value)
    if fault is None and variable.enumeration is not None:
        value = next(e for e in variable.enumeration if e.name == str(text).upper())
    if fault is None and variable.kind is Kind.INTEGER:
        value = int(value)
    wanted = range_of(variable)
    if fault and wanted and wanted not in fault:
        fault += f", {wanted}"
    if fault and variable.items and "did you mean" in (near := nearest(text, [n.lower() for n, _ in variable.items])):
        fault += f"; {near}"
    return value, fault


def text_of(variable: Variable, value: Any) -> str:
    """Return the text of a parameter's value, the same for all texts that `parse_value` takes for this value."""
    if variable.kind is Kind.STRING:
        return str(value)
    if variable.kind is Kind.BOOLEAN:
        return str(bool(value)).lower()
    if variable.enumeration is not None:
        return str(value.name).lower()
    return ",".join(map(_number_text, np.asarray(value).reshape(-1).tolist()))


def _number_text(number: float) -> str:
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def _as_text(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(_as_text(v) for v in cast(list[Any], value))
    return repr(value) if isinstance(value, float) else str(value)
