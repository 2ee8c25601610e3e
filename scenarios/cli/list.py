"""The command `handover list`: scenarios and units, their parameters and ports."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from handover.cosim.blocks.description import Description, describe
from handover.cosim.blocks.variable import Causality
from handover.cosim.exceptions import nearest
from handover.fmus.catalog import (
    UNITS,
    Entry,
    PackageFailure,
    UnknownBlock,
    UnknownUnit,
    find_unit,
    import_class,
    installed_units,
)
from handover.scenarios.catalog import (
    SCENARIOS,
    SYSTEMS,
    InvalidScenario,
    installed_scenarios,
    named_scenario,
    search_folder,
)
from handover.scenarios.cli.console import open_console, print_json, print_rows
from handover.scenarios.cli.options import PATH
from handover.scenarios.cli.summaries.port_tables import allowed, plain, port_rows, type_of, variable_data
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.places import PlacePort, ports_of_place
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import doing
from handover.scenarios.runs.execution.selection import find_scenario, python_file_fault
from handover.scenarios.runs.results.run_folder import check_place


@click.command("list", short_help="List scenarios and units, or what one of them takes and gives.")
@click.argument("name", required=False, metavar="[SCENARIO|UNIT]")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON, for programs.")
@click.option(
    "--unit",
    "place",
    metavar="NAME",
    help="Of a SCENARIO: list what a unit needs to take the place of its unit NAME.",
)
@click.option(
    "--html",
    "page",
    metavar="FILE",
    type=PATH,
    help="Write all units with icons, parameters and ports into a page that opens offline, or replace it.",
)
def list_command(name: str | None, place: str | None, page: Path | None, *, as_json: bool) -> None:
    """List scenarios and units, the parameters of a SCENARIO, or parameters and ports of a UNIT.

    Either can be your own, named MODULE:CLASS, such as my_scene:TwoLinkReach for the class TwoLinkReach in my_scene.py;
    modules are looked for in the working directory, too.
    """
    if page is not None:
        if name is not None or place is not None or as_json:
            raise UsageError("--html is for all units: without SCENARIO, UNIT, --unit and --json")
        _write_page(page)
        return
    data, show = _subject(name, place)
    if as_json:
        print_json(data())
    else:
        show()


def _write_page(file: Path) -> None:
    with one_line_errors():
        if file.suffix.lower() not in (".html", ".htm") or file.is_dir():
            raise UsageError(f"--html {file}: name a file for the page that ends with .html")
        require_extra("reports", "the page")
        check_place(file.parent)
        from handover.scenarios.cli.units.units_page import write_units_page  # loads what pages are made of

        with doing("writing the page"):
            write_units_page(file)
    click.echo(file)


def _subject(name: str | None, place: str | None) -> tuple[Callable[[], dict[str, Any]], Callable[[], None]]:
    """Return what gives the data of what is asked for, and what prints it.

    Raises:
        UsageError: there is no such scenario or unit.
    """
    if place is not None:
        if name is None:
            raise UsageError("--unit is for a SCENARIO: handover list SCENARIO --unit NAME")
        scenario = find_scenario(name)
        return partial(place_data, scenario, place), partial(print_place, scenario, place)
    if name is None:
        return catalog_data, print_catalog
    if (unit := _unit(name)) is not None:
        return partial(unit_data, unit), partial(print_unit, unit)
    if ":" in name or name in SCENARIOS or name in installed_scenarios():
        scenario = find_scenario(name)
        return partial(scenario_data, scenario), partial(print_scenario, scenario)
    if fault := python_file_fault(name, "a unit or a scenario", ["step", "build"]):
        raise UsageError(f"{name}: {fault}")
    if Path(name).suffix.lower() in (".fmu", ".ssp", ".ssd"):
        raise UsageError(f"{name}: what is in a file is listed by `handover info {name}`")
    valid = [*SCENARIOS, *installed_scenarios(), *UNITS, *installed_units()]
    raise UsageError(f"no scenario or unit {name!r}: {nearest(name, valid)}")


def _unit(name: str) -> Entry | None:
    """Return the unit of a name or a block's path, None if it is none."""
    if name in UNITS:
        return UNITS[name]
    if ":" in name:
        search_folder(Path.cwd())
    try:
        if ":" in name and issubclass(import_class(name), Experiment):
            return None
        return find_unit(name)
    except UnknownUnit:
        return None
    except UnknownBlock as e:
        raise UsageError(str(e)) from e


def print_catalog() -> None:
    """Print the scenarios and the units of each robot system, a line each."""
    console = open_console()
    width = max(map(len, [*SCENARIOS, *UNITS]))
    for system in SYSTEMS:
        console.print(system.title, style="bold")
        for heading, rows in (
            ("scenarios", [(name, entry.title) for name, entry in system.scenarios.items()]),
            ("units", [(name, UNITS[name].summary) for name in system.units]),
        ):
            console.print(f"  {heading}", style="italic")
            print_rows(console, [("", name.ljust(width), summary) for name, summary in rows])
    print_installed(console, width)
    if others := sorted(set(UNITS) - {unit for system in SYSTEMS for unit in system.units}):
        console.print("Other units", style="bold")
        print_rows(console, [("", name.ljust(width), UNITS[name].summary) for name in others])


def print_installed(console: Console, width: int) -> None:
    """Print the scenarios and units of other packages."""
    scenarios = [(name, _title(name)) for name in installed_scenarios()]
    units = list(installed_units().items())
    if scenarios or units:
        console.print("Of other packages", style="bold")
    for heading, rows in (("scenarios", scenarios), ("units", units)):
        if rows:
            console.print(f"  {heading}", style="italic")
            print_rows(console, [("", name.ljust(width), summary) for name, summary in rows])


def _title(name: str) -> str:
    try:
        return named_scenario(name).title
    except InvalidScenario as e:
        return f"(not usable) {e}"


def print_scenario(experiment: type[Experiment[Any]]) -> None:
    """Print a scenario's parameters with defaults and ranges, and its units."""
    console = open_console()
    console.print(f"{experiment.name}: {experiment.title}", style="bold")
    console.print("Parameters, to be set with -p name=value")
    print_rows(console, [(v.name, plain(v.start), allowed(v), v.description) for v in experiment.parameters()])
    console.print("Units, to be replaced with --unit name=file.fmu or name=module:Class")
    print_rows(console, list(experiment.units.items()))
    for name, kind in list(experiment.units.items())[:1]:
        text = f"A unit's own parameters are set with -p {name}.parameter=value: handover list {kind}"
        console.print(text, markup=False, soft_wrap=True)
    if experiment.places:
        text = f"What a unit needs to take a place: handover list {_named(experiment)} --unit name"
        console.print(text, markup=False, soft_wrap=True)


def _named(experiment: type[Experiment[Any]]) -> str:
    """Return the name by which commands find a scenario."""
    known = experiment.name in SCENARIOS or experiment.name in installed_scenarios()
    return experiment.name if known else f"{experiment.__module__}:{experiment.__name__}"


def own_unit_of_place(experiment: type[Experiment[Any]], name: str) -> Entry:
    """Return the unit that a scenario ships with in a place.

    Raises:
        UsageError: the scenario has no such unit.
    """
    if name not in experiment.units:
        raise UsageError(f"{experiment.name} has no unit {name!r}: {nearest(name, experiment.units)}")
    try:
        return find_unit(experiment.units[name])
    except (UnknownUnit, UnknownBlock) as e:
        raise UsageError(f"unit {name}: {e}") from e


def checked_ports_of_place(experiment: type[Experiment[Any]], name: str, own: Entry) -> list[PlacePort]:
    """Return a place's ports and parameters.

    Raises:
        UsageError: the scenario's own unit does not declare one of them, or cannot be imported.
    """
    try:
        return ports_of_place(experiment.places[name], own)
    except KeyError as e:
        raise UsageError(
            f"{experiment.name}, place {name}: {e.args[0]!r} is not a port or parameter of {own.name}"
        ) from e
    except UnknownBlock as e:
        raise UsageError(f"unit {name}: {e}") from e


def place_data(experiment: type[Experiment[Any]], name: str) -> dict[str, Any]:
    """Return what a unit needs to take a place, as JSON can hold it; `ports` is None where that is not declared.

    Raises:
        UsageError: the scenario has no such unit.
    """
    own, place = own_unit_of_place(experiment, name), experiment.places.get(name)
    data = {"scenario": experiment.name, "place": name, "unit": own.name}
    if place is None:
        return {**data, "remarks": [], "ports": None}
    ports = [
        {
            **variable_data(p.declared),
            "causality": p.declared.causality.value,
            "required": p.is_required,
            "description": p.text,
        }
        for p in checked_ports_of_place(experiment, name, own)
    ]
    return {**data, "remarks": list(place.remarks), "ports": ports}


def print_place(experiment: type[Experiment[Any]], name: str) -> None:
    """Print what a unit must have and may have to take the place of one of a scenario's.

    Raises:
        UsageError: the scenario has no such unit.
    """
    own = own_unit_of_place(experiment, name)
    if name not in experiment.places:
        text = f"{experiment.name} does not say what a unit in the place {name} may lack; its own, {own.name}, has:"
        open_console().print(text, markup=False, soft_wrap=True)
        print_unit(own)
        return
    console = open_console()
    place = experiment.places[name]
    console.print(f"{experiment.name}, place {name}: {own.name} or a unit of your own", style="bold")
    for remark in place.remarks:
        console.print(remark, markup=False)
    ports = checked_ports_of_place(experiment, name, own)
    for is_required, needed in ((True, "required"), (False, "optional")):
        for causality, what in (
            (Causality.INPUT, "Inputs"),
            (Causality.OUTPUT, "Outputs"),
            (Causality.PARAMETER, "Parameters"),
        ):
            rows = [
                (p.declared.name, type_of(p.declared), allowed(p.declared), p.text)
                for p in ports
                if p.is_required is is_required and p.declared.causality is causality
            ]
            if rows:
                console.print(f"{what}, {needed}", style="bold")
                print_rows(console, rows)
    console.print("Optional ones that a unit does not have are left out of the wiring, and what is shown of them.")


def _described(unit: Entry) -> Description:
    """Return what a unit declares.

    Raises:
        UsageError: a package that it needs is missing.
    """
    try:
        return describe(import_class(unit.block))
    except PackageFailure as e:
        raise UsageError(str(e)) from e


def print_unit(unit: Entry) -> None:
    """Print a unit's parameters with defaults and ranges, its inputs and its outputs."""
    console, d = open_console(), _described(unit)
    step = "sampled every" if d.period is not None else "stepped by, for instance,"
    console.print(f"{unit.name}: {unit.summary}", style="bold")
    console.print(f"{step} {float(unit.step) * 1000:.4g} ms")
    for heading, variables in (("Parameters", d.parameters), ("Inputs", d.inputs), ("Outputs", d.outputs)):
        if variables:
            console.print(heading, style="bold")
            print_rows(console, port_rows(variables))


def catalog_data() -> dict[str, Any]:
    """Return names and titles of all scenarios and units, as JSON can hold them."""
    scenarios = {name: entry.title for system in SYSTEMS for name, entry in system.scenarios.items()}
    units = {name: unit.summary for name, unit in UNITS.items()}
    return {
        "scenarios": scenarios | {name: _title(name) for name in installed_scenarios()},
        "units": units | dict(installed_units()),
    }


def scenario_data(experiment: type[Experiment[Any]]) -> dict[str, Any]:
    """Return a scenario's parameters and units, as JSON can hold them."""
    parameters = [variable_data(v) for v in experiment.parameters()]
    return {
        "name": experiment.name,
        "title": experiment.title,
        "parameters": parameters,
        "units": dict(experiment.units),
    }


def unit_data(unit: Entry) -> dict[str, Any]:
    """Return a unit's parameters and ports, as JSON can hold them; its step is in seconds."""
    d = _described(unit)
    named = {"parameters": d.parameters, "inputs": d.inputs, "outputs": d.outputs}
    variables = {kind: [variable_data(v) for v in of_kind] for kind, of_kind in named.items()}
    facts = {"name": unit.name, "summary": unit.summary, "step": float(unit.step), "sampled": d.period is not None}
    return {**facts, **variables}
