"""Finds what a command names: a scenario, and the FMUs that take the place of its units."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import nearest
from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.execution.errors import UsageError
from handover.scenarios.experiment.experiment import Experiment


def find_scenario(name: str) -> type[Experiment[Any]]:
    """Return the scenario of a name.

    Raises:
        UsageError: there is none; the nearest names are given.
    """
    if name not in SCENARIOS:
        if name in UNITS:
            raise UsageError(f"{name} is a unit, not a scenario: {', '.join(SCENARIOS)}")
        raise UsageError(f"no scenario {name!r}: {nearest(name, SCENARIOS)}")
    return SCENARIOS[name]


def replacement_fmus(experiment: type[Experiment[Any]], given: Sequence[str]) -> dict[str, Path]:
    """Return the files in `NAME=FILE` texts, by the units whose place they take.

    Raises:
        UsageError: a text is of another form, or names no unit of the scenario.
    """
    files: dict[str, Path] = {}
    for text in given:
        name, equals, file = text.partition("=")
        if not equals or not file:
            raise UsageError(f"--unit {text!r} is not of the form NAME=FILE")
        if name not in experiment.units:
            raise UsageError(f"{experiment.name} has no unit {name!r}: {nearest(name, experiment.units)}")
        if name in files:
            raise UsageError(f"--unit: {name} is given twice")
        files[name] = Path(file)
    return files


def select_fmus(
    experiment: type[Experiment[Any]], others: Mapping[str, Path], built: Callable[[str], Path]
) -> dict[str, Path]:
    """Return the FMU of each unit of a scenario: one of the others, or the catalog's unit, which `built` builds.

    Raises:
        UsageError: the folder of built units cannot be used.
    """
    try:
        return {name: others.get(name) or built(unit) for name, unit in experiment.units.items()}
    except OSError as e:
        raise UsageError(f"the folder of built units cannot be used (HANDOVER_CACHE): {e}") from e
