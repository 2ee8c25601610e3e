"""Pages of the site that are made from declarations: units, scenarios, experiments, a run's folder, and the gallery.

`write` leaves Markdown in the site's folder. Ports, parameters, units of measurement and direct feedthrough are what
the blocks declare, laws their docstrings, and metrics those of runs. What has no description stops it: all such names
are listed at once.
"""

import enum
import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import click
import jinja2
from equations import with_latex
from gallery import GalleryExperiment, GalleryRun, metrics_of
from typing_extensions import TypeAliasType
from undocumented import Undocumented, commands, undocumented, undocumented_metrics

from handover.cosim.blocks import ports as port_declarations
from handover.cosim.blocks import units as unit_declarations
from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.variable import Variable
from handover.fmus.catalog import UNITS, Entry, import_class
from handover.fmus.contents.documentation import Row, cited, items, parse, row, seconds
from handover.fmus.layout import Form
from handover.scenarios.catalog import SCENARIOS, SYSTEMS
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.places import ports_of_place

DOCS = Path(__file__).parent


def write(folder: Path, runs: Mapping[str, GalleryRun], experiments: Mapping[str, GalleryExperiment]) -> None:
    """Write the pages into a folder; a page that is the same is left as it is.

    Raises:
        Undocumented: something has no description.
    """
    metrics = {
        name: metrics_of(runs[name], (e for e in experiments.values() if e.scenario == name)) for name in SCENARIOS
    }
    if names := [*undocumented(), *undocumented_metrics(metrics)]:
        raise Undocumented(names)
    loader = jinja2.FileSystemLoader(DOCS / "templates")
    templates = jinja2.Environment(
        loader=loader, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    templates.filters.update(cell=cell, seconds=seconds, sentence=sentence, unbroken=unbroken, unit_symbol=unit_symbol)
    robots = [(system, [UNITS[unit] for unit in system.units]) for system in SYSTEMS]
    of_system = {s.package: [n for n, e in experiments.items() if e.scenario in s.scenarios] for s in SYSTEMS}
    shown = {"robots": SYSTEMS, "runs": runs, "experiments": experiments, "of_system": of_system}
    pages: dict[str, tuple[str, Mapping[str, Any]]] = {
        "gallery": ("gallery", shown),
        "reference/units/index": ("units", {"robots": robots}),
        "reference/scenarios/index": ("scenarios", shown),
        "reference/experiments/index": ("experiments", shown),
        "reference/port_types": ("port_types", port_types()),
        "reference/run_folder": ("run_folder", {"statuses": statuses(), "variables": environment_variables()}),
    }
    for entry in UNITS.values():
        pages[f"reference/units/{entry.name}"] = ("unit", {"unit": entry, **unit(entry)})
    for system in SYSTEMS:
        for name in system.scenarios:
            campaigns = {n: e for n, e in experiments.items() if e.scenario == name}
            given = {"name": name, "run": runs[name], "experiments": campaigns, "metrics": metrics[name]}
            pages[f"reference/scenarios/{name}"] = ("scenario", {**given, **scenario(SCENARIOS[name])})
    for name, experiment in experiments.items():
        doc = parse(inspect.cleandoc(experiment.doc))
        pages[f"reference/experiments/{name}"] = ("experiment", {"name": name, "experiment": experiment, "doc": doc})
    for name, (template, given) in pages.items():
        text = templates.get_template(f"{template}.md").render(**given)
        file = folder / f"{name}.md"
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")
    for kind in ("units", "scenarios", "experiments"):
        for file in (folder / "reference" / kind).glob("*.md"):
            if f"reference/{kind}/{file.stem}" not in pages:
                file.unlink()


def unit(entry: Entry) -> dict[str, Any]:
    """Return what the page of a unit shows."""
    d = describe(import_class(entry.block))
    ports = (("Inputs", d.inputs, "start"), ("Outputs", d.outputs, "unit"))
    return {
        "declared": d,
        "doc": parse(with_latex(entry.name, d.doc)),
        "origin": d.module_doc.partition("\n\n")[0],
        "papers": cited("\n".join((d.module_doc, d.doc, *(v.description for v in d.variables)))),
        "parameters": _rows(entry.name, d.parameters),
        "ports": [(title, [row(v, Form.FMI3) for v in variables], start) for title, variables, start in ports],
        "feedthrough": _feedthrough(d),
        "enumerations": [(e.__name__, items(e)) for e in _enumerations(d.variables)],
        "scenarios": [name for name, kind in SCENARIOS.items() if entry.name in kind.units.values()],
        "hosts": hosts(entry.name),
    }


def scenario(kind: type[Experiment[Any]]) -> dict[str, Any]:
    """Return what the page of a scenario shows."""
    parameters = kind.parameters()
    rows = {"the scenario": _rows(kind.name, parameters)}
    for place, name in kind.units.items():
        declared = describe(import_class(UNITS[name].block)).parameters
        rows[f"`{place}`"] = _rows(name, declared)
    assumed = {of: [r.name for r, origin in listed if origin.startswith("assumed")] for of, listed in rows.items()}
    ports = {
        place: [(row(p.declared, Form.FMI3), p.declared.causality.value, p.is_required, p.text)
                for p in ports_of_place(needs, UNITS[kind.units[place]])]
        for place, needs in kind.places.items()
    }  # fmt: skip
    return {
        "title": kind.title,
        "doc": parse(inspect.cleandoc(kind.__doc__ or "")),
        "units": dict(kind.units),
        "parameters": rows["the scenario"],
        "enumerations": [(e.__name__, items(e)) for e in _enumerations(parameters)],
        "stop": kind().stop_time(kind.parameters_type()),
        "assumed": {of: (names, len(rows[of])) for of, names in assumed.items() if names},
        "places": [(place, kind.places[place].remarks, ports[place]) for place in kind.places],
    }


_STATUS = re.compile(r"^  (\d+) +(.*)$", re.MULTILINE)
_VARIABLE = re.compile(r"^  ([A-Z_]{4,}) +(.*(?:\n    +.*)*)$", re.MULTILINE)


def statuses() -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the exit statuses and their meaning by command, as its help has them; those of all commands first."""
    found = [(name, _STATUS.findall(_paragraph(command, "Exit status"))) for name, command in commands()]
    return [(name, listed) for name, listed in found if listed]


def environment_variables() -> dict[str, str]:
    """Return the environment variables and what they do, as the commands' help has them."""
    paragraphs = [_paragraph(command, "Environment") for _, command in commands()]
    return {name: " ".join(text.split()) for p in reversed(paragraphs) for name, text in _VARIABLE.findall(p)}


def port_types() -> dict[str, Any]:
    """Return the types by which blocks declare their ports: symbols by unit, shapes by array, and integers."""
    of_units = {n: t.__metadata__[0] for n, t in vars(unit_declarations).items() if get_origin(t) is Annotated}
    aliases = {n: get_args(t.__value__) for n, t in vars(port_declarations).items() if isinstance(t, TypeAliasType)}
    shapes = {n: more.extents for n, (_, more) in aliases.items() if isinstance(more, port_declarations.Shape)}
    return {
        "units": {n: unit.symbol for n, unit in of_units.items()},
        "arrays": {n: " × ".join(map(str, extents)) for n, extents in shapes.items()},
        "integers": [
            n for n, t in vars(port_declarations).items() if get_origin(t) is Annotated and get_args(t)[0] is int
        ],
    }


def cell(text: object) -> str:
    """Return a text as it stands in a cell of a table in Markdown."""
    return str(text).replace("|", "\\|").replace("\n", " ").replace("*", "\\*").replace("<", "&lt;")


def unbroken(text: str) -> str:
    """Return a text that stays on one line."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _feedthrough(d: Description) -> list[tuple[str, str]]:
    everything = tuple(v.name for v in d.inputs)
    return [
        (output, "all inputs" if inputs == everything and len(inputs) > 1 else ", ".join(f"`{i}`" for i in inputs))
        for output, inputs in d.feedthrough.items()
        if inputs
    ]


def _enumerations(variables: Iterable[Variable]) -> list[type[enum.IntEnum]]:
    return list(dict.fromkeys(v.enumeration for v in variables if v.enumeration is not None))


_WITHOUT_ORIGIN = {
    "seed": "follows from the run's seed",
    **dict.fromkeys(("hinges", "hinges_dynamic", "substep", "high_frequency_damping"), "numerical"),
    **dict.fromkeys(("link_2", "link_3", "method", "pressure"), "set by the scenarios"),
}
"""What is said of parameters that declare no origin."""


def _rows(of: str, variables: Sequence[Variable]) -> list[tuple[Row, str]]:
    """Return the rows of a table of variables, each with the origin of its value: status and place in the paper.

    Raises:
        Undocumented: a parameter has none.
    """
    origins = _WITHOUT_ORIGIN | {v.name: str(v.origin) for v in variables if v.origin}
    if lacking := [f"origin of {v.name} of {of}" for v in variables if v.name not in origins]:
        raise Undocumented(lacking)
    return [(_without_status(row(v, Form.FMI3), origins[v.name]), origins[v.name]) for v in variables]


def _without_status(shown: Row, origin: str) -> Row:
    """Return a row whose description does not repeat that the value is assumed, if its origin says so."""
    if not origin.startswith("assumed"):
        return shown
    return replace(shown, description=shown.description.removesuffix(" (assumed)"))


def _paragraph(command: click.Command, heading: str) -> str:
    """Return the lines of a command's help under headings that begin so."""
    parts = [part.strip("\n") for part in (command.help or "").split("\b")]
    return "\n".join(p.partition("\n\n")[0] for p in parts if p.startswith(heading))


def hosts(unit: str) -> tuple[list[str], list[list[str]]]:
    """Return the hosts, and by form how a unit agrees in each, as the page of all hosts has it."""
    text = (DOCS / "hosts.md").read_text(encoding="utf-8")
    header: list[str] = []
    rows: list[list[str]] = []
    for section in text.split("\n## ")[1:]:
        found = re.search(rf"^\| (`{unit}`) \|(.*) \|$", section, re.MULTILINE)
        if found:
            (columns,) = re.findall(r"^\| unit \| (.*) \|$", section, re.MULTILINE)
            header = columns.split(" | ")
            rows.append([section.partition("\n")[0], *(c.strip() for c in found[2].split(" | "))])
    return header, rows


def sentence(text: str) -> str:
    """Return a text with a capital letter at its beginning."""
    return text[:1].upper() + text[1:]
