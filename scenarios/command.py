"""The command `handover`."""

import contextlib
import sys
import time
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from cosim.exceptions import nearest
from cosim.master_options import MasterOptions
from cosim.record.record_formats import RECORD_FORMATS
from fmus.build import cached
from fmus.catalog import UNITS
from scenarios.bad_call import BadCall, told_in_one_line
from scenarios.build_command import build_command
from scenarios.catalog import SCENARIOS
from scenarios.check_command import check
from scenarios.chosen import fmus_of, replacements, scenario_named
from scenarios.ending import end_with
from scenarios.export_command import export_command
from scenarios.interruption import Interruption
from scenarios.limit_arguments import limit_options, limits
from scenarios.listing import print_catalog, print_scenario, print_unit
from scenarios.master_arguments import coupling_of, master_options
from scenarios.parameters import parse_parameters
from scenarios.progress import progress_bar
from scenarios.resume_command import resume
from scenarios.run_folder import RunFolder
from scenarios.runner import carry_out
from scenarios.seconds import Seconds
from scenarios.ssp_call import open_experiment, refuse_for_ssp, source_of, ssp_options
from scenarios.ssp_run import NoParameters, is_ssp
from scenarios.task import Task
from scenarios.vsl_train_command import vsl_train

_PATH = click.Path(path_type=Path)


_HELP = """Robots that hand objects over, co-simulated as Functional Mock-up Units.

\b
handover list                          scenarios and units
handover list helix_handover           a scenario's parameters, with ranges
handover list VslArm                   a unit's parameters, inputs and outputs
handover run helix_handover            one run; leaves a folder with a report
handover build TendonArm --fmi both    units for other tools
handover check Their.fmu               what is wrong with an FMU, whoever made it
handover export ir_grasp --ssp x.ssp   a scenario for other tools
handover run x.ssp --stop 5            a system from another tool
handover resume runs/long              goes on with a run that has checkpoints
handover vsl-train --out model.json    kinematics learned on the VSL arm

\b
Exit status
  0  the task succeeded
  1  the run ended, but the task failed
  2  bad call or bad input; nothing was written
  3  a unit failed, the run was killed, or the disk is full; what was recorded until then is kept
  130  aborted with Ctrl-C: before the run, or by a second one during it

\b
Environment
  HANDOVER_CACHE  folder of built units [default: the user's cache folder]
  Those that units read, here as in other tools: see `handover build --help`
"""


@click.group(help=_HELP, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="handover-cosim")
def main() -> None:
    """Robots that hand objects over, co-simulated as Functional Mock-up Units."""


@main.command("list")
@click.argument("name", required=False, metavar="[SCENARIO|UNIT]")
def list_(name: str | None) -> None:
    """List scenarios and units, the parameters of a SCENARIO, or parameters and ports of a UNIT."""
    if name is None:
        print_catalog()
    elif name in UNITS:
        print_unit(UNITS[name])
    elif name in SCENARIOS:
        print_scenario(SCENARIOS[name])
    else:
        raise BadCall(f"no scenario or unit {name!r}: {nearest(name, [*SCENARIOS, *UNITS])}")


main.add_command(build_command)
main.add_command(check)
main.add_command(export_command)
main.add_command(resume)
main.add_command(vsl_train)


@main.command("run", context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO|FILE.ssp")
@click.option(
    "-p", "parameters", multiple=True, metavar="NAME=VALUE", help="Set a parameter; see `handover list SCENARIO`."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of all random numbers.")
@click.option("--unit", "replaced", multiple=True, metavar="NAME=FILE", help="Let another FMU take a unit's place.")
@ssp_options
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(RECORD_FORMATS)),
    help="Form of the record; may be given more than once. Parquet is always written.  [default: parquet]",
)
@click.option(
    "--checkpoint",
    "every",
    type=Seconds(),
    metavar="SECONDS",
    help="Write a checkpoint every so many simulated seconds, for `handover resume`.",
)
@master_options
@limit_options
@click.option("--out", type=_PATH, help="Folder for the results [default: a new one in runs/].")
def run_(
    scenario: str,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    stop: Fraction | None,
    step: Fraction | None,
    formats: Sequence[str],
    every: Fraction | None,
    call_limit: float,
    pace: float | None,
    out: Path | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO once and write summary, signals, figures and a report into a folder.

    FILE.ssp is a system from another tool (SSP 1.0 or 2.0), or from `handover export`: it runs until its stop time.

    Ctrl-C ends the run after its step; what was recorded until then is kept. Ctrl-C again aborts.

    The run is a process of its own: a unit that crashes it is named, and the record completed. On Windows it is not,
    and such a unit ends the command.
    """
    if is_ssp(scenario):
        refuse_for_ssp(**{"-p": parameters, "--seed": seed, "--unit": replaced})
    elif stop is not None or step is not None:
        raise BadCall("--stop and --step are for an SSP; a scenario has its own")
    with Interruption() as interruption, told_in_one_line(), contextlib.ExitStack() as opened:
        options = MasterOptions(**coupling_of(coupling), **limits(call_limit, pace))
        if is_ssp(scenario):
            experiment, values = open_experiment(Path(scenario), stop, step, opened), NoParameters()
            source = source_of(Path(scenario), experiment.stop_time(values), step)
        else:
            source = {}
            experiment = scenario_named(scenario)()
            values = parse_parameters(type(experiment), parameters)
        folder = RunFolder(out or Path("runs") / time.strftime(f"%Y-%m-%d_%H%M%S_{Path(scenario).stem}"))
        fmus = fmus_of(type(experiment), replacements(type(experiment), replaced), lambda unit: cached(unit, 3))
        task = Task(
            experiment=experiment,
            parameters=values,
            seed=seed,
            fmus=fmus,
            folder=folder,
            formats=formats,
            every=every,
            source=source,
            options=options,
        )
        with progress_bar(sys.stderr) as progress:
            ended = carry_out(task, progress, interruption)
    end_with(ended, task)
