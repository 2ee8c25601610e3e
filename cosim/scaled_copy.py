"""Copies of a connection that changes its values linearly."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.system.conversion import Linear


class ScaledCopy:
    """Writes factor * source + offset to a target, entry by entry.

    The product is rounded to a double before the offset, also of 0, is added, and the sum once more if the target is
    narrower: whoever does the same in C must keep the compiler from fusing the two operations.
    """

    def __init__(self, target: NDArray[Any], source: NDArray[Any], linear: Linear) -> None:
        self.target, self.source, self.linear = target, source, linear
        self._between: NDArray[np.float64] = np.empty(len(source))

    def __call__(self) -> None:
        """Write the target."""
        np.multiply(self.source, self.linear.factor, out=self._between, dtype=np.float64)
        np.add(self._between, self.linear.offset, out=self._between)
        self.target[...] = self._between
