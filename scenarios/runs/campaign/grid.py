"""Parses `name=values` texts into the points of a campaign; all faults are reported at once, with valid forms."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Causality, Declared, Kind, Variable
from handover.cosim.fmu.file.description import FmuPort
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, parse_value, text_of, texts_by_name
from handover.scenarios.runs.campaign.plan import MAX_RUNS
from handover.scenarios.runs.execution.file_experiment import settable_of
from handover.scenarios.runs.execution.selection import replacements
from handover.scenarios.runs.execution.unit_values import canonical_text, is_unit_value, unit_values


def parse_grid(experiment: type[Experiment[Any]], given: Sequence[str]) -> list[dict[str, str]]:
    """Return all combinations of the given parameters' values, the last parameter varying fastest.

    Values are `v1,v2,...`, of arrays `a,b,c;d,e,f;...`, or `START:STOP:N`, N evenly spaced numbers with both ends.
    `UNIT.NAME` is a unit's parameter. Where nothing is given, there is one point, which sets nothing.

    Raises:
        InvalidParameter: with every fault of the given texts.
    """
    known, settable = {v.name: v for v in experiment.parameters()}, settable_of(experiment)
    texts, faults = _texts_by_name(experiment, given, "name=v1,v2,... or name=START:STOP:N")
    axes: dict[str, list[str]] = {}
    for name, values in texts.items():
        port = None if settable is None else settable.port(name)
        axes[name], axis_faults = _axis(known[name], values) if name in known else _axis_of_unit(name, values, port)
        faults += [f"{name}: {fault}" for fault in axis_faults]
    points = math.prod(map(len, axes.values()))
    if points > MAX_RUNS:
        faults.append(f"the grid has {points:,} points; at most {MAX_RUNS:,} runs can be planned")
    if faults:
        raise InvalidParameter(faults)
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def set_parameters(
    experiment: type[Experiment[Any]],
    given: Sequence[str],
    varied: Sequence[Mapping[str, str]],
    several: str = "-p {0} takes one value; to vary it, give it without -p: {0}={1}",
) -> dict[str, str]:
    """Return the parameters that are the same at all points, in the order in which they are given.

    `several` says what is right instead of several values, by name and text.

    Raises:
        InvalidParameter: one is unknown, given twice, varied, or given several values.
    """
    fixed, faults = _texts_by_name(experiment, given, "name=value")
    both = [name for name in fixed if any(name in point for point in varied)]
    faults += [f"{name} is varied and set by -p; give one of them" for name in both]
    known, settable = {v.name: v for v in experiment.parameters()}, settable_of(experiment)
    for name, text in fixed.items():
        port = None if settable is None else settable.port(name)
        is_list = _is_list(known[name], text) if name in known else port is not None and _is_list_for(port, text)
        if name not in both and is_list:
            faults.append(several.format(name, text))
    if faults:
        raise InvalidParameter(faults)
    return fixed


def split_units(
    experiment: type[Experiment[Any]], given: Sequence[str]
) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """Return what takes units' places in all runs, and where several are given, `NAME=A,B`, what to vary them by.

    Raises:
        UsageError: as `replacements`.
        InvalidParameter: an item is empty or given twice, or a parameter of the scenario has the unit's name.
    """
    fixed: dict[str, str] = {}
    choices: dict[str, tuple[str, ...]] = {}
    faults: list[str] = []
    for name, text in replacements(experiment, given).items():
        items = tuple(text.split(","))
        if len(items) == 1 or Path(text).is_file():
            fixed[name] = text
            continue
        choices[name] = items
        if "" in items:
            faults.append(f"--unit {name}: {text!r} has an empty item")
        faults += [f"--unit {name}: {item} is given twice" for item in dict.fromkeys(items) if items.count(item) > 1]
        if name in {v.name for v in experiment.parameters()}:
            faults.append(
                f"--unit {name}: {experiment.name} has a parameter of that name, and a table has one column of it"
            )
    if faults:
        raise InvalidParameter(faults)
    return fixed, choices


def vary_units(points: Sequence[Mapping[str, str]], choices: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Return each point with all combinations of units; points stay together that differ in parameters only."""
    combinations = [dict(zip(choices, items, strict=True)) for items in itertools.product(*choices.values())]
    return [{**units, **point} for units in combinations for point in points]


def _texts_by_name(
    experiment: type[Experiment[Any]], given: Sequence[str], form: str
) -> tuple[dict[str, str], list[str]]:
    """Return the texts of the scenario's and of its units' parameters in the order in which they are given."""
    texts, faults = texts_by_name(experiment, [text for text in given if not is_unit_value(experiment, text)], form)
    try:
        texts |= unit_values(experiment, given)
    except InvalidParameter as e:
        faults += e.faults
    order = [text.partition("=")[0].strip() for text in given]
    return {name: texts[name] for name in dict.fromkeys(order) if name in texts}, faults


def _axis_of_unit(name: str, text: str, port: FmuPort | None = None) -> tuple[list[str], list[str]]:
    """Return the values of a unit's parameter as texts; what the unit takes is checked when its FMU is read.

    Of a file's parameter there is the `port`: only numbers have ranges, and values of arrays stand between `;`.
    """
    declared = Declared(name=name, kind=Kind.REAL, causality=Causality.PARAMETER) if port is None else port
    is_range = text.count(":") == 2 if port is None else ":" in text  # without its type it may be a text
    if is_range and declared.kind in (Kind.REAL, Kind.INTEGER):
        values, fault = _range(declared, text)
        return values, [fault] if fault else []
    values = _split(declared, text)
    if port is not None:
        values = [canonical_text(port, value) for value in values]
    faults = [f"{value} is given twice" for value in dict.fromkeys(values) if value and values.count(value) > 1]
    return values, [*faults, f"{text!r} has an empty item"] if "" in values else faults


def _is_list_for(port: FmuPort, text: str) -> bool:
    """Return whether a text is a list of several values of a file's parameter, and no single value."""
    is_text = port.kind in (Kind.STRING, Kind.BINARY)
    return not is_text and len(_axis_of_unit(port.name, text, port)[0]) > 1


def _is_list(variable: Variable, text: str) -> bool:
    """Return whether a text is a list of several values of a parameter, and no single value."""
    _, fault = parse_value(variable, text)
    if not fault:
        return False
    values, faults = _axis(variable, text)
    return len(values) > 1 and not faults


def _axis(variable: Variable, text: str) -> tuple[list[str], list[str]]:
    """Return the values of a parameter as texts, and what is wrong with them."""
    if not text:
        return [], ["the list of values is empty"]
    numbers = variable.kind in (Kind.REAL, Kind.INTEGER)
    if numbers and ":" in text:
        values, fault = _range(variable, text)
        if fault:
            return [], [fault]
    else:
        values = _split(variable, text)
    texts: dict[str, None] = {}
    faults: list[str] = []
    for value in values:
        parsed, fault = parse_value(variable, value)
        if not value and variable.kind is not Kind.STRING:
            faults.append(f"{text!r} has an empty item")
        elif fault:
            faults.append(fault)
        elif (canonical := text_of(variable, parsed)) in texts:
            faults.append(f"{value} is given twice")
        else:
            texts[canonical] = None
    return list(texts), list(dict.fromkeys(faults))


def _split(variable: Declared, text: str) -> list[str]:
    """Return the texts of single values: arrays, and texts with commas, are separated by `;`."""
    return text.split(";" if ";" in text or variable.shape else ",")


def _range(variable: Declared, text: str) -> tuple[list[str], str | None]:
    """Return the values of `START:STOP:N`, rounded to 12 digits: 0.3, not 0.30000000000000004."""
    malformed = f"{text!r} is not of the form START:STOP:N"
    parts = text.split(":")
    if variable.shape:
        return [], f"{variable.name} is an array, of which there are lists only, with ; between values"
    if len(parts) != 3:
        return [], f"{malformed}, such as 0.1:0.5:5"
    try:
        start, stop = float(parts[0]), float(parts[1])
    except ValueError:
        start = stop = math.nan
    if not math.isfinite(start) or not math.isfinite(stop):
        return [], f"{malformed}: START and STOP are finite numbers"
    digits = parts[2].lstrip("0") if parts[2].isascii() and parts[2].isdigit() else ""
    if digits in ("", "1"):
        return [], f"{malformed}: N is a whole number of values from 2 to {MAX_RUNS:,}"
    if len(digits) > len(str(MAX_RUNS)) or int(digits) > MAX_RUNS:
        return [], f"{text!r} has too many values: at most {MAX_RUNS:,} runs can be planned"
    if start == stop:
        return [], f"{text!r} begins where it ends; for one value write {parts[0]!r}"
    between = [f"{x:.12g}" for x in np.linspace(start, stop, int(parts[2])).tolist()]
    return [parts[0], *between[1:-1], parts[1]], None
