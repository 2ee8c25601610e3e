"""Solvers of x = g(x), the equations of coupled units: relaxed fixed-point iteration and Newton's method.

x are the signals that lead back in a cycle, and g evaluates the units of it once, which is the expensive part.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.stepping.interface import Interface, Magnitudes

Map = Callable[[Floats], Floats]
"""g: from the n values that go into the units to the n values that come out of them."""

Jacobian = Callable[[], Floats | None]
"""Gives dg/dx (n by n) at the x that g was last called with, or None where it is not known."""


@dataclass(frozen=True)
class Solution:
    """Values x with g(x) = x within the tolerance. x is what g was called with last."""

    x: Floats
    iterations: int


class Unsolved(Exception):
    """No x was found; `residual` is how far g(x) is from the last `x`."""

    def __init__(self, why: str, iterations: int, x: Floats, residual: Floats) -> None:
        super().__init__(why)
        self.why, self.iterations, self.x, self.residual = why, iterations, x, residual


class InterfaceSolver(Protocol):
    """Solves x = g(x), again and again for a g that changes slowly; it keeps its state for the next solution."""

    magnitudes: Magnitudes

    def __init__(self, magnitudes: Magnitudes, max_iterations: int) -> None: ...

    def solve(self, g: Map, x: Floats, jacobian: Jacobian | None = None) -> Solution:
        """Solve from a first guess.

        Raises:
            Unsolved: no solution was found.
        """
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return its state as JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        ...


MakeSolver = Callable[[Interface], InterfaceSolver]
"""Makes a solver for the inputs that lead back in a cycle."""


def residual_of(g: Map, x: Floats, iterations: int) -> Floats:
    """Return g(x) - x.

    Raises:
        Unsolved: it is not finite.
    """
    residual = g(x) - x
    if not np.all(np.isfinite(residual)):
        raise Unsolved("values diverge beyond all bounds", iterations, x, residual)
    return residual


class FixedPoint:
    """x <- x + w r with r = g(x) - x and w <- -w r'.(r - r') / |r - r'|^2, where r' is the residual before.

    The relaxation w begins at 1, which is plain iteration, and adapts to the change of r; for a single signal this is
    the secant method, which also converges where plain iteration diverges. Residuals are divided by the signals'
    magnitudes. [Kuettler2008] Fixed-point fluid-structure interaction solvers with dynamic relaxation, eq. (44);
    after Irons and Tuck (1969).

    Args:
        magnitudes: measures what has converged.
        max_iterations: after so many calls of g, it gives up.
    """

    def __init__(self, magnitudes: Magnitudes, max_iterations: int) -> None:
        self.magnitudes = magnitudes
        self._max_iterations = max_iterations

    def solve(self, g: Map, x: Floats, jacobian: Jacobian | None = None) -> Solution:  # noqa: ARG002
        """Iterate; see `InterfaceSolver`."""
        scale = self.magnitudes.of(x)
        weight = 1.0
        before: Floats | None = None
        residual = residual_of(g, x, 1)
        for iteration in range(1, self._max_iterations):
            if not np.any(self.magnitudes.moving(x, residual)):
                self.magnitudes.learn(x)
                return Solution(x, iteration)
            if before is not None:
                weight = _relaxation(weight, before / scale, residual / scale)
            x, before = x + weight * residual, residual
            residual = residual_of(g, x, iteration + 1)
        if np.any(self.magnitudes.moving(x, residual)):
            raise Unsolved("values have not converged", self._max_iterations, x, residual)
        self.magnitudes.learn(x)
        return Solution(x, self._max_iterations)

    def get_state(self) -> Mapping[str, Any]:
        """Return the magnitudes; see `InterfaceSolver`."""
        return {"magnitudes": self.magnitudes.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self.magnitudes.set_state(state["magnitudes"])


def _relaxation(weight: float, before: Floats, residual: Floats) -> float:
    change = residual - before
    length = float(change @ change)
    return weight if length == 0.0 else -weight * float(before @ change) / length


_SINGULAR = 1e-7
"""Below this singular value of I - dg/dx, in magnitudes, differences of g cannot tell a solution from none."""
_NO_SOLUTION = "the equations are singular: signals act on themselves with a gain of 1"
_SLOW = 0.5
"""An iteration that leaves more than this part of the residual shows that the Jacobian is out of date."""


class InterfaceNewton:
    """x <- x + (I - J)^-1 (g(x) - x), where J is dg/dx.

    J is from the units' directional derivatives, or differences of g. It is corrected by Broyden's update at each
    iteration, kept for the next solution and renewed when an iteration does not halve the residual: as g is a whole
    step of units, differences cost far more than iterations. [Sicklinger2014] Interface Jacobian-based co-simulation;
    [Broyden1965] A class of methods for solving nonlinear simultaneous equations.

    Args:
        magnitudes: measures what has converged; J is scaled by them.
        max_iterations: after so many calls of g, differences not counted, it gives up.
    """

    def __init__(self, magnitudes: Magnitudes, max_iterations: int) -> None:
        self.magnitudes = magnitudes
        self._max_iterations = max_iterations
        self._kept: Floats | None = None

    def solve(self, g: Map, x: Floats, jacobian: Jacobian | None = None) -> Solution:
        """Iterate; see `InterfaceSolver`."""
        residual: Floats = residual_of(g, x, 1)
        fresh = False
        for iteration in range(1, self._max_iterations):
            if not np.any(self.magnitudes.moving(x, residual)):
                return self._solved(x, iteration)
            dx = self._step(x, residual)
            if dx is None and not fresh:
                self._kept, fresh = self._derivative(g, x, residual, jacobian), True
                dx = self._step(x, residual)
            if dx is None or self._kept is None:
                self._kept = None
                raise Unsolved(_NO_SOLUTION, iteration, x, residual)
            moved: Floats = x + dx
            after = residual_of(g, moved, iteration + 1)
            slow = not fresh and self.magnitudes.length(moved, after) > _SLOW * self.magnitudes.length(moved, residual)
            self._kept = None if slow else self._updated(self._kept, dx, dx + after - residual, moved)
            x, residual, fresh = moved, after, False
        if np.any(self.magnitudes.moving(x, residual)):
            self._kept = None
            raise Unsolved("values have not converged", self._max_iterations, x, residual)
        return self._solved(x, self._max_iterations)

    def get_state(self) -> Mapping[str, Any]:
        """Return the magnitudes and the Jacobian; see `InterfaceSolver`."""
        kept = None if self._kept is None else self._kept.tolist()
        return {"magnitudes": self.magnitudes.get_state(), "jacobian": kept}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self.magnitudes.set_state(state["magnitudes"])
        kept = state["jacobian"]
        self._kept = None if kept is None else np.array(kept, dtype=np.float64)

    def _solved(self, x: Floats, iterations: int) -> Solution:
        self.magnitudes.learn(x)
        return Solution(x, iterations)

    def _derivative(self, g: Map, x: Floats, residual: Floats, jacobian: Jacobian | None) -> Floats:
        given = None if jacobian is None else jacobian()
        return differences(g, x, x + residual, self.magnitudes.perturbations(x)) if given is None else given

    def _step(self, x: Floats, residual: Floats) -> Floats | None:
        """Return (I - J)^-1 r, computed in magnitudes, or None where I - J is singular or J not known."""
        if self._kept is None:
            return None
        scale = self.magnitudes.of(x)
        matrix = np.eye(len(x)) - self._kept * scale / scale[:, None]
        if not np.all(np.isfinite(matrix)) or np.linalg.svd(matrix, compute_uv=False)[-1] < _SINGULAR:
            return None
        return scale * np.linalg.solve(matrix, residual / scale)

    def _updated(self, kept: Floats, dx: Floats, dy: Floats, x: Floats) -> Floats:
        """Return J with the least change, in magnitudes, that makes J dx = dy."""
        weighted = dx / self.magnitudes.of(x) ** 2
        length = float(dx @ weighted)
        return kept if length == 0.0 else kept + np.outer(dy - kept @ dx, weighted) / length


def differences(g: Map, x: Floats, y: Floats, perturbations: Floats) -> Floats:
    """Return dg/dx by forward differences, where y = g(x); column i takes a call of g."""
    moved: Floats = x + np.diag(perturbations)
    return np.stack([(g(row) - y) / np.sum(row - x) for row in moved], axis=1)
