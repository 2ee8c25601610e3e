"""Starts in which the tip or the elbow of the arm is below the ground, or the tip below what stops it.

The ground is at z = 0 of W, and nothing in the simulation keeps the arm out of it.
"""

from collections.abc import Mapping

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.starts import LEAST_DEPTH, array_of

_OF_ARM = {"q_0", "L_1", "L_2", "L_3"}


def start_faults(units: Mapping[str, PlacedUnit], *, elbow: bool) -> list[str]:
    """Return which of the arm's elbow and tip start too low, by how much, and the angles that raise them.

    By stiff links, [Gandarias2020] eq. (1): sag brings a tip lower. What a unit in the place of the arm does not have
    is not checked.

    Args:
        units: those of the system.
        elbow: whether the elbow, too, has to be above the ground.
    """
    arm = units.get("arm")
    if arm is None or not arm.description.parameters.keys() >= _OF_ARM:
        return []
    q = array_of(arm, "q_0")
    parts, number = [_number(arm, f"L_{i}") for i in (1, 2, 3)], int(_number(arm, "links", 2.0))
    if number == 1:
        parts = parts[:2]
    elif number == 3:
        parts[2] += _number(arm, "L_4")
    face = max(0.0, _number(arm, "face"))
    floor = "the ground" if face == 0.0 else f"the face at {face:g} m"
    heights = _heights(parts, q)
    names = ["the tip"] if number == 1 else ["the elbow", "the tip"]
    faults: list[str] = []
    for i, (name, z) in enumerate(zip(names, heights, strict=True), 1):
        lowest, below = (face, floor) if name == "the tip" else (0.0, "the ground")
        if z < lowest - LEAST_DEPTH and (elbow or name == "the tip"):
            base, length = ([parts[0], *heights])[i - 1], parts[i]
            raised = _raised(q, i, float(np.arcsin(np.clip((lowest - base) / length, -1.0, 1.0))))
            faults.append(
                f"{arm.name}.q_0: {name} would start {lowest - z:.3f} m below {below}; "
                + (f"joint {i + 1} at {raised:.3f} rad or more holds it above" if base + length > lowest else _HIGHER)
            )
    return faults


_HIGHER = "a larger angle of joint 2 raises it"


def _number(arm: PlacedUnit, name: str, otherwise: float = 0.0) -> float:
    return float(array_of(arm, name)[0]) if name in arm.description.parameters else otherwise


def _heights(parts: list[float], q: Floats) -> list[float]:
    """Return the heights of the ends of the links, m: of shoulder height and lengths, at joint angles."""
    inclinations = np.cumsum(q[1 : len(parts)])
    return (parts[0] + np.cumsum(np.array(parts[1:]) * np.sin(inclinations))).tolist()


def _raised(q: Floats, i: int, inclination: float) -> float:
    """Return the least angle of joint i + 1, rad, rounded upwards, at which its link has an inclination."""
    return float(np.ceil(1e3 * (inclination - float(np.sum(q[1:i])))) / 1e3)
