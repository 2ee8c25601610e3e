"""Finds what a command names: a scenario, and the FMUs that take the place of its units."""

import ast
import contextlib
import importlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import nearest, suggestion
from handover.fmus.catalog import UNITS, UnknownBlock, UnknownUnit, find_unit, import_class
from handover.scenarios.catalog import (
    SCENARIOS,
    InvalidScenario,
    ScenarioSource,
    installed_scenarios,
    named_scenario,
    search_folder,
)
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.execution.errors import UsageError

_BLOCK = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
"""The path of a block, `my_arm:MyArm`; a drive's letter is followed by a slash."""


def is_path_of_class(text: str) -> bool:
    """Return whether a text is the path of a class, as of a block or a scenario of one's own, and no file's."""
    return _BLOCK.fullmatch(text) is not None


def folder_fault(path: Path) -> str:
    """Return why a folder, which is neither an unpacked FMU nor an unpacked SSP, cannot be run or checked."""
    if (path / "run.json").is_file():
        return (
            f"the folder of a run; `handover run --config {path / 'run.json'}` repeats that, "
            f"`handover report {path}` writes its page"
        )
    if (path / "campaign.json").is_file():
        return f"the folder of a campaign; `handover report {path}` writes its page"
    return (
        "a folder with neither modelDescription.xml, as of an unpacked FMU, nor SystemStructure.ssd, as of an unpacked "
        "SSP, at its top"
    )


def nothing_at(path: Path, is_meant: Callable[[Path], bool] = Path.exists) -> str:
    """Return that there is nothing at a path, with the names of what is there, and meant, that are most like its."""
    if not path.parent.is_dir():
        return f"there is no such file or folder, nor a folder {path.parent}"
    near = suggestion(path.name, [p.name for p in path.parent.iterdir() if is_meant(p)])
    return "there is no such file or folder" + (f"; {near}" if near else "")


def _path_fault(name: str) -> str:
    """Return what is wrong with a name that is meant as a path of a file or folder; empty where it is not."""
    if not name:  # whose path would be that of the working directory
        return ""
    path = Path(name)
    if path.is_dir():
        return folder_fault(path)
    if path.exists():
        if path.suffix.lower() in (".fmu", ".ssp", ".ssd"):
            return "a file, and no scenario, whose name is right here; `handover list` lists those"
        return "a file, and no scenario; what can be run ends with .fmu, .ssp or .ssd"
    is_meant = "/" in name or "\\" in name or (":" not in name and path.suffix)
    return nothing_at(path) if is_meant else ""


def find_scenario(name: str) -> type[Experiment[Any]]:
    """Return the scenario of a name, or of a path such as `my_scene:TwoLinkReach`, also of the working directory.

    Raises:
        UsageError: there is none, and the nearest names are given; or it is not complete, and all that it lacks is.
    """
    if ":" in name:
        search_folder(Path.cwd())
    try:
        return named_scenario(name)
    except InvalidScenario as e:
        raise UsageError(str(e)) from e
    except KeyError:
        valid = [*SCENARIOS, *installed_scenarios()]
        if name in UNITS:
            raise UsageError(f"{name} is a unit, not a scenario: {', '.join(valid)}") from None
        if Path(name).suffix == ".toml":
            raise UsageError(
                f"{name} is a file, not a scenario: a study's plan is opened by handover study serve {name}, "
                f"values of options by --config {name}"
            ) from None
        if fault := python_file_fault(name, "a scenario", ["build"]) or _path_fault(name):
            raise UsageError(f"{name}: {fault}") from None
        own = "" if name in "".join(valid) else "; a scenario of your own is named MODULE:CLASS"
        raise UsageError(f"no scenario {name!r}: {nearest(name, valid)}{own}") from None


def path_of_class(scenario: type[Experiment[Any]]) -> str | None:
    """Return the name or the path by which a scenario's class is found again, None if it is not, as of a notebook."""
    if scenario.name in SCENARIOS and SCENARIOS[scenario.name] is scenario:
        return scenario.name
    path = f"{scenario.__module__}:{scenario.__qualname__}"
    try:
        return path if named_scenario(path) is scenario else None
    except (KeyError, InvalidScenario):
        return None


def own_source(name: str) -> dict[str, Any]:
    """Return what a run's folder keeps of a scenario that is not this package's, to find it again; else nothing."""
    source = ScenarioSource.of(name)
    return {} if source is None else asdict(source)


def replacements(experiment: type[Experiment[Any]], given: Sequence[str]) -> dict[str, str]:
    """Return what `NAME=FILE` and `NAME=MODULE:CLASS` texts put in the place of units, by the units' names.

    Raises:
        UsageError: a text is of another form, or names no unit of the scenario.
    """
    others: dict[str, str] = {}
    for text in given:
        name, equals, other = text.partition("=")
        if not equals or not other:
            raise UsageError(f"--unit {text!r} is not of the form NAME=FILE, NAME=UNIT or NAME=MODULE:CLASS")
        if name not in experiment.units:
            raise UsageError(f"{experiment.name} has no unit {name!r}: {nearest(name, experiment.units)}")
        if name in others:
            raise UsageError(f"--unit: {name} is given twice")
        others[name] = other
    return others


def select_fmus(
    experiment: type[Experiment[Any]], others: Mapping[str, str], built: Callable[[str], Path]
) -> dict[str, Path]:
    """Return the FMU of each unit of a scenario: a file that takes its place, or what `built` builds.

    Args:
        experiment: the scenario.
        others: files of FMUs, names of the catalog's units, or paths of blocks, by the units whose place they take.
        built: builds a unit by its name or its block's path.

    Raises:
        UsageError: a block does not exist or is none of which an FMU can be made, or the folder of built units cannot
            be used.
    """
    fmus: dict[str, Path] = {}
    for name, unit in experiment.units.items():
        other = others.get(name, "")
        if fault := python_file_fault(other):
            raise UsageError(f"unit {name}: {other}: {fault}")
        if other and re.fullmatch(r"\w+", other) and other not in UNITS and not Path(other).exists():
            own = "; a file ends in .fmu, and a block of your own is named MODULE:CLASS"
            raise UsageError(f"unit {name}: no unit {other!r}: {nearest(other, UNITS)}{own}")
        if re.fullmatch(r"[a-z_][\w.]*\.[A-Z]\w*[a-z]\w*", other) and not Path(other).exists():
            meant = ":".join(other.rsplit(".", 1))
            raise UsageError(f"unit {name}: there is no file {other}; a block is named MODULE:CLASS: {meant}")
        if other and not _BLOCK.fullmatch(other) and (other not in UNITS or Path(other).exists()):
            fmus[name] = Path(other)
            continue
        if ":" in other:
            search_folder(Path.cwd())
        try:
            fmus[name] = built(other or unit)
        except _invalid_blocks() as e:
            raise UsageError(f"unit {name}: {e}") from e
        except OSError as e:
            raise UsageError(f"the folder of built units cannot be used: {e}; HANDOVER_CACHE names another") from e
    return fmus


def _python_file(other: str) -> Path | None:
    """Return the Python file that a text such as `gentle.py`, `gentle.py:Gentle` or `gentle` names; None for none."""
    stem = other.partition(".py:")[0].removesuffix(".py")
    if not stem or ":" in stem or (stem == other and (other in UNITS or Path(other).exists())):
        return None
    file = Path(f"{stem}.py")
    return file if file.is_file() else None


def python_file_fault(name: str, what: str = "a block", methods: Sequence[str] = ("step",)) -> str:
    """Return how what a Python file holds is named, where a name is that of such a file; else nothing.

    Args:
        name: such as `gentle.py` or `gentle`.
        what: what is meant.
        methods: its class has one of them: a block `step`, a scenario `build`.
    """
    file = _python_file(name)
    if file is None:
        return ""
    try:
        nodes = ast.parse(file.read_bytes()).body
    except (OSError, SyntaxError, ValueError):
        nodes = []
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    meant = [c.name for c in classes if any(isinstance(n, ast.FunctionDef) and n.name in methods for n in c.body)]
    named = " or ".join(f"{file.stem}:{name}" for name in meant) or f"{file.stem}:CLASS"
    folder = "" if file.parent == Path() else f", from the folder {file.parent}"
    return f"{what} in a Python file is named MODULE:CLASS: {named}{folder}"


def load_units(scenario: str) -> None:
    """Load what the units of one of this package's or an installed package's scenarios import; of others nothing.

    What is wrong with a scenario or a unit is left to whoever runs it.
    """
    if ":" in scenario:  # its author may change it meanwhile
        return
    try:
        units = named_scenario(scenario).units
    except (KeyError, InvalidScenario):
        return
    for unit in units.values():
        with contextlib.suppress(Exception):
            block = import_class(find_unit(unit).block)
            for module in getattr(block, "deferred", ()):
                importlib.import_module(module)


def _invalid_blocks() -> tuple[type[Exception], ...]:
    """Return what is raised for blocks that do not exist or of which no FMU can be made."""
    from handover.fmus.build import InvalidName  # what builds units takes long to import
    from handover.fmus.contents.icons import InvalidIcon
    from handover.fmus.contents.model_description import AmbiguousName, InvalidText
    from handover.fmus.layout import DuplicateName

    return UnknownUnit, UnknownBlock, InvalidName, InvalidIcon, DuplicateName, AmbiguousName, InvalidText
