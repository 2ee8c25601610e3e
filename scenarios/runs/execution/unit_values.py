"""Values of units' parameters from texts: of one FMU that runs by itself, or of any unit of a scenario's system.

`-p servo.gain=0.5` sets the parameter `gain` of the unit `servo`, whatever FMU is in its place: it is checked against
what that FMU declares, and replaces what the scenario would set. Values are in the FMU's own units of measurement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.exceptions import CosimError, counted, nearest
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.start_values import entries_of
from handover.cosim.system.system import PlacedUnit, System
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import (
    InvalidParameter,
    UnknownParameter,
    number_text,
    parse_parameters,
    text_of,
)
from handover.scenarios.runs.execution.file_experiment import SettableParameters, settable_of
from handover.scenarios.runs.execution.input_file import columns_of, value_of
from handover.scenarios.runs.results.tolerated_faults import scenario_code


def start_values(ports: Mapping[str, FmuPort], given: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """Return start values by port, and what is wrong with the texts.

    Args:
        ports: the parameters, inputs and other variables that can be given.
        given: texts `NAME=VALUE`; an array's values stand with commas between them, or `NAME[1]=VALUE` gives one.
    """
    entries, faults = columns_of(ports), list[str]()
    start: dict[str, Any] = {}
    seen: set[str] = set()
    names = {text.partition("=")[0].strip() for text in given}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        array = entries[name][0].name if name in entries else name
        if not equals:
            faults.append(f"{text!r} is not of the form NAME=VALUE")
        elif array != name and array in names:
            faults.append(f"{array} and {name} are both given; give the array, or entries of it")
        elif name in seen:
            faults.append(f"{name} is given twice")
        elif name not in ports and name not in entries:
            faults.append(unknown_name(ports, name))
        else:
            port, k = (ports[name], None) if name in ports else entries[name]
            try:
                _set(start, port, k, value)
            except ValueError as e:
                faults.append(f"{name} = {value[:40]!r}: {e}")
        seen.add(name)
    return start, faults


def unknown_name(ports: Mapping[str, FmuPort], name: str) -> str:
    """Return the fault of a name that is none of some ports, with the nearest of theirs."""
    causalities = dict.fromkeys(p.causality for p in ports.values())
    kinds = [c.value for c in causalities if c in (Causality.PARAMETER, Causality.INPUT)] or ["parameter"]
    return UnknownParameter(f"no {' or '.join(kinds)}", name, ports)


def _set(start: dict[str, Any], port: FmuPort, k: int | None, text: str) -> None:
    """Set a port's start value from its text, or with a number the entry of that place only.

    Raises:
        ValueError: it is not a value of the port.
    """
    if port.kind in (Kind.STRING, Kind.BINARY):
        start[port.name] = text if port.kind is Kind.STRING else bytes.fromhex(text)
        return
    if k is None:
        values = _entries(port, text.split(","))
        if len(values) != port.size:
            raise ValueError(f"{len(values)} values where {counted(port.size, 'is', 'are')} right")
    else:
        values = entries_of(port, start)
        values[k] = value_of(port, text)
    if port.kind is Kind.BOOLEAN:
        values = [bool(value) for value in values]
    start[port.name] = np.array(values).reshape(port.shape) if port.shape else values[0]


def _entries(port: FmuPort, parts: Sequence[str]) -> list[Any]:
    values: list[Any] = []
    for part in parts:
        try:
            values.append(value_of(port, part))
        except ValueError as e:
            raise ValueError(f"{part!r}: {e}" if len(parts) > 1 else str(e)) from None
    return values


def is_unit_value(experiment: type[Experiment[Any]], text: str) -> bool:
    """Return whether a text `NAME=VALUE` is of a unit's parameter, `UNIT.NAME=VALUE`, and not of the scenario's.

    All parameters of a file are those of its units.
    """
    return settable_of(experiment) is not None or "." in text.partition("=")[0]


def unit_values(experiment: type[Experiment[Any]], given: Sequence[str]) -> dict[str, str]:
    """Return the values of units' parameters among the given texts, by `UNIT.NAME`; of a file by its own names.

    Raises:
        InvalidParameter: a text is of another form, names no unit of the scenario or no parameter of the file, or is
            given twice.
    """
    if (settable := settable_of(experiment)) is not None:
        return _values_of_file(settable, given)
    values: dict[str, str] = {}
    faults: list[str] = []
    for text in given:
        if not is_unit_value(experiment, text):
            continue
        name, equals, value = text.partition("=")
        unit, _, port = name.partition(".")
        if not equals or not port:
            faults.append(f"{text!r} is not of the form UNIT.NAME=VALUE")
        elif unit not in experiment.units:
            faults.append(f"{experiment.name} has no unit {unit!r}; {nearest(unit, experiment.units)}")
        elif name in values:
            faults.append(f"{name} is given twice")
        else:
            values[name] = value
    if faults:
        raise InvalidParameter(faults)
    return values


def _values_of_file(settable: SettableParameters, given: Sequence[str]) -> dict[str, str]:
    values: dict[str, str] = {}
    faults: list[str] = []
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            faults.append(f"{text!r} is not of the form NAME=VALUE")
        elif name in values:
            faults.append(f"{name} is given twice")
        elif (port := settable.port(name)) is None:
            faults.append(unknown_name(settable.ports, name))
        else:
            values[name] = canonical_text(port, value)
    if faults:
        raise InvalidParameter(faults)
    return values


def canonical_text(port: FmuPort, text: str) -> str:
    """Return the one text for all texts of a value of a file's parameter: `1`, `1.0` and `+1` are the same number.

    What is not a value of the parameter stays as it is.
    """
    try:
        if port.kind is Kind.REAL:
            return ",".join(number_text(float(part)) for part in text.split(","))
        if port.kind is Kind.INTEGER:
            return ",".join(str(int(part)) for part in text.split(","))
        if port.kind is Kind.BOOLEAN:
            return ",".join(str(bool(value_of(port, part))).lower() for part in text.split(","))
    except ValueError:
        pass
    return text.strip() if port.kind is Kind.ENUMERATION else text


def split_parameters(experiment: type[Experiment[Any]], given: Sequence[str]) -> tuple[Any, dict[str, str]]:
    """Return the scenario's parameters, and values of its units' parameters, from texts.

    Raises:
        InvalidParameter: with all faults of the texts.
    """
    faults: list[str] = []
    values: dict[str, str] = {}
    parameters: Any = None
    try:
        values = unit_values(experiment, given)
    except InvalidParameter as e:
        faults += e.faults
    try:
        parameters = parse_parameters(experiment, [text for text in given if not is_unit_value(experiment, text)])
    except InvalidParameter as e:
        faults += e.faults
    if faults:
        raise InvalidParameter(faults)
    return parameters, values


def built_system(
    experiment: Experiment[Any], parameters: Any, seed: int, fmus: Mapping[str, Path], values: Mapping[str, str]
) -> System:
    """Return a scenario's system, with its units' parameters set as given.

    Args:
        experiment: the scenario.
        parameters: its parameters.
        seed: of its random numbers.
        fmus: the FMU of each unit.
        values: texts by `UNIT.NAME`, see `unit_values`.

    Raises:
        InvalidFmu: a file is none. InvalidParameter: a value is none that the unit takes; or as the scenario raises it.
        ScenarioFailed: the code of a scenario that is not this package's failed.
    """
    with scenario_code(experiment):
        system = experiment.wire(parameters, seed, lambda unit: fmus[unit])
    set_values(system, values)
    with scenario_code(experiment):
        experiment.check_unit_values(system, tuple(values))
    return system


def settings_behind(
    unit: str, experiment: Experiment[Any], parameters: Any, seed: int, fmus: Mapping[str, Path]
) -> str:
    """Return which values of a unit follow from what of the scenario's parameters was set, as the end of a sentence.

    The scenario is wired again with each of them at its default: a start value that then differs follows from it.
    """

    def start_with(values: Any) -> Mapping[str, Any]:
        return experiment.wire(values, seed, lambda name: fmus[name]).units[unit].start

    usual, found = experiment.parameters_type(), list[str]()
    pairs = [(v, getattr(parameters, v.name), getattr(usual, v.name)) for v in experiment.parameters()]
    changed = [(v, value, default) for v, value, default in pairs if not np.array_equal(value, default)]
    start: Mapping[str, Any] = start_with(parameters) if changed else {}
    for v, value, default in changed:
        try:
            other = start_with(replace(parameters, **{v.name: default}))
        except (InvalidParameter, CosimError):  # the default does not go with what else was set
            continue
        either: dict[str, Any] = {**start, **other}
        if ports := [n for n in either if not _equal(n, start, other)]:
            found.append(f"{v.name}={text_of(v, value)} sets its {', '.join(ports)}")
    return f"; {'; '.join(found)}" if found else ""


def _equal(name: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    return name in a and name in b and np.array_equal(a[name], b[name])


def check_value(experiment: Experiment[Any], system: System, name: str, text: str) -> None:
    """Check one value of a unit's parameter by itself, see `unit_values`; it is set in a scenario's system.

    Raises:
        InvalidParameter: its unit does not take it.
    """
    settable = settable_of(type(experiment))
    if settable is None:
        set_values(system, {name: text})
    elif faults := settable.faults([f"{name}={text}"]):
        raise InvalidParameter(faults)


def set_values(system: System, values: Mapping[str, str]) -> None:
    """Set the units' parameters of a system, given as texts by `UNIT.NAME`.

    Raises:
        InvalidParameter: with each value that is none that its unit takes; nothing is set.
    """
    faults: list[str] = []
    units: dict[str, PlacedUnit] = {}
    for name, unit in system.units.items():
        given = [f"{n.partition('.')[2]}={text}" for n, text in values.items() if n.partition(".")[0] == name]
        d = unit.description
        start, of_unit = start_values({**d.parameters, **d.initial}, given)
        units[name] = replace(unit, start={**unit.start, **start}) if start else unit
        faults += [f"unit {name}: {fault}" for fault in of_unit]
    if faults:
        raise InvalidParameter(faults)
    system.units = units
