"""A start for a unit that takes a place of a scenario: with the ports that the scenario's own unit declares there."""

import ast
import builtins
import inspect
import sys
import textwrap
import typing
from collections.abc import Container, Iterable, Mapping, Sequence
from enum import IntEnum
from fractions import Fraction
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Causality, Kind, Variable
from handover.fmus.catalog import import_class
from handover.scenarios.cli.list import checked_ports_of_place, own_unit_of_place
from handover.scenarios.experiment.places import PlacePort
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.selection import find_scenario

_WIDTH = 118
_MOST_ENTRIES = 16
"""Entries of an array that are written out; a larger one starts as zeros."""

_UNIT = '''"""{class_name} takes the place {place} of {scenario}: a start that does nothing yet.

{remarks}All that is optional, too: handover list {scenario} --unit {place}
"""

{imports}
{enumerations}

@dataclass(frozen=True, kw_only=True)
class Params:
{parameters}


@dataclass(kw_only=True)
class Inputs:
{inputs}


@dataclass(kw_only=True)
class Outputs:
{outputs}


class {class_name}:
    """Gives the same all the time."""

    # which outputs depend on which inputs of the same instant
    feedthrough = {feedthrough}
    {period}

    def __init__(self, params: Params) -> None:
        self.params = params

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs({values})

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return {stepped}

    def get_state(self) -> bytes:
        return b""  # it remembers nothing

    def set_state(self, state: bytes) -> None:
        pass
'''
_OF_AN_INSTANT = "self.outputs(t, u)  # of the instant at which the step begins"
_TEST = '''"""{class_name} fits into its place."""

import handover


def test_it_takes_its_place():
    with handover.open("{scenario}", units={{"{place}": "{module}:{class_name}"}}) as running:
        running.step({step!r})
'''


def start_for(place: str, class_name: str, module: str) -> dict[str, str]:
    """Return the texts of a module and of its test, by file name, for a place such as `helix_handover:servo`.

    It has the inputs of the place, and the outputs and parameters that it must or should have, declared as the
    scenario's own unit declares them. What else is known of each stands above it. Outputs depend on inputs as those of
    that unit do, so that no algebraic loop arises where it has none, and stay where that unit's begin.

    Raises:
        UsageError: there is no such scenario or place, it does not say what a unit needs, or it needs an output of a
            kind that has no start, such as a text or a picture.
    """
    scenario, colon, name = place.rpartition(":")
    if not colon:
        raise UsageError(f"--for {place!r} is not of the form SCENARIO:PLACE, such as helix_handover:servo")
    experiment = find_scenario(scenario)
    own = own_unit_of_place(experiment, name)
    if name not in experiment.places:
        places = ", ".join(experiment.places) or "none"
        raise UsageError(f"{scenario} does not say what a unit in the place {name} needs; it does of: {places}")
    ports = checked_ports_of_place(experiment, name, own)
    block = import_class(own.block)
    advised = experiment.places[name].advised
    wanted = {
        c: [
            p
            for p in ports
            if p.declared.causality is c and (p.is_required or c is Causality.INPUT or p.declared.name in advised)
        ]
        for c in (Causality.PARAMETER, Causality.INPUT, Causality.OUTPUT)
    }
    first = _first_outputs(block)
    starts = {p.declared.name: _start(p.declared, first) for p in wanted[Causality.OUTPUT]}
    if odd := [output for output, start in starts.items() if start is None]:
        raise UsageError(f"{place}: {', '.join(odd)}: no start can be written for outputs of this kind")
    hints = typing.get_type_hints(block.step, include_extras=True)
    classes = {
        Causality.PARAMETER: typing.get_type_hints(block.__init__)["params"],
        Causality.INPUT: hints["u"],
        Causality.OUTPUT: hints["return"],
    }
    fields = {c: [_field(classes[c], p) for p in wanted[c]] for c in wanted}
    enumerations = {e.__name__: e for of in wanted.values() for p in of if (e := p.declared.enumeration) is not None}
    depends = _dependencies(block, wanted)
    sampled = block.period is not None or bool(depends)
    imports = {"from dataclasses import dataclass"}
    if sampled:
        imports.add("from fractions import Fraction")
    for c, declared in fields.items():
        imports |= _imports_of(classes[c], [text for _, text in declared], enumerations)
    if enumerations:
        imports.add("from enum import IntEnum")
    values = _arguments(starts)
    if "np." in values:
        imports.add("import numpy as np")
    step = Fraction(block.period or own.step)
    names = {"class_name": class_name, "module": module, "scenario": scenario, "place": name}
    text = _UNIT.format(
        **names,
        imports=_sorted(imports),
        parameters=_body(fields[Causality.PARAMETER]),
        inputs=_body(fields[Causality.INPUT]),
        outputs=_body(fields[Causality.OUTPUT]),
        enumerations="".join(map(_class_of, enumerations.values())),
        feedthrough=_feedthrough(depends),
        remarks="".join(f"{textwrap.fill(r, _WIDTH)}\n\n" for r in experiment.places[name].remarks),
        period=f"period = {step!r}" if sampled else "period = None  # steps of any size",
        stepped=_OF_AN_INSTANT if sampled else "self.outputs(t + dt, u)",
        values=values,
    )
    return {f"{module}.py": text, f"test_{module}.py": _TEST.format(**names, step=float(step))}


def _first_outputs(block: type[Any]) -> Any:
    """Return the outputs with which the scenario's own unit begins, with its default parameters and inputs.

    None where it begins with nothing: without pictures to look at, or on a machine that lacks what it needs.
    """
    hints = typing.get_type_hints(block.step)
    try:
        return block(typing.get_type_hints(block.__init__)["params"]()).outputs(0.0, hints["u"]())
    except Exception:  # anybody's block may raise anything of inputs that it never has
        return None


def _start(v: Variable, first: Any) -> str | None:
    """Return an output's value that says nothing, as Python's text; None for texts, pictures and the like."""
    if v.enumeration is not None and not v.shape:
        item = v.enumeration(int(getattr(first, v.name, next(iter(v.enumeration)))))
        return f"{v.enumeration.__name__}.{item.name}"
    if v.kind not in (Kind.REAL, Kind.INTEGER, Kind.BOOLEAN):
        return None
    value = np.asarray(getattr(first, v.name, v.start))
    if v.kind is Kind.REAL:
        value = np.where(np.isfinite(value), np.round(value, 6), 0.0) + 0.0  # without zeros below zero
    if not v.shape:
        return repr(value.item())
    if v.size <= _MOST_ENTRIES and value.any():
        return f"np.array({value.tolist()})"
    kind = {Kind.REAL: "", Kind.INTEGER: ", int", Kind.BOOLEAN: ", bool"}[v.kind]
    shape = v.shape if len(v.shape) > 1 or kind else v.size
    return f"np.zeros({shape}{kind})"


def _arguments(values: Mapping[str, str | None]) -> str:
    """Return named arguments, on lines of their own where one line does not hold them."""
    named = [f"{name}={value}" for name, value in values.items()]
    line = ", ".join(named)
    if len(line) < _WIDTH - 24:
        return line
    return "".join(f"\n            {argument}," for argument in named) + "\n        "


def _class_of(enumeration: type[IntEnum]) -> str:
    """Return the source of an enumeration with the same items."""
    items = "".join(f"    {item.name} = {item.value}\n" for item in enumeration)
    return f"\n\nclass {enumeration.__name__}(IntEnum):\n{items}"


def _dependencies(block: type[Any], wanted: Mapping[Causality, Sequence[PlacePort]]) -> dict[str, tuple[str, ...]]:
    """Return the inputs of which outputs depend directly, by output; without outputs that depend on none."""
    outputs, inputs = ([p.declared.name for p in wanted[c]] for c in (Causality.OUTPUT, Causality.INPUT))
    depends = {o: tuple(i for i in inputs if i in block.feedthrough.get(o, ())) for o in outputs}
    return {o: on for o, on in depends.items() if on}


def _feedthrough(depends: Mapping[str, tuple[str, ...]]) -> str:
    """Return on which inputs outputs depend, as Python's text."""
    if not depends:
        return "{}"
    of_inputs: dict[tuple[str, ...], list[str]] = {}
    for name, inputs in depends.items():
        of_inputs.setdefault(inputs, []).append(name)
    if len(of_inputs) == 1 and len(depends) > 1:
        ((inputs, outputs),) = of_inputs.items()
        return f"dict.fromkeys(({', '.join(map(repr, outputs))}), {_tuple(inputs)})".replace("'", '"')
    if len(depends) == 1:
        ((name, inputs),) = depends.items()
        return f'{{"{name}": {_tuple(inputs)}}}'
    return "{\n" + "".join(f'        "{n}": {_tuple(inputs)},\n' for n, inputs in depends.items()) + "    }"


def _tuple(inputs: Sequence[str]) -> str:
    names = ", ".join(f'"{n}"' for n in inputs) + ("," if len(inputs) == 1 else "")
    return f"({textwrap.fill(names, _WIDTH - 16, subsequent_indent=8 * ' ', break_on_hyphens=False)})"


def _field(declaring: type[Any], port: PlacePort) -> tuple[str, str]:
    """Return what the place adds to a port's description, and the port's declaration in the source."""
    text = _declarations(declaring)[port.declared.name]
    return port.addition, text


def _declarations(declaring: type[Any]) -> dict[str, str]:
    """Return the source of a dataclass's fields by name, those of its bases, too."""
    found: dict[str, str] = {}
    for c in reversed(declaring.__mro__[:-1]):
        source = textwrap.dedent(inspect.getsource(c))
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found[node.target.id] = textwrap.dedent(ast.get_source_segment(source, node, padded=True) or "")
    return found


def _imports_of(declaring: type[Any], texts: Iterable[str], own: Container[str]) -> set[str]:
    """Return the imports of all names in declarations but its own, as the module that declares them has them."""
    known: dict[str, str] = {}
    for c in declaring.__mro__[:-1]:
        for node in ast.parse(inspect.getsource(sys.modules[c.__module__])).body:
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                begin = f"from {node.module} import " if isinstance(node, ast.ImportFrom) else "import "
                for alias in node.names:
                    as_name = f" as {alias.asname}" if alias.asname else ""
                    known.setdefault(alias.asname or alias.name, f"{begin}{alias.name}{as_name}")
        known |= {n: f"from {c.__module__} import {n}" for n in vars(sys.modules[c.__module__]) if n not in known}
    nodes = [n for text in texts for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Name)]
    used = {n.id for n in nodes if isinstance(n.ctx, ast.Load) and not hasattr(builtins, n.id)}
    return {known[name] for name in used if name not in own}


def _sorted(imports: Iterable[str]) -> str:
    """Return imports as they are usually sorted: the standard library's, others', handover's; names of one together."""
    names: dict[str, set[str]] = {}
    for line in imports:
        begin, _, name = line.rpartition(" import ")
        names.setdefault(begin or line, set()).update({name} if begin else ())
    lines = [f"{begin} import {', '.join(sorted(of, key=_order))}" if of else begin for begin, of in names.items()]
    groups: dict[int, list[str]] = {0: [], 1: [], 2: []}
    for line in sorted(lines):
        package = line.split()[1].partition(".")[0]
        groups[2 if package == "handover" else 0 if package in sys.stdlib_module_names else 1].append(line)
    return "\n\n".join("\n".join(group) for group in groups.values() if group)


def _order(name: str) -> tuple[bool, str]:
    """Return what sorts imported names: classes and constants first."""
    return not name[0].isupper(), name.lower()


def _body(fields: Sequence[tuple[str, str]]) -> str:
    """Return the body of a dataclass, what is known of each field above it."""
    if not fields:
        return "    pass"
    lines: list[str] = []
    for remark, text in fields:
        if remark:
            lines += textwrap.wrap(remark, _WIDTH - 4, initial_indent="# ", subsequent_indent="# ")
        lines += text.strip().splitlines()
    return textwrap.indent("\n".join(lines), "    ")
