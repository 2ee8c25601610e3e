"""The parameter sets that the catalog's units contain as FMUs.

Defaults whose origin is declared are in two sets: `published`, what a paper or the robot's makers state, what follows
from that or is read off a figure; and `assumed`, what none of them gives. Each value has its place in the source. In
neither set are parameters without an origin, such as seeds. Where a robot was tuned in other ways, as the thesis did or
as we do, these have a set each.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.origins import Origin
from handover.cosim.blocks.variable import Variable
from handover.fmus.catalog import UNITS, import_class
from handover.fmus.contents.related_files import ParameterSet
from handover.scenarios.experiment.paper import paper_entry, paper_values

_TUNINGS: Mapping[str, Mapping[str, str]] = {
    "TendonArm": {"fitted_arm": "Elasticity and lengths that agree with the arm's lengths in fig. 9 of the thesis"},
    "TendonArmFast": {"fitted_arm": "Elasticity and lengths that agree with the arm's lengths in fig. 9 of the thesis"},
    "VisualServo": {
        "thesis": "Filters and sequence as tuned in the thesis",
        "own": "Filters and sequence as tuned for this simulation",
    },
}
"""By unit, the groups with other values of its parameters, and what they are."""

_BEHAVIOURS = ("ImpedanceController", "AdmittanceController", "ArmImpedanceController")
"""Units whose parameter `behaviour` chooses between the gains of table 4.1."""


def parameter_sets(unit: str) -> list[ParameterSet]:
    """Return the parameter sets of a unit of the catalog; of a unit of one's own, none."""
    if unit not in UNITS:
        return []
    declared = {v.name: v for v in describe(import_class(UNITS[unit].block)).parameters}
    return [
        *_by_origin(declared.values()),
        *(_tuning(group, description, declared) for group, description in _TUNINGS.get(unit, {}).items()),
        *(_behaviour(name) for name in ("rigid", "compliant") if unit in _BEHAVIOURS),
    ]


def _by_origin(declared: Iterable[Variable]) -> Iterator[ParameterSet]:
    for name, description in (
        ("published", "Defaults that are published, derived from that, or read off a figure"),
        ("assumed", "Defaults that no source gives"),
    ):
        chosen = [v for v in declared if v.origin and (v.origin.status == "assumed") == (name == "assumed")]
        if chosen:
            yield _set(name, description, *_defaults(chosen), f"origin:{name}")


def _defaults(chosen: Iterable[Variable]) -> tuple[dict[str, Any], dict[str, Origin]]:
    """Return defaults, and where they come from, by the parameters' names."""
    values = {v.name: v.start.name.lower() if v.items else np.asarray(v.start).tolist() for v in chosen}
    return values, {v.name: v.origin for v in chosen if v.origin}


def _tuning(group: str, description: str, declared: Mapping[str, Variable]) -> ParameterSet:
    if group == "own":  # of the settings that the thesis has otherwise
        chosen = [declared[n] for n in paper_values("helix", "thesis")]
        return _set(group, description, *_defaults(chosen), f"tuning:{group}")
    entries = {n: paper_entry("helix", group, n) for n in paper_values("helix", group) if n in declared}
    values = {n: e["value"] for n, e in entries.items()}
    origins = {n: Origin(e["status"], e["where"]) for n, e in entries.items()}
    return _set(group, description, values, origins, f"tuning:{group}")


def _behaviour(name: str) -> ParameterSet:
    gains = {n: paper_entry("free_flyer", f"gains_{name}", n) for n in paper_values("free_flyer", f"gains_{name}")}
    origin = "; ".join(f"{n} {e['value']:g} {e['unit']}, {e['where']}" for n, e in gains.items())
    return ParameterSet(
        name=name,
        description=f"The {name} gains of the thesis, table 4.1",
        values={"behaviour": name},
        origins={"behaviour": f"{origin} (stated)"},
        labels=("tuning:thesis",),
    )


def _set(
    name: str, description: str, values: Mapping[str, Any], origins: Mapping[str, Origin], label: str
) -> ParameterSet:
    return ParameterSet(
        name=name,
        description=description,
        values=values,
        origins={n: f"{origin.where} ({origin.status})" for n, origin in origins.items()},
        labels=(label,),
    )
