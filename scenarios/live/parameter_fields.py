"""What a page offers for parameters: fields with sliders and choices, by groups, and what is wrong with their values.

A value is a text all the way, as `handover run -p NAME=VALUE` takes it, so that a run from the page is that command's.
"""

import contextlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from handover.cosim.blocks.start_values import range_of
from handover.cosim.blocks.variable import Declared, Kind
from handover.cosim.fmu.file.description import FmuPort, describe_fmu
from handover.cosim.ssp.ssp_file import SspFile
from handover.scenarios.experiment.parameters import InvalidParameter, text_of
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.fmu_run import is_fmu
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.ssp_run import is_ssp

_SLIDERS = 4
"""Entries that an array of numbers may have for a slider each; a longer one is a line of text."""
_WIDEST = 30.0
"""How many times its default a declared range may reach for a slider to span it; a wider one is set around it."""
_REACH = 3.0
"""How far such a slider reaches from its default on either side, times the largest magnitude of its entries."""
_STEPS = 200
"""A slider's steps, at least."""
_OF_JACOBI = "parallel_step"
"""A parameter that acts under an algorithm alone which no run of a session has; shown where it is given."""
_CALL = re.compile(r" \(fmi\d\w+ answered \w+\)")
"""By which call of the standard a unit refused something."""


@dataclass(frozen=True, kw_only=True)
class ParameterField:
    """A parameter as a page shows it.

    Attributes:
        name: by which it is given.
        kind: `number`, `whole`, `choice`, `switch` or `text`.
        default: its value, as a text.
        unit, description, range: in words; the range is the declared one.
        items: of a choice.
        sliders: lowest value, highest value and step of each entry of a number.
    """

    name: str
    kind: str
    default: str
    unit: str = ""
    description: str = ""
    range: str = ""
    items: Sequence[str] = ()
    sliders: Sequence[tuple[float, float, float]] = ()


@dataclass(frozen=True)
class FieldGroup:
    """Fields under a heading, and whether they are seen at first."""

    title: str
    fields: Sequence[ParameterField]
    open: bool = True

    def as_data(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""
        return asdict(self)


def field_of(declared: Declared, default: str) -> ParameterField:
    """Return the field of a parameter whose value is a text, entries of an array with commas between them."""
    kind = {Kind.BOOLEAN: "switch", Kind.ENUMERATION: "choice", Kind.REAL: "number", Kind.INTEGER: "whole"}.get(
        declared.kind, "text"
    )
    field = ParameterField(
        name=declared.name,
        kind=kind,
        default=default,
        unit=declared.unit.shown,
        description=declared.description,
        range=range_of(declared),
        items=tuple(name.lower() for name, _ in declared.items),
    )
    if kind not in ("number", "whole"):
        return replace(field, kind="text") if declared.shape else field
    try:
        entries = [float(part) for part in default.split(",")]
    except ValueError:
        entries = []
    if not 0 < len(entries) <= _SLIDERS or not all(map(math.isfinite, entries)):
        return replace(field, kind="text")
    return replace(field, sliders=tuple(slider(declared, entry, entries) for entry in entries))


def slider(declared: Declared, default: float, defaults: Sequence[float]) -> tuple[float, float, float]:
    """Return lowest value, highest value and step of a slider: the declared range, or some of it around the default.

    Without a declared minimum, what is positive by default has a slider from 0: a mass is more likely than a shift.

    Args:
        declared: the parameter.
        default: the value of one entry.
        defaults: those of all entries.
    """
    far = max(map(abs, defaults)) or 1.0
    low = declared.minimum if declared.minimum is not None else 0.0 if min(defaults) > 0.0 else -math.inf
    high = math.inf if declared.maximum is None else declared.maximum
    least, most = low, high
    if not high - low <= _WIDEST * far:
        least, most = max(low, min(0.0, default - _REACH * far)), min(high, max(0.0, default + _REACH * far))
    if declared.kind is Kind.INTEGER:
        return math.floor(least), math.ceil(most), 1.0
    if not most > least:
        return least, most, 0.0
    step = 10.0 ** math.floor(math.log10((most - least) / _STEPS))
    rounded = math.floor(least / step) * step, math.ceil(most / step) * step
    return float(f"{max(low, rounded[0]):.6g}"), float(f"{min(high, rounded[1]):.6g}"), step


def field_groups(request: RunRequest) -> list[FieldGroup]:
    """Return the parameters of what is to be run, and of its units.

    Raises:
        UsageError, InvalidParameter, CosimError: as when it is run.
    """
    with contextlib.ExitStack() as opened:
        subject = str(request.subject)
        if is_ssp(subject):
            asked = request.open(opened)
            ssp = opened.enter_context(SspFile(request.path, request.step))
            return by_unit(ssp.parameters.items())
        if is_fmu(subject):
            d = describe_fmu(request.path)
            return [FieldGroup(d.name, [_of_port(p.name, p, p.start) for p in d.settable.values() if _is_shown(p)])]
        asked = request.open(opened)
        kind = type(asked.experiment)
        hidden = {_OF_JACOBI} - {text.partition("=")[0] for text in request.parameters}
        shown = [v for v in kind.parameters() if v.kind is not Kind.BINARY and v.name not in hidden]
        own = [field_of(v, text_of(v, v.start)) for v in shown]
        system = request.system(asked, request.seed, request.fmus(asked.experiment))
    ports = {
        f"{unit.name}.{name}": replace(port, start=_start_text(unit.start[name]) if name in unit.start else port.start)
        for unit in system.units.values()
        for name, port in unit.description.parameters.items()
    }
    groups = [FieldGroup(kind.name, own)] if own else []
    return groups + by_unit(ports.items(), open=not own)


def by_unit(ports: Iterable[tuple[str, FmuPort]], *, open: bool = True) -> list[FieldGroup]:  # noqa: A002
    """Return parameters of units, named `UNIT.NAME`, by their units; those of a system come first."""
    groups: dict[str, list[ParameterField]] = {}
    for name, port in ports:
        if _is_shown(port):
            groups.setdefault(name.rpartition(".")[0], []).append(_of_port(name, port, port.start))
    return [FieldGroup(f"unit {unit}" if unit else "system", fields, open) for unit, fields in sorted(groups.items())]


def _is_shown(port: FmuPort) -> bool:
    return port.kind is not Kind.BINARY


def _of_port(name: str, port: FmuPort, start: str | None) -> ParameterField:
    text = start or ""
    if port.kind is Kind.ENUMERATION:
        names = {str(value): item.lower() for item, value in port.items}
        text = names.get(text, text.lower())
    elif port.kind is not Kind.STRING:
        text = ",".join(text.split())
    return replace(field_of(port, text), name=name)


def _start_text(value: Any) -> str:
    """Return a start value as an FMU writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    entries = value.reshape(-1).tolist() if hasattr(value, "reshape") else [value]
    return " ".join(str(entry) for entry in entries)


def faults_by_name(request: RunRequest, names: Sequence[str]) -> dict[str, str]:
    """Return what is wrong with what is to be run, by the parameter's name; under "" what is not a parameter's.

    Args:
        request: says what is to be run.
        names: of parameters that there are.
    """
    try:
        with one_line_errors(), contextlib.ExitStack() as opened:
            try:
                request.check_options()
                asked = request.open(opened)
                request.system(asked, request.seed, request.fmus(asked.experiment))
            except InvalidParameter as e:
                return _by_name(e.faults, names)
    except UsageError as e:
        return _by_name([e.message], names)
    return {}


def _by_name(faults: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    found: dict[str, list[str]] = {}
    for fault in faults:
        found.setdefault(named_in(fault, names), []).append(without_call(fault))
    return {name: "; ".join(texts) for name, texts in found.items()}


def without_call(fault: str) -> str:
    """Return a fault without the call of the standard that a unit refused it by, which tells a user nothing."""
    return _CALL.sub("", fault)


def named_in(fault: str, names: Sequence[str]) -> str:
    """Return the parameter whose fault it is: the one that it names first; "" if it names none."""
    text = re.sub(r"^unit (\w+): ", r"\1.", fault)
    places: Mapping[str, int] = {
        name: found.start() for name in names if (found := re.search(rf"(?<![\w.]){re.escape(name)}(?![\w.]\w)", text))
    }
    return min(places, key=lambda name: (places[name], -len(name)), default="")
