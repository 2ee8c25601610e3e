"""The command `handover`."""

import sys
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from cosim.exceptions import CosimError, nearest
from fmus.binaries import NotCompiled
from fmus.build import build, cached
from fmus.catalog import UNITS, Entry
from fmus.compile import (
    TARGETS,
    CompilationError,
    UnknownPlatform,
    compile_runtime,
    has_compiler,
    is_current,
    named_platforms,
)
from fmus.fmi2_description import NoFmi2Form
from scenarios.catalog import SCENARIOS
from scenarios.check_command import check
from scenarios.experiment import Experiment
from scenarios.interruption import Interruption
from scenarios.listing import print_catalog, print_scenario, print_summary, print_unit
from scenarios.parameters import BadParameter, parse_parameters
from scenarios.progress import progress_bar
from scenarios.run_folder import BadRunFolder, RunFolder, check_place
from scenarios.runner import Task, carry_out
from scenarios.vsl_train_command import vsl_train

_PATH = click.Path(path_type=Path)

TASK_FAILED, BAD_CALL, UNIT_FAILED = 1, 2, 3


class BadCall(click.ClickException):
    """A call that cannot be carried out, told in one line."""

    exit_code = BAD_CALL


_HELP = """Robots that hand objects over, co-simulated as Functional Mock-up Units.

\b
handover list                          scenarios and units
handover list helix_handover           a scenario's parameters, with ranges
handover list VslArm                   a unit's parameters, inputs and outputs
handover run helix_handover            one run; leaves a folder with a report
handover build TendonArm --fmi both    units for other tools
handover check Their.fmu               what is wrong with an FMU, whoever made it
handover vsl-train --out model.json    kinematics learned on the VSL arm

\b
Exit status
  0  the task succeeded
  1  the run ended, but the task failed
  2  bad call or bad input; nothing was written
  3  a unit failed; what was recorded until then is kept
  130  aborted with Ctrl-C: before the run, or by a second one during it

\b
Environment
  HANDOVER_CACHE  folder of built units [default: the user's cache folder]
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


@main.command("build")
@click.argument("units", nargs=-1, metavar="[UNIT]...")
@click.option("--fmi", type=click.Choice(["2", "3", "both"]), default="both", show_default=True, help="FMI version.")
@click.option(
    "--scalar",
    is_flag=True,
    help="FMI 3 with a variable for every entry of an array, for tools that know no arrays. FMI 2 is always so.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("fmus-built"),
    show_default=True,
    help="Folder for the files.",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    metavar="NAME[,NAME]...",
    help="Platforms to run on: " + ", ".join(TARGETS) + ", `host` or `all`; missing ones are compiled, which takes a "
    "minute the first time  [default: all that are compiled]",
)
def build_(units: Sequence[str], fmi: str, out: Path, platforms: Sequence[str], *, scalar: bool) -> None:
    """Build UNITs (all by default) as FMUs for other tools.

    A unit with pictures has no FMI 2 form, since FMI 2 knows no binary variables.
    """
    unknown = [u for u in units if u not in UNITS]
    if unknown:
        raise BadCall("; ".join(f"no unit {u!r}: {nearest(u, UNITS)}" for u in unknown))
    with Interruption(), _told_in_one_line():
        check_place(out)
        _compile_missing(platforms)
        make = partial(build, out_dir=out, scalar=scalar, platforms=platforms or None)
        for line in _build_all(units or list(UNITS), fmi, make, named=bool(units)):
            click.echo(line)


main.add_command(check)
main.add_command(vsl_train)


@main.command("run", context_settings={"show_default": True})
@click.argument("scenario")
@click.option(
    "-p", "parameters", multiple=True, metavar="NAME=VALUE", help="Set a parameter; see `handover list SCENARIO`."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of all random numbers.")
@click.option("--unit", "replaced", multiple=True, metavar="NAME=FILE", help="Let another FMU take a unit's place.")
@click.option("--out", type=_PATH, help="Folder for the results [default: a new one in runs/].")
def run_(scenario: str, parameters: Sequence[str], seed: int, replaced: Sequence[str], out: Path | None) -> None:
    """Run a SCENARIO once and write summary, signals, figures and a report into a folder.

    Ctrl-C ends the run after its step; what was recorded until then is kept. Ctrl-C again aborts.
    """
    experiment = _scenario(scenario)
    with Interruption() as interruption, _told_in_one_line():
        values = parse_parameters(experiment, parameters)
        folder = RunFolder(out or Path("runs") / time.strftime(f"%Y-%m-%d_%H%M%S_{scenario}"))
        fmus = _fmus(experiment, _replacements(experiment, replaced))
        task = Task(experiment=experiment(), parameters=values, seed=seed, fmus=fmus, folder=folder)
        with progress_bar(sys.stderr) as progress:
            ended = carry_out(task, progress, interruption)
    if ended.failure:
        click.echo(str(ended.failure), err=True)
    print_summary(ended, experiment.headline, folder)
    sys.exit(UNIT_FAILED if ended.failure else 0 if ended.outcome.success else TASK_FAILED)


def _scenario(name: str) -> type[Experiment[Any]]:
    if name not in SCENARIOS:
        if name in UNITS:
            raise BadCall(f"{name} is a unit, not a scenario: {', '.join(SCENARIOS)}")
        raise BadCall(f"no scenario {name!r}: {nearest(name, SCENARIOS)}")
    return SCENARIOS[name]


def _replacements(experiment: type[Experiment[Any]], given: Sequence[str]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for text in given:
        name, equals, file = text.partition("=")
        if not equals or not file:
            raise BadCall(f"--unit {text!r} is not of the form NAME=FILE")
        if name not in experiment.units:
            raise BadCall(f"{experiment.name} has no unit {name!r}: {nearest(name, experiment.units)}")
        if name in found:
            raise BadCall(f"--unit: {name} is given twice")
        found[name] = Path(file)
    return found


def _fmus(experiment: type[Experiment[Any]], others: Mapping[str, Path]) -> dict[str, Path]:
    try:
        return {name: others.get(name) or cached(unit, 3) for name, unit in experiment.units.items()}
    except OSError as e:
        raise BadCall(f"the folder of built units cannot be used (HANDOVER_CACHE): {e}") from e


def _compile_missing(platforms: Sequence[str]) -> None:
    missing = [target for target in named_platforms(platforms) if not is_current(target)] if platforms else []
    if missing and not has_compiler():
        raise NotCompiled(missing)
    for target in missing:
        click.echo(f"compiling the FMI runtime for {target}", err=True)
        compile_runtime([target])


def _build_all(units: Sequence[str], fmi: str, make: Callable[[Entry, int], Path], *, named: bool) -> Iterator[str]:
    for name in units:
        for version in (2, 3) if fmi == "both" else (int(fmi),):
            try:
                yield str(make(UNITS[name], version))
            except NoFmi2Form as e:
                if named and fmi == "2":
                    raise BadCall(str(e)) from e
            except OSError as e:
                raise BadCall(f"{name} cannot be built: {e}") from e


@contextmanager
def _told_in_one_line() -> Generator[None, None, None]:
    try:
        yield
    except (CosimError, BadParameter, BadRunFolder, NotCompiled, UnknownPlatform) as e:
        raise BadCall(str(e)) from e
    except CompilationError as e:
        raise BadCall(str(e).replace("\n", " ", 1)) from e
