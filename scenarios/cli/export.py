"""The command `handover export`: a scenario as an SSP."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.ssp.writing import bound_enumerations, write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.scenarios.cli.options import PATH, check_new_file, refused_if_taken, scenario_options
from handover.scenarios.experiment.parameters import check_effects
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.execution.selection import find_scenario, replacements, select_fmus
from handover.scenarios.runs.execution.unit_values import built_system, split_parameters
from handover.scenarios.runs.results.tolerated_faults import scenario_code

_HELP = """Write a SCENARIO as an SSP (System Structure and Parameterization), which other tools load.

Its units are FMI 2 FMUs, or FMI 3 where FMI 2 cannot express them (pictures). The SSP is of version 1.0, or of 2.0 if a
unit is of FMI 3. Parameters are bound in files of their own (SSV), one for each unit; but enumerations, which other
tools do not take there, are start values of the FMUs.
"""


@click.command(
    "export",
    help=_HELP,
    short_help="Write a SCENARIO as an SSP, for other tools.",
    context_settings={"show_default": True},
)
@click.argument("scenario")
@click.option("--ssp", "file", required=True, type=PATH, metavar="FILE", help="File to write.")
@click.option("--force", is_flag=True, help="Replace FILE if it is there.")
@scenario_options
def export_command(
    scenario: str, file: Path, parameters: Sequence[str], seed: int, replaced: Sequence[str], *, force: bool
) -> None:
    """Write a SCENARIO as an SSP."""
    experiment = find_scenario(scenario)
    with Interruption(), one_line_errors():
        values, of_units = split_parameters(experiment, parameters)
        check_effects(experiment, values)
        if file.suffix.lower() != ".ssp":
            raise UsageError(f"--ssp {file}: expected a name that ends with .ssp; other tools know the file by it")
        check_new_file(f"--ssp {file}", file, force=force)
        others = replacements(experiment, replaced)
        with doing("building units"):
            fmus = select_fmus(experiment, others, exchangeable)
        instance = experiment()
        with scenario_code(instance):
            stop = instance.stop_time(values)
        system = built_system(instance, values, seed, fmus, of_units)
        start_from_enumerations(system, {n: unit for n, unit in experiment.units.items() if n not in others})
        warn_of_enumerations(system, others)
        try:
            with refused_if_taken(f"--ssp {file}"):
                write_ssp(system, file, experiment.name, stop, instance.step_in_parallel(values), replace=force)
        except OSError as e:
            raise UsageError(f"--ssp {file}: it cannot be written: {e.strerror}") from e
        for line in system.remarks:
            say(line)
    click.echo(file)


def exchangeable(unit: str, start: Mapping[str, Any] | None = None) -> Path:
    """Return a catalog's unit as most tools load it, FMI 2 or FMI 3 without arrays; `start` as in `cached`."""
    try:
        return cached(unit, 2, start=start)
    except NoFmi2Form:
        return cached(unit, 3, scalar=True, start=start)


def start_from_enumerations(system: System, built: Mapping[str, str]) -> None:
    """Let enumerations that a system sets be start values of the FMUs, of the units that are built, by catalog's name.

    Raises:
        WiringError: the system has faults.
    """
    system.check()
    for name, unit in built.items():
        placed = system.units[name]
        if start := bound_enumerations(placed):
            system.units[name] = replace(placed, description=describe_fmu(exchangeable(unit, start)))


def warn_of_enumerations(system: System, units: Collection[str]) -> None:
    """Say which enumerations are left to parameter sets."""
    for name in units:
        if left := ", ".join(f"{name}.{parameter}" for parameter in bound_enumerations(system.units[name])):
            say(f"{left}: bound as an enumeration, which libcosim and Ecos do not take")
