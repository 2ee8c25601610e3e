"""The command `handover export`: a scenario as an SSP."""

from collections.abc import Sequence
from pathlib import Path

import click

from handover.cosim.ssp.writing import write_ssp
from handover.fmus.build import cached
from handover.fmus.fmi2_description import NoFmi2Form
from handover.scenarios.cli.options import scenario_options
from handover.scenarios.execution.errors import UsageError, one_line_errors
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.selection import find_scenario, replacement_fmus, select_fmus
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.results.run_folder import check_place

_HELP = """Write a SCENARIO as an SSP (System Structure and Parameterization), which other tools load.

Its units are FMI 2 FMUs, or FMI 3 where FMI 2 cannot express them (pictures). The SSP is of version 1.0, or of 2.0 if a
unit is of FMI 3. Parameters are bound in files of their own (SSV), one for each unit.
"""


@click.command(
    "export",
    help=_HELP,
    short_help="Write a SCENARIO as an SSP, for other tools.",
    context_settings={"show_default": True},
)
@click.argument("scenario")
@click.option("--ssp", "file", required=True, type=click.Path(path_type=Path), metavar="FILE", help="File to write.")
@scenario_options
def export_command(scenario: str, file: Path, parameters: Sequence[str], seed: int, replaced: Sequence[str]) -> None:
    """Write a SCENARIO as an SSP."""
    experiment = find_scenario(scenario)
    with Interruption(), one_line_errors():
        values = parse_parameters(experiment, parameters)
        if file.suffix.lower() != ".ssp":
            raise UsageError(f"--ssp {file}: a name that ends with .ssp is right; other tools know the file by it")
        if file.is_dir():
            raise UsageError(f"--ssp {file}: there is a folder of that name")
        check_place(file.parent)
        fmus = select_fmus(experiment, replacement_fmus(experiment, replaced), exchangeable)
        instance = experiment()
        system = instance.build(values, seed, lambda unit: fmus[unit])
        try:
            write_ssp(system, file, experiment.name, instance.stop_time(values), experiment.parallel_step)
        except OSError as e:
            raise UsageError(f"--ssp {file}: it cannot be written: {e.strerror}") from e
    click.echo(file)


def exchangeable(unit: str) -> Path:
    """Return the form of a catalog's unit that most tools load: FMI 2, or FMI 3 without arrays."""
    try:
        return cached(unit, 2)
    except NoFmi2Form:
        return cached(unit, 3, scalar=True)
