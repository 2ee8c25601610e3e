"""Arms that differ from the one that the learned model was trained on; the controller does not know how.

One factor each for all links, gears or joints, and a scatter that is drawn for each of them apart, from a seed of its
own: the same arm in every run with that seed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from handover.controllers.vsl.hybrid_kinematics import LENGTHS
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PlacedUnit
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.robots.vsl.parameters import Parameters

_NAMES = {
    "EI_factor": ("2", "3"),
    "mass_factor": ("2", "3"),
    "friction_factor": ("J1", "J2", "J3"),
    "joint_factor": ("J2", "J3"),
}
"""Of what an arm is made that has a factor: its links, gears or joints."""

_MEANINGS = {
    "EI_factor": "bending stiffness of link {} over the usual one",
    "mass_factor": "mass of link {} over the usual one",
    "friction_factor": "friction of the gear of {} over the usual one",
    "joint_factor": "stiffness of {} behind the encoder over the usual one",
}

_ASSUMING = ("planner", "kinematics")
"""Units that assume lengths of the links."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """How an arm differs: factors of its links, gears and joints, and lengths of its links, m."""

    EI_factor: Floats
    mass_factor: Floats
    friction_factor: Floats
    joint_factor: Floats
    L_2: float
    L_3: float

    @property
    def settings(self) -> dict[str, Any]:
        """What the parameters of `VslArm` are to be set to: those that are not their defaults."""
        usual = ArmParams()
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: value for name, value in values.items() if not np.array_equal(value, getattr(usual, name))}

    @property
    def metrics(self) -> dict[str, Metric]:
        """What of the arm is not as usual."""
        found: dict[str, Metric] = {}
        for name, value in self.settings.items():
            if name in _NAMES:
                for part, factor in zip(_NAMES[name], value.tolist(), strict=False):
                    found[f"{name}_{part}"] = Metric(factor, "1", _MEANINGS[name].format(part))
            else:
                found[name] = Metric(value, "m", f"length of link {name[-1]}, of which the controller knows nothing")
        return found


def unlike_lengths(units: Mapping[str, PlacedUnit]) -> str:
    """Return which links of the arm are not as long as kinematics or planner assume, as the end of a sentence."""
    found: list[str] = []
    for name in LENGTHS:
        usual = float(getattr(ArmParams(), name))
        actual, *assumed = (_length(units, unit, name, usual) for unit in ("arm", *_ASSUMING))
        wrong = [f"the {unit} took it for {x:g} m" for unit, x in zip(_ASSUMING, assumed, strict=True) if x != actual]
        if wrong:
            found.append(f"; {name} of the arm was {actual:g} m, and {' and '.join(wrong)}")
    return "".join(found)


def _length(units: Mapping[str, PlacedUnit], unit: str, name: str, otherwise: float) -> float:
    if unit not in units:
        return otherwise
    declared = units[unit].description.parameters
    stated = units[unit].start.get(name, declared[name].start if name in declared else otherwise)
    return float(stated if stated is not None else otherwise)


def arm_of(parameters: Parameters) -> Arm:
    """Return the arm of a run.

    A factor is multiplied by exp(arm_scatter z), a length gets length_scatter z more, with z drawn from a normal
    distribution for each link, gear and joint by itself; scatters do not change what is drawn.
    """
    p = parameters
    z = np.random.default_rng(p.arm_seed).standard_normal(13)
    links, masses, gears, joints, lengths = np.split(z, [3, 6, 9, 11])
    usual = ArmParams()
    L_2, L_3 = (np.array([usual.L_2, usual.L_3]) + p.length_scatter * lengths).tolist()
    return Arm(
        EI_factor=p.EI_factor * np.exp(p.arm_scatter * links),
        mass_factor=p.mass_factor * np.exp(p.arm_scatter * masses),
        friction_factor=p.friction_factor * np.exp(p.arm_scatter * gears),
        joint_factor=p.joint_factor * np.exp(p.arm_scatter * joints),
        L_2=L_2,
        L_3=L_3,
    )
