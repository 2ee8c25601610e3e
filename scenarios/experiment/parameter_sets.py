"""The parameter sets that the catalog's units contain as FMUs, from the robots' `paper.toml`.

The defaults that `paper.toml` gives are in two sets: `published`, what a paper or the robot's makers state, what
follows from that or is read off a figure; and `assumed`, what none of them gives. Each value has its place in the
source. In neither set are parameters that `paper.toml` does not name, such as seeds, lenses and places of cameras, and
those whose default is another value than there; the test of this module lists them all. Where a robot was tuned in
other ways, as the thesis did or as we do, these have a set each.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Variable
from handover.fmus.catalog import UNITS, import_class
from handover.fmus.contents.related_files import ParameterSet
from handover.scenarios.experiment.paper import paper_entry, paper_values

_DEFAULTS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "TendonArm": ("helix", ("arm",)),
    "TendonArmFast": ("helix", ("arm",)),
    "HandoverPartner": ("helix", ("hand",)),
    "StereoCamera": ("helix", ("camera", "pictures")),
    "FingerInfrared": ("helix", ("infrared",)),
    "HandoverVision": ("helix", ("vision",)),
    "VisualServo": ("helix", ("servo", "own")),
    "GraspReflex": ("helix", ("reflex",)),
    "VslArm": ("vsl", ("arm",)),
    "VacuumGripper": ("vsl", ("gripper",)),
    "TrajectoryPlanner": ("vsl", ("planner",)),
    "PickAndPlace": ("vsl", ("task",)),
    "HybridKinematics": ("vsl", ("kinematics", "hybrid")),
    "FreeFlyer": ("free_flyer", ("robot",)),
    "Navigation": ("free_flyer", ("navigation",)),
    "Thrusters": ("free_flyer", ("thrusters",)),
    "Push": ("free_flyer", ("push",)),
    "HandAndObject": ("free_flyer", ("person",)),
    "LargeObjectAndHands": ("free_flyer", ("person", "large_object")),
    "ImpedanceController": ("free_flyer", ("impedance",)),
    "AdmittanceController": ("free_flyer", ("impedance", "admittance")),
    "ArmImpedanceController": ("free_flyer", ("impedance", "robot", "arm_impedance")),
    "PoseController": ("free_flyer", ("pose",)),
    "HandoverStateMachine": ("free_flyer", ("decision",)),
    "HandoverTeam": ("free_flyer", ("decision", "team_decision")),
    "GraspScene": ("ir_grasp", ("scene",)),
    "IrReflex": ("ir_grasp", ("reflex",)),
}
"""By unit, the folder of its `paper.toml` and the groups with its defaults; of two with one name the later counts."""

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
    if unit not in _DEFAULTS:
        return []
    folder, groups = _DEFAULTS[unit]
    declared = {v.name: v for v in describe(import_class(UNITS[unit].block)).parameters}
    entries: dict[str, dict[str, Any]] = {}
    for group in groups:
        entries |= {n: paper_entry(folder, group, n) for n in paper_values(folder, group) if n in declared}
    return [
        *_by_origin({n: e for n, e in entries.items() if _is_default(declared[n], e["value"])}),
        *(_tuning(folder, group, description, declared) for group, description in _TUNINGS.get(unit, {}).items()),
        *(_behaviour(name) for name in ("rigid", "compliant") if unit in _BEHAVIOURS),
    ]


def _is_default(v: Variable, value: Any) -> bool:
    """Return whether a unit starts from a value; some units of a robot have other defaults than the rest."""
    return v.start.name.lower() == value if v.items else np.array_equal(v.start, value)


def _by_origin(entries: Mapping[str, dict[str, Any]]) -> Iterator[ParameterSet]:
    for name, description in (
        ("published", "Defaults that are published, derived from that, or read off a figure"),
        ("assumed", "Defaults that no source gives"),
    ):
        chosen = {n: e for n, e in entries.items() if (e["status"] == "assumed") == (name == "assumed")}
        if chosen:
            yield _set(name, description, chosen, f"origin:{name}")


def _tuning(folder: str, group: str, description: str, declared: Mapping[str, Variable]) -> ParameterSet:
    entries = {n: paper_entry(folder, group, n) for n in paper_values(folder, group) if n in declared}
    return _set(group, description, entries, f"tuning:{group}")


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


def _set(name: str, description: str, entries: Mapping[str, dict[str, Any]], label: str) -> ParameterSet:
    return ParameterSet(
        name=name,
        description=description,
        values={n: e["value"] for n, e in entries.items()},
        origins={n: f"{e['where']} ({e['status']})" for n, e in entries.items()},
        labels=(label,),
    )
