"""Fixed-point iteration with Aitken's relaxation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.iterating.interface_solver import Jacobian, Map, Solution, Unsolved, residual_of
from handover.cosim.iterating.magnitudes import Magnitudes


class FixedPoint:
    """x <- x + w r with r = g(x) - x and w <- -w r'.(r - r') / |r - r'|^2, where r' is the residual before.

    The relaxation w begins at 1, which is plain iteration, and adapts to how r answers; for a single signal this is
    the secant method, which also converges where plain iteration diverges. Residuals are divided by the signals'
    magnitudes. [Kuettler2008] Fixed-point fluid-structure interaction solvers with dynamic relaxation, eq. (44);
    after Irons and Tuck (1969).

    Args:
        magnitudes: measures what has converged.
        most_iterations: after so many calls of g, it gives up.
    """

    def __init__(self, magnitudes: Magnitudes, most_iterations: int) -> None:
        self.magnitudes = magnitudes
        self._most = most_iterations

    def solve(self, g: Map, x: Floats, jacobian: Jacobian | None = None) -> Solution:  # noqa: ARG002
        """Iterate; see `InterfaceSolver`."""
        scale = self.magnitudes.of(x)
        weight = 1.0
        before: Floats | None = None
        residual = residual_of(g, x, 1)
        for iteration in range(1, self._most):
            if not np.any(self.magnitudes.moving(x, residual)):
                self.magnitudes.learn(x)
                return Solution(x, iteration)
            if before is not None:
                weight = _relaxation(weight, before / scale, residual / scale)
            x, before = x + weight * residual, residual
            residual = residual_of(g, x, iteration + 1)
        if np.any(self.magnitudes.moving(x, residual)):
            raise Unsolved("values have not settled", self._most, x, residual)
        self.magnitudes.learn(x)
        return Solution(x, self._most)

    def get_state(self) -> Mapping[str, Any]:
        """Return the magnitudes; see `InterfaceSolver`."""
        return {"magnitudes": self.magnitudes.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to what `get_state` gave."""
        self.magnitudes.set_state(state["magnitudes"])


def _relaxation(weight: float, before: Floats, residual: Floats) -> float:
    change = residual - before
    length = float(change @ change)
    return weight if length == 0.0 else -weight * float(before @ change) / length
