"""The command `handover run`: one run of a scenario, of an SSP or of an FMU."""

import contextlib
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.record.formats import RECORD_FORMATS
from handover.cosim.stepping.options import MasterOptions
from handover.fmus.build import cached
from handover.scenarios.cli.console import progress_bar
from handover.scenarios.cli.master_options import coupling_of, master_options
from handover.scenarios.cli.options import HeadedCommand, HeadedOption, Seconds, limit_options, limits, scenario_options
from handover.scenarios.cli.run_summary import exit_with
from handover.scenarios.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.execution.fmu_run import FmuRun, is_fmu
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.runner import run_task
from handover.scenarios.execution.selection import find_scenario, own_source, replacements, select_fmus
from handover.scenarios.execution.ssp_run import is_ssp, open_experiment, source_of
from handover.scenarios.execution.unit_values import split_parameters
from handover.scenarios.experiment.experiment import Experiment, NoParameters
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.task import Task

_option = partial(click.option, cls=HeadedOption, heading="Of FILE.ssp and FILE.fmu")
_STOP = _option(
    "--stop",
    "--stop-time",
    "stop",
    type=Seconds(),
    metavar="SECONDS",
    help="When the run ends: at the first communication point at or after it.  [default: the file's own stop time]",
)
_STEP = _option(
    "--step",
    type=Seconds(),
    metavar="SECONDS",
    help="Communication step of all units.  [default: what each FMU proposes]",
)
_INPUT = _option(
    "--input",
    "inputs",
    type=click.Path(path_type=Path),
    metavar="FILE.csv",
    help="Of an FMU: inputs over time, a column `time` and columns by input's name, in the inputs' units; continuous"
    " reals lie on lines between two times, all else is held.  [default: constant at their start values]",
)


def file_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--stop`, `--step` and `--input`, which are for SSPs and FMUs."""
    return _STOP(_STEP(_INPUT(command)))


def reject_for_ssp(**given: Any) -> None:
    """Reject options that are for scenarios.

    Raises:
        UsageError: one of them is given.
    """
    used = [name for name, value in given.items() if value]
    if used:
        raise UsageError(f"{', '.join(used)}: for scenarios; an SSP has its parameters and units inside")


def reject_other_options(scenario: str, given: Mapping[str, Any]) -> None:
    """Reject options that are for another kind of run than that of `scenario`, by how they are typed.

    Raises:
        UsageError: one of them is given.
    """
    used = [name for name, value in given.items() if value]
    if is_ssp(scenario):
        reject_for_ssp(**{name: given[name] for name in ("-p", "--seed", "--unit")})
        if "--input" in used:
            raise UsageError("--input: for an FMU that runs by itself; an SSP's inputs are wired in it")
    elif is_fmu(scenario):
        if wrong := [name for name in ("--seed", "--unit") if name in used]:
            raise UsageError(f"{', '.join(wrong)}: for scenarios; of an FMU, -p sets parameters")
    elif "--input" in used:
        raise UsageError("--input is for an FMU that runs by itself; a scenario's inputs are wired in it")
    elif {"--stop", "--step"} & set(used):
        raise UsageError("--stop and --step are for an SSP or an FMU; a scenario has its own")


_HELP = """Run a SCENARIO once and write summary, signals, figures and a report into a folder.

FILE.ssp is a system from another tool (SSP 1.0 or 2.0), or from `handover export`: it runs until its stop time.
FILE.fmu is one unit, from any tool: it runs by itself, with its parameters set by -p and its inputs by --input.

Ctrl-C ends the run after its step; what was recorded until then is kept. Ctrl-C again aborts.

The run is a process of its own: if a unit crashes it, the unit is named and the record completed. On Windows it
is not, and such a unit ends the command.
"""

_record_option = partial(click.option, cls=HeadedOption, heading="Record")


@click.command("run", cls=HeadedCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO|FILE.ssp|FILE.fmu")
@scenario_options
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder for the results.  [default: one of its own in runs/]"
)
@click.option("--no-report", is_flag=True, help="Write neither figures nor a report: `handover report` can, later.")
@click.option(
    "--strict",
    is_flag=True,
    help="Refuse an FMU that breaks the standard even where co-simulation does not touch the fault; see"
    " `handover check`.  [default: warn]",
)
@click.help_option("-h", "--help")
@file_options
@_record_option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(RECORD_FORMATS)),
    help="Format of the record; may be given more than once. Parquet is always written.  [default: parquet]",
)
@_record_option(
    "--checkpoint",
    "every",
    type=Seconds(),
    metavar="SECONDS",
    help="Write a checkpoint every so many simulated seconds, for `handover resume`.",
)
@master_options
@limit_options
def run(
    scenario: str,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    out: Path | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    formats: Sequence[str],
    every: Fraction | None,
    no_report: bool,
    strict: bool,
    call_limit: float,
    pace: float | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO, an SSP or an FMU once."""
    for_scenarios = {"-p": parameters, "--seed": seed, "--unit": replaced}
    reject_other_options(scenario, {**for_scenarios, "--stop": stop, "--step": step, "--input": inputs})
    with Interruption() as interruption, one_line_errors(), contextlib.ExitStack() as opened:
        if not no_report:
            require_extra("reports", "report and figures", "--no-report")
        options = MasterOptions(**coupling_of(coupling), **limits(call_limit, pace), strict=strict)
        source: Mapping[str, Any] = {}
        of_units: Mapping[str, str] = {}
        if is_ssp(scenario):
            experiment, values, source = _of_file(Path(scenario), stop, step, opened)
        elif is_fmu(scenario):
            values = NoParameters()
            alone = FmuRun(path=Path(scenario), parameters=parameters, inputs=inputs, stop=stop, step=step)
            experiment = alone.open()
            source = alone.as_source(experiment.stop_time(values))
        else:
            experiment = find_scenario(scenario)()
            values, of_units = split_parameters(type(experiment), parameters)
            source = own_source(scenario)
        stem = Path(experiment.name).stem  # of a file, its name without suffix
        folder = RunFolder(out or Path("runs") / time.strftime(f"%Y-%m-%d_%H%M%S_{stem}"))
        fmus = select_fmus(type(experiment), replacements(type(experiment), replaced), lambda unit: cached(unit, 3))
        task = Task(
            experiment=experiment,
            parameters=values,
            seed=seed,
            fmus=fmus,
            unit_values=of_units,
            folder=folder,
            formats=tuple(dict.fromkeys(formats)),
            every=every,
            source=source,
            options=options,
            presented=not no_report,
        )
        with progress_bar(sys.stderr) as progress:
            result = run_task(task, progress, interruption)
    exit_with(result, task)


def _of_file(
    file: Path, stop: Fraction | None, step: Fraction | None, opened: contextlib.ExitStack
) -> tuple[Experiment[Any], NoParameters, Mapping[str, Any]]:
    """Return an SSP as an experiment, its parameters, and what the run's folder keeps of the file."""
    experiment, values = open_experiment(file, stop, step, opened), NoParameters()
    return experiment, values, source_of(file, experiment.stop_time(values), step)
