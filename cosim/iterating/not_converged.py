"""What a run ends with when units do not come to agree."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from handover.cosim.exceptions import UnitFailure
from handover.cosim.iterating.interface import Interface
from handover.cosim.iterating.interface_solver import Unsolved
from handover.cosim.iterating.magnitudes import Magnitudes


class NotConverged(UnitFailure):
    """Units that act on each other in a circle did not come to agree at a time.

    Attributes:
        units: their names.
        loop: the algebraic loop spelled out where it is one, or an empty text.
        why: what the solver says.
        iterations: how often it tried.
        moving: the signals that still move, those that move most first; how far each is from what its source gives.
    """

    kind: ClassVar[str] = "not_converged"
    verdict: ClassVar[str] = "units did not come to agree"

    def __init__(
        self,
        units: Sequence[str],
        t: float,
        why: str,
        iterations: int,
        moving: Sequence[tuple[str, float]],
        loop: str = "",
    ) -> None:
        self.units, self.why, self.iterations, self.moving, self.loop = tuple(units), why, iterations, moving, loop
        lines = [f"algebraic loop: {loop}"] if loop else []
        lines += [f"{name} still moves by {by:.3g}" for name, by in moving]
        super().__init__(", ".join(units), "iterating", t, f"no solution: {why}", lines)

    @property
    def what(self) -> str:
        """What happened, to be read after the call."""
        count = f"{self.iterations} iteration{'s' if self.iterations > 1 else ''}"
        return f"came to no solution in {count}: {self.why}"

    @property
    def told(self) -> str:
        """What happened, the signal that moves most, and the loop."""
        most = [f"{name} still moves by {by:.3g}" for name, by in self.moving[:1]]
        return "; ".join([self.what, *most, *([f"algebraic loop: {self.loop}"] if self.loop else [])])

    def as_data(self) -> dict[str, Any]:
        """Return the failure as JSON can hold it."""
        return {**super().as_data(), "iterations": self.iterations, "moving": dict(self.moving)}


def not_converged(
    units: Sequence[str], t: float, e: Unsolved, interface: Interface, magnitudes: Magnitudes, loop: str = ""
) -> NotConverged:
    """Return the failure of a solver, with the signals by name."""
    still, shares = magnitudes.moving(e.x, e.residual), magnitudes.shares(e.x, e.residual)
    order: list[int] = np.argsort(-shares).tolist()
    moving = [(interface.names[i], float(e.residual[i])) for i in order if still[i]]
    return NotConverged(units, t, e.why, e.iterations, moving, loop)
