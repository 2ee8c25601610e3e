"""The command `handover new`: a unit, a controller or a scenario to start from, with a test."""

import keyword
import re
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from string import Template

import click

from handover.cosim.files import FileTaken
from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.options import PATH
from handover.scenarios.cli.units.place_start import start_for
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.progress import say
from handover.scenarios.runs.results.run_folder import check_place, make_folder_of, write_whole

_TEMPLATES = Path(__file__).parent / "templates"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_LONGEST = 100

_HELP = """Write a working start for a unit, a controller or a scenario of your own, with its test.

NAME is the class's, such as TwoLinkArm, whose module is two_link_arm.py; or the module's. A scenario comes with a plant
and a controller in files of their own. Files that are there are not overwritten.

\b
Examples
  handover new scenario Reach            reach.py, reach_plant.py, reach_controller.py, tests
  handover run reach:Reach
  handover new controller Gentle         gentle.py, test_gentle.py
  handover run reach:Reach --unit controller=gentle:Gentle
  handover new controller Mine --for helix_handover:servo
"""


@click.command("new", help=_HELP, short_help="Write a start for a unit, a controller or a scenario of your own.")
@click.argument("kind", type=click.Choice(["unit", "controller", "scenario"]))
@click.argument("name")
@click.option("--out", type=PATH, default=Path("."), help="Folder for the files.  [default: this one]")
@click.option("--for", "place", metavar="SCENARIO:PLACE", help="Of a unit or controller: with the ports of that place.")
def new(kind: str, name: str, out: Path, place: str | None) -> None:
    """Write a working start for a unit, a controller or a scenario."""
    with one_line_errors():
        class_name, module = _names(name)
        if place is not None and kind == "scenario":
            raise UsageError("--for is for a unit or a controller; a scenario has places of its own")
        files = _files(kind, class_name, module) if place is None else start_for(place, class_name, module)
        check_place(out)
        if there := [file for file in files if (out / file).exists()]:
            raise UsageError(
                f"{', '.join(str(out / f) for f in there)} {'is' if len(there) == 1 else 'are'} there already"
            )
        _check_hides_nothing(files)
        try:
            for file, text in files.items():
                make_folder_of(out / file)
                write_whole(out / file, text, replace=False)
        except FileTaken as e:
            raise UsageError(str(e)) from e
    for file in files:
        click.echo(out / file)
    path = f"{module}:{class_name}"
    what = {
        "unit": f"handover list {path}",
        "controller": f"handover run SCENARIO --unit NAME={path}",
        "scenario": f"handover run {path}",
    }[kind]
    if place is not None:
        scenario, _, taken = place.rpartition(":")
        what = f"handover run {scenario} --unit {taken}={path}"
    bring = "" if find_spec("pytest") else "python -m pip install pytest, then "
    say(f"try: {what}; its test: {bring}python -m pytest test_{module}.py")


def _names(name: str) -> tuple[str, str]:
    """Return the names of the class and of its module.

    Raises:
        UsageError: they would be no names in Python, or taken.
    """
    if not _NAME.fullmatch(name) or name.endswith("_"):
        raise UsageError(f"{name!r} is not a name: expected letters, digits and underscores, such as TwoLinkArm")
    if len(name) > _LONGEST:
        raise UsageError(f"{name[:30]}...: {len(name)} letters; at most {_LONGEST} are possible in names of files")
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
    class_name = name if name[0].isupper() else "".join(part.capitalize() for part in name.split("_"))
    if taken := [name for name in (module, class_name) if keyword.iskeyword(name)]:
        raise UsageError(f"{taken[0]!r} is a keyword of Python, which no module or class can be called")
    if class_name in UNITS or module in SCENARIOS:
        raise UsageError(f"{name!r} is in the catalog already, see `handover list`; give another name")
    return class_name, module


def _check_hides_nothing(files: Iterable[str]) -> None:
    """Refuse modules that would stand before others of their names: blocks' folders are searched first.

    Raises:
        UsageError: Python has a module of such a name.
    """
    if taken := [file for file in files if find_spec(file.removesuffix(".py")) is not None]:
        raise UsageError(f"{', '.join(taken)} would hide a module that Python or a package has; give another name")


def _files(kind: str, class_name: str, module: str) -> dict[str, str]:
    """Return the texts of the files by name."""
    if kind != "scenario":
        return _pair(kind, class_name, module)
    return {
        **_pair("scenario", class_name, module),
        **_pair("unit", f"{class_name}Plant", f"{module}_plant"),
        **_pair("controller", f"{class_name}Controller", f"{module}_controller"),
    }


def _pair(kind: str, class_name: str, module: str) -> dict[str, str]:
    def text(template: str) -> str:
        source = (_TEMPLATES / f"{template}.py.txt").read_text(encoding="utf-8")
        return Template(source).substitute(Class=class_name, module=module)

    return {f"{module}.py": text(kind), f"test_{module}.py": text(f"test_{kind}")}
