"""Pages of the site that are made from declarations: every unit, every scenario, their lists, and the gallery.

`write` leaves Markdown in the site's folder. Ports, parameters, units of measurement and direct feedthrough are what
the blocks declare, laws their docstrings, and the origins of a scenario's values those of its `paper.toml`.
"""

import enum
import inspect
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import jinja2
from gallery import gallery_run

from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.variable import Variable
from handover.fmus.catalog import UNITS, Entry, import_class
from handover.fmus.contents.documentation import Row, cited, items, parse, row, seconds
from handover.fmus.layout import Form
from handover.scenarios.catalog import SCENARIOS, SYSTEMS, RobotSystem
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.paper import parameter_origins

TEMPLATES = Path(__file__).parent / "templates"


def write(folder: Path, files: Path) -> None:
    """Write the pages into a folder, and into another the files of runs; a page that is the same is left as it is."""
    loader = jinja2.FileSystemLoader(TEMPLATES)
    templates = jinja2.Environment(
        loader=loader, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    templates.filters.update(cell=cell, seconds=seconds)
    runs = {name: gallery_run(name, files) for name in SCENARIOS}
    robots = [(system, [UNITS[unit] for unit in system.units]) for system in SYSTEMS]
    pages = {
        "reference/units/index.md": templates.get_template("units.md").render(robots=robots),
        "reference/scenarios/index.md": templates.get_template("scenarios.md").render(robots=SYSTEMS),
        "gallery.md": templates.get_template("gallery.md").render(robots=SYSTEMS, runs=runs),
    }
    for entry in UNITS.values():
        pages[f"reference/units/{entry.name}.md"] = templates.get_template("unit.md").render(unit=entry, **unit(entry))
    for system in SYSTEMS:
        for name in system.scenarios:
            facts = scenario(SCENARIOS[name], system)
            pages[f"reference/scenarios/{name}.md"] = templates.get_template("scenario.md").render(
                name=name, run=runs[name], **facts
            )
    for name, text in pages.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def unit(entry: Entry) -> dict[str, Any]:
    """Return what the page of a unit shows."""
    d = describe(import_class(entry.block))
    package = entry.block.split(".")[2]
    ports = (("Inputs", d.inputs), ("Outputs", d.outputs))
    return {
        "declared": d,
        "doc": parse(d.doc),
        "origin": d.module_doc.partition("\n\n")[0],
        "papers": cited("\n".join((d.module_doc, d.doc, *(v.description for v in d.variables)))),
        "parameters": _rows(package, d.parameters),
        "ports": [(title, [row(v, Form.FMI3) for v in variables]) for title, variables in ports],
        "feedthrough": _feedthrough(d),
        "enumerations": [(e.__name__, items(e)) for e in _enumerations(d.variables)],
        "scenarios": [name for name, kind in SCENARIOS.items() if entry.name in kind.units.values()],
    }


def scenario(kind: type[Experiment[Any]], system: RobotSystem) -> dict[str, Any]:
    """Return what the page of a scenario shows."""
    parameters = kind.parameters()
    return {
        "title": kind.title,
        "doc": parse(inspect.cleandoc(kind.__doc__ or "")),
        "units": dict(kind.units),
        "parameters": _rows(system.package, parameters),
        "enumerations": [(e.__name__, items(e)) for e in _enumerations(parameters)],
        "stop": kind().stop_time(kind.parameters_type()),
    }


def cell(text: object) -> str:
    """Return a text as it stands in a cell of a table in Markdown."""
    return str(text).replace("|", "\\|").replace("\n", " ").replace("*", "\\*").replace("<", "&lt;")


def _feedthrough(d: Description) -> list[tuple[str, str]]:
    everything = tuple(v.name for v in d.inputs)
    return [
        (output, "all inputs" if inputs == everything and len(inputs) > 1 else ", ".join(f"`{i}`" for i in inputs))
        for output, inputs in d.feedthrough.items()
        if inputs
    ]


def _enumerations(variables: Iterable[Variable]) -> list[type[enum.IntEnum]]:
    return list(dict.fromkeys(v.enumeration for v in variables if v.enumeration is not None))


def _rows(package: str, variables: Sequence[Variable]) -> list[tuple[Row, str]]:
    """Return the rows of a table of variables, each with the origin of its value: status and place in the paper."""
    origins = parameter_origins(package, (v.name for v in variables))
    entries = ((v, origins.get(v.name)) for v in variables)
    return [(row(v, Form.FMI3), f"{entry['status']}: {entry['where']}" if entry else "") for v, entry in entries]
