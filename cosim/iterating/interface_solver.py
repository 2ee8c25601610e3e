"""Equations x = g(x) between coupled units: what a solver of them is, and when x is good enough."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.iterating.magnitudes import Magnitudes

Map = Callable[[Floats], Floats]
"""g: takes the values that go into units and gives back the values that come out; n numbers to n numbers."""

Jacobian = Callable[[], Floats | None]
"""Gives dg/dx (n by n) at the x that g was last called with, or None where it is not known."""


@dataclass(frozen=True)
class Solution:
    """Values x with g(x) = x to the tolerance. g was called with x last."""

    x: Floats
    iterations: int


class Unsolved(Exception):
    """No x was found; `residual` is how far g(x) is from the last `x`."""

    def __init__(self, why: str, iterations: int, x: Floats, residual: Floats) -> None:
        super().__init__(why)
        self.why, self.iterations, self.x, self.residual = why, iterations, x, residual


class InterfaceSolver(Protocol):
    """Solves x = g(x), again and again for one g that changes slowly; what it learns it keeps for the next time."""

    magnitudes: Magnitudes

    def solve(self, g: Map, x: Floats, jacobian: Jacobian | None = None) -> Solution:
        """Solve from a first guess.

        Raises:
            Unsolved: no solution was found.
        """
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return what it has learnt; JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to where `get_state` was called."""
        ...


def residual_of(g: Map, x: Floats, iterations: int) -> Floats:
    """Return g(x) - x.

    Raises:
        Unsolved: it is not finite.
    """
    residual = g(x) - x
    if not np.all(np.isfinite(residual)):
        raise Unsolved("values leave all bounds", iterations, x, residual)
    return residual
