"""The command `handover build`."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import click

from cosim.exceptions import nearest
from fmus.binaries import NotCompiled
from fmus.build import build
from fmus.catalog import UNITS, Entry
from fmus.compile import TARGETS, compile_runtime, has_compiler, is_current, named_platforms
from fmus.fmi2_description import NoFmi2Form
from scenarios.bad_call import BadCall, told_in_one_line
from scenarios.interruption import Interruption
from scenarios.run_folder import check_place

_HELP = """Build UNITs (all by default) as FMUs for other tools.

A unit with pictures has no FMI 2 form, since FMI 2 knows no binary variables.

\b
Environment, when units are built
  HANDOVER_FMI_PLATFORMS  platforms for which the package, and what is missing
                          of it, is compiled [default: host]
  HANDOVER_CACHE          what is compiled where the package cannot be written

\b
Environment, when a tool loads the units
  FMU_LIBPYTHON       path of the shared library of the Python to load
                      [default: of the one that built the unit, or python3]
  FMU_PYTHON_PROCESS  1: Python in a process of its own for each instance;
                      0: never [default: where none can be loaded]
  FMU_PYTHON          path of the interpreter for that process
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
def build_command(units: Sequence[str], fmi: str, out: Path, platforms: Sequence[str], *, scalar: bool) -> None:
    """Build units as FMUs for other tools."""
    unknown = [u for u in units if u not in UNITS]
    if unknown:
        raise BadCall("; ".join(f"no unit {u!r}: {nearest(u, UNITS)}" for u in unknown))
    with Interruption(), told_in_one_line():
        check_place(out)
        _compile_missing(platforms)
        make = partial(build, out_dir=out, scalar=scalar, platforms=platforms or None)
        for line in _build_all(units or list(UNITS), fmi, make, named=bool(units)):
            click.echo(line)


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
