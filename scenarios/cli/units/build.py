"""The command `handover build`: units as FMUs, from the catalog or from a user's own block, named MODULE:CLASS."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from fractions import Fraction
from functools import partial
from pathlib import Path

import click

from handover.cosim.exceptions import nearest
from handover.cosim.experiments.signal_table import InvalidTable
from handover.fmus.binaries import NotCompiled
from handover.fmus.build import ExperimentRequest, InvalidName, InvalidStep, build
from handover.fmus.catalog import UNITS, Entry, UnknownBlock, own_unit
from handover.fmus.compile import (
    TARGETS,
    compile_runtime,
    has_compiler,
    host_platform,
    is_current,
    named_platforms,
)
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.fmus.contents.icons import InvalidIcon
from handover.fmus.contents.model_description import AmbiguousName, InvalidText
from handover.fmus.contents.related_files import CannotRecordExperiment, NothingToCompare
from handover.fmus.layout import DuplicateName
from handover.fmus.sources import FileElsewhere, beside_block, closure
from handover.fmus.standalone.freezer import CannotFreeze, check_standalone
from handover.scenarios.catalog import search_folder
from handover.scenarios.cli.options import PATH
from handover.scenarios.experiment.parameter_sets import parameter_sets
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import doing, say
from handover.scenarios.runs.execution.selection import python_file_fault
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, check_place


def load_user_block(path: str, step: str | None) -> Entry:
    """Return the unit that a path such as `spring:Spring` names, also of the working directory.

    Its step is that which is given, a number or a fraction of seconds, else the block's period, else 0.01 s.

    Raises:
        UsageError: there is no such class, its module cannot be loaded, it is not a block, or the step is invalid.
    """
    search_folder(Path.cwd())
    given = None if step is None else _seconds(step)
    try:
        closure(path)
        return own_unit(path, given)
    except UnknownBlock as e:
        raise UsageError(str(e)) from e


def _seconds(text: str) -> Fraction:
    try:
        step = Fraction(text)
    except (ValueError, ZeroDivisionError):
        step = Fraction(0)
    if not sys.float_info.min <= step <= sys.float_info.max:
        raise UsageError(f"--step {text!r} is not a positive number of seconds, such as 0.01 or 1/30")
    return step


_HELP = """Build UNITs (all by default) as FMUs for other tools. A unit of your own is named MODULE:CLASS, such as
spring:Spring for the class Spring in spring.py; modules are looked for in the working directory, too.

A unit with pictures has no FMI 2 form, since FMI 2 knows no binary variables.

Each FMU contains its source, its documentation and the parameter sets of the papers, with their roles in a manifest
(FMI-LS-REF). By --prove it contains an experiment with its result, too, which `handover check` runs and compares on any
machine.

\b
Environment, when units are built
  HANDOVER_FMI_PLATFORMS  platforms for which the package, and what is missing
                          of it, is compiled without --platform [default: host]
  HANDOVER_CACHE          folder for what is compiled where the package cannot be
                          written

\b
Environment, when a tool loads the units
  FMU_LIBPYTHON       path of the shared library of the Python to load, and no
                      other [default: of the one that built the unit, or python3]
  FMU_PYTHON_PROCESS  1: Python in a process of its own for each instance;
                      0: never [default: where none can be loaded]
  FMU_PYTHON          path of the interpreter to take
  FMU_PYTHON_TIMEOUT  seconds that a call of that process may take, 0 for no
                      limit [default: 300]
"""


@click.command("build", help=_HELP)
@click.argument("units", nargs=-1, metavar="[UNIT]...")
@click.option("--fmi", type=click.Choice(["2", "3", "both"]), default="both", show_default=True, help="FMI version.")
@click.option(
    "--scalar",
    is_flag=True,
    help="FMI 3 with a variable for every entry of an array, for tools that know no arrays. FMI 2 is always so.",
)
@click.option(
    "--out",
    type=PATH,
    default=Path("fmus-built"),
    show_default=True,
    help="Folder for the files; those of the same names are replaced.",
)
@click.option(
    "--step",
    metavar="SECONDS",
    help="Communication step that suits a unit of your own, such as 0.01 or 1/30  [default: its period, or 0.01]",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    metavar="NAME[,NAME]...",
    help="Platforms to run on: " + ", ".join(TARGETS) + ", `host` or `all`; missing ones are compiled, which takes a "
    "minute the first time  [default: those of HANDOVER_FMI_PLATFORMS, and all others that are compiled]",
)
@click.option(
    "--standalone",
    is_flag=True,
    help="Bring the interpreter and all packages along, for this machine's platform: the FMU then needs "
    "nothing installed. Takes a minute a unit, and the package's extra `standalone`.",
)
@click.option(
    "--include",
    type=PATH,
    multiple=True,
    help="Data file that a unit of your own opens beside its module, by __file__.",
)
@click.option(
    "--prove",
    is_flag=True,
    help="Play a stimulus to the FMU and bring it along with the outputs. Takes some seconds a unit.",
)
@click.option(
    "--stimulus",
    type=PATH,
    metavar="FILE",
    help="Stimulus of --prove for one UNIT: CSV with columns time (s) and inputs, such as p_WG[1]. "
    "Values are held until the next row.  [default: steps and ramps of the inputs that have a unit or a range]",
)
def build_command(
    units: Sequence[str],
    fmi: str,
    out: Path,
    step: str | None,
    platforms: Sequence[str],
    include: Sequence[Path],
    *,
    scalar: bool,
    standalone: bool,
    prove: bool,
    stimulus: Path | None,
) -> None:
    """Build units as FMUs for other tools."""
    named = list(dict.fromkeys(units))
    unknown = [u for u in named if u not in UNITS and ":" not in u]
    if unknown:
        if fault := python_file_fault(unknown[0]):
            raise UsageError(f"{unknown[0]}: {fault}")
        remedy = "a unit of your own is named MODULE:CLASS"
        raise UsageError("; ".join(f"no unit {u!r}: {nearest(u, UNITS)}" for u in unknown) + f"; {remedy}")
    with Interruption(), one_line_errors():
        check_place(out)
        entries = [UNITS[u] if u in UNITS else load_user_block(u, step) for u in named or UNITS]
        if include and any(entry in UNITS.values() for entry in entries):
            raise UsageError("--include is for units of your own, MODULE:CLASS; those of the catalog open no files")
        if step is not None and all(entry in UNITS.values() for entry in entries):
            raise UsageError("--step is for units of your own, MODULE:CLASS; those of the catalog have theirs")
        if stimulus is not None:
            _check_stimulus(stimulus, units, prove=prove)
        if prove and platforms and host_platform() not in named_platforms(platforms):
            raise UsageError(f"--prove plays the experiment on this machine: give --platform {host_platform()}, too")
        _check_what_goes_along(entries, platforms if standalone else None, include)
        _compile_missing(platforms)
        given = {"platforms": platforms or None, "standalone": standalone, "include": include}
        make = partial(
            build, out_dir=out, scalar=scalar, experiment=ExperimentRequest(stimulus) if prove else None, **given
        )
        for line in _build_all(entries, fmi, make, out, named=bool(units), is_long=prove or standalone):
            click.echo(line)


def _check_what_goes_along(
    entries: Sequence[Entry], standalone_for: Sequence[str] | None, include: Sequence[Path]
) -> None:
    """Refuse what --standalone and --include cannot do before anything is compiled."""
    try:
        if standalone_for is not None:
            check_standalone(standalone_for)
        for entry in entries:
            beside_block(entry.block, include)
    except CannotFreeze as e:
        raise UsageError(f"--standalone: {e}") from e
    except FileElsewhere as e:
        raise UsageError(f"--include: {e}") from e


def _check_stimulus(stimulus: Path, units: Sequence[str], *, prove: bool) -> None:
    if not prove:
        raise UsageError("--stimulus is that of --prove; give both")
    if len(units) != 1:
        raise UsageError(f"--stimulus is for one UNIT, whose inputs it has; {len(units) or 'no'} units are named")
    if not stimulus.is_file():
        raise UsageError(f"--stimulus {stimulus}: there is no such file")


def _compile_missing(platforms: Sequence[str]) -> None:
    missing = [target for target in named_platforms(platforms) if not is_current(target)] if platforms else []
    if missing and not has_compiler():
        raise NotCompiled(missing)
    for target in missing:
        say(f"compiling the FMI runtime for {target}")
        compile_runtime([target])


def _build_all(
    entries: Sequence[Entry], fmi: str, make: Callable[..., Path], out: Path, *, named: bool, is_long: bool
) -> Iterator[str]:
    for entry in entries:
        for version in (2, 3) if fmi == "both" else (int(fmi),):
            try:
                with doing(f"building {entry.name} for FMI {version}") if is_long else nullcontext():
                    file = _made(entry, version, make, named=named)
                yield str(file)
            except NoFmi2Form as e:
                if named and fmi == "2":
                    raise UsageError(str(e)) from e
            except (CannotRecordExperiment, InvalidTable) as e:
                raise UsageError(f"--prove: {e}") from e
            except CannotFreeze as e:
                raise UsageError(f"--standalone: {e}") from e
            except (InvalidName, InvalidStep, InvalidIcon, DuplicateName, AmbiguousName, InvalidText) as e:
                raise UsageError(f"{entry.block}: {e}") from e
            except OSError as e:
                if e.filename and Path(e.filename).absolute().is_relative_to(out.absolute()):
                    raise InvalidRunFolder(out, f"it cannot be written to: {e.strerror}") from e
                raise UsageError(f"{entry.name} cannot be built: {e}") from e


def _made(entry: Entry, version: int, make: Callable[..., Path], *, named: bool) -> Path:
    """Build a unit's FMU; if all units are built, one that gives nothing to compare is built without an experiment."""
    sets = parameter_sets(entry.name) if entry in UNITS.values() else []
    try:
        return make(entry, version, parameter_sets=sets)
    except NothingToCompare as e:
        if named:
            raise
        say(f"{e}; it is built without an experiment")
        return make(entry, version, parameter_sets=sets, experiment=None)
