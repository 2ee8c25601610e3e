"""When signals of unlike size count as settled."""

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats


class Magnitudes:
    """Measures differences of signals against how large each signal is.

    A signal counts as large as the largest value that it has had in a solution, and at least as large as its floor:
    what it is nominally, or a small number, so that a signal that rests at zero converges. Differences divided by these
    magnitudes have no unit and can be compared.

    Args:
        tolerance: the largest difference, relative to a signal's magnitude, at which it counts as converged.
        floors: least magnitude of each signal, in its unit.
        perturbations: by which part of its magnitude each signal is moved to see what it acts on.
    """

    def __init__(self, tolerance: float, floors: Floats, perturbations: Floats) -> None:
        self.tolerance = tolerance
        self._largest = np.array(floors)
        self._perturbations = perturbations

    def of(self, x: Floats) -> Floats:
        """Return the magnitudes of signals that have the values x."""
        return np.maximum(self._largest, np.abs(x))

    def perturbations(self, x: Floats) -> Floats:
        """Return by how much to move each signal from x to see what it acts on."""
        return self._perturbations * self.of(x)

    def moving(self, x: Floats, residual: Floats) -> NDArray[np.bool_]:
        """Tell which signals have not converged; what is not a number has not."""
        return ~(np.abs(residual) <= self.tolerance * self.of(x))

    def length(self, x: Floats, residual: Floats) -> float:
        """Return the length of a difference of signals that have the values x."""
        return float(np.linalg.norm(self.shares(x, residual)))

    def shares(self, x: Floats, residual: Floats) -> Floats:
        """Return the parts that differences make of the magnitudes of signals that have the values x."""
        parts: Floats = np.abs(residual) / self.of(x)
        return np.nan_to_num(parts, nan=np.inf)

    def learn(self, x: Floats) -> None:
        """Remember how large the signals of a solution are."""
        self._largest = self.of(x)

    def get_state(self) -> list[float]:
        """Return the magnitudes, for `set_state`."""
        return self._largest.tolist()

    def set_state(self, state: list[float]) -> None:
        """Go back to magnitudes that `get_state` gave."""
        self._largest = np.array(state)
