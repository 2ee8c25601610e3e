"""What units start with, as a scenario's checks read it, and how these say that bodies are in each other."""

import math
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import PlacedUnit

LEAST_DEPTH = 1e-3
"""Metres in each other from which bodies count as that."""


def value_of(unit: PlacedUnit, name: str) -> object:
    """Return a parameter's value: what the unit was given, or the start value that its FMU declares."""
    if name in unit.start:
        return unit.start[name]
    entries = (unit.description.parameters[name].start or "0").split()
    return entries if len(entries) > 1 else entries[0]


def array_of(unit: PlacedUnit, name: str) -> Floats:
    """Return a parameter's value in its shape, of a number in (1,): as given, or as its FMU declares it."""
    shape = unit.description.parameters[name].shape
    return np.array(cast(Any, value_of(unit, name)), dtype=np.float64).reshape(shape or (1,))


def penetration_fault(name: str, what: str, where: str, depth: float, out: Floats) -> str:
    """Return what is wrong with a body that starts in another one, and how to move it; "" if it does not.

    Args:
        name: the parameter that moves the body.
        what: the body and what it would do, such as "a hand would start".
        where: the other body.
        depth: how deep the one is in the other, m; negative if it is not.
        out: the way out, in W, shape (3,), of length 1.
    """
    if depth < LEAST_DEPTH:
        return ""
    way = ", ".join(f"{x:+.3f}" for x in math.ceil(1e3 * depth) / 1e3 * out + 0.0)
    return f"{name}: {what} {depth:.3f} m inside {where}; move it by ({way}) m, or farther"
