"""What a block offers that knows the derivatives of its outputs by its inputs."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handover.cosim.block import Block


class DifferentiableBlock(Block, Protocol):
    """A block with exact derivatives of its real outputs by its real inputs.

    They are of `outputs` as a function of u, with the block's state as it is; at a kink either side's will do. A block
    is taken for one by having the method.
    """

    def directional_derivative(
        self, t: float, u: Any, du: Mapping[str, float | NDArray[np.float64]]
    ) -> Mapping[str, float | NDArray[np.float64]]:
        """Return the outputs' derivatives in the direction du: dy = (dy/du) du.

        Args:
            t: time, s.
            u: inputs where the derivative is taken.
            du: direction by input's name, a float or an array of the input's shape, per unit of the direction's
                parameter; inputs that are not named do not change.

        Returns:
            Derivatives by output's name, of the output's shape; those that are not named are zero.
        """
        ...
