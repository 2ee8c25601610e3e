"""What options say of single units by name: which live in processes of their own, and their tolerances."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from handover.cosim.exceptions import InvalidOptions
from handover.cosim.fmu.file.archive import is_of_this_project
from handover.cosim.isolation.unit_process import unavailable
from handover.cosim.native_libraries import CompilationError
from handover.cosim.system.system import System

FOREIGN, ALL = "foreign", "all"
"""Names that stand for several units, also where a unit itself is named so."""


def isolated_units(system: System, wanted: Sequence[str]) -> frozenset[str]:
    """Return the names of the units that names, `foreign` and `all` stand for; see `MasterOptions.isolated`.

    Those of `units_of_one_fmu` are among them in any case.

    Raises:
        InvalidOptions: a name is of no unit, or units cannot have processes of their own on this machine.
    """
    units, crowded = system.units, units_of_one_fmu(system)
    if unknown := [name for name in wanted if name not in (FOREIGN, ALL) and name not in units]:
        valid = ", ".join((*units, FOREIGN, ALL))
        raise InvalidOptions([f"there is no unit {name!r} to isolate; there are {valid}" for name in unknown])
    if wanted or crowded:
        _check_support("; ".join(crowded) or "no unit can be isolated")
    return _asked(system, wanted).union(*crowded.values())


def unasked_isolations(system: System, wanted: Sequence[str]) -> list[str]:
    """Return why units are isolated by themselves, in lines, where not all of them are isolated as wanted."""
    asked = _asked(system, wanted)
    return [line for line, names in units_of_one_fmu(system).items() if not asked.issuperset(names)]


def _asked(system: System, wanted: Sequence[str]) -> frozenset[str]:
    units = system.units
    if ALL in wanted:
        return frozenset(units)
    ours: dict[Path, bool] = {}
    named = {name for name in wanted if name != FOREIGN}
    if FOREIGN in wanted:
        for name, unit in units.items():
            path = unit.description.path
            if path not in ours:
                ours[path] = is_of_this_project(path)
            if not ours[path]:
                named.add(name)
    return frozenset(named)


def units_of_one_fmu(system: System) -> dict[str, list[str]]:
    """Return the units of each FMU that is placed more than once though a process may hold only one instance of it.

    They are by a line that says so.
    """
    placed: Mapping[Path, list[str]] = defaultdict(list)
    for name, unit in system.units.items():
        if unit.description.capabilities.once_per_process:
            placed[unit.description.path.resolve()].append(name)
    return {
        f"{' and '.join(names)} are one FMU, {path.name}, of which a process may hold one instance only "
        "(canBeInstantiatedOnlyOncePerProcess), so each lives in a process of its own": names
        for path, names in placed.items()
        if len(names) > 1
    }


def tolerances_of(system: System, given: Mapping[str, float]) -> dict[str, float]:
    """Return the relative tolerance that each unit is given; one for which nothing says any is left out.

    Args:
        system: the units.
        given: by name of a unit, or `all` for the others; see `MasterOptions.unit_tolerances`. Of the rest, a unit's
            own default experiment says it.

    Raises:
        InvalidOptions: a name is of no unit.
    """
    units = system.units
    if unknown := [name for name in given if name != ALL and name not in units]:
        valid = ", ".join((*units, ALL))
        raise InvalidOptions([f"there is no unit {name!r} to give a tolerance; there are {valid}" for name in unknown])
    proposed = {name: unit.description.experiment.tolerance for name, unit in units.items()}
    found = {name: given.get(name, given.get(ALL, own)) for name, own in proposed.items()}
    return {name: tolerance for name, tolerance in found.items() if tolerance is not None}


def _check_support(what: str) -> None:
    try:
        reason = unavailable()
    except CompilationError as e:
        reason = str(e)
    if reason:
        raise InvalidOptions([f"{what}: {reason}"])
