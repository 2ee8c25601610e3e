"""Probing moves: each control input is changed in turn, and what that does is measured. [Luberto] eq. (7)."""

import numpy as np

from handover.controllers.reflex_move import X
from handover.cosim.blocks.ports import Floats


class Probing:
    """Gathers the Jacobian of the residuals column by column, J(:, j) = dr / dx_j, eq. (7), by measured moves.

    A residual whose finger loses the object on a move is asked for once more by the opposite move. What stays unseen
    both ways is taken not to depend on that input.

    Args:
        sizes: the move of each input, m, m, rad, 1.
    """

    def __init__(self, sizes: X) -> None:
        self._sizes = sizes
        self._start: X = ()
        self._x: X = ()
        self._r: Floats = np.zeros(0)
        self.jacobian: Floats = np.zeros((0, 4))
        self._open: list[bool] = []  # residuals whose entry in the column under way is not known
        self._input, self._sign = 0, 1.0

    def begin(self, start: X, x: X, r: Floats) -> None:
        """Begin under the command `start`, at measured inputs x, with the residuals r there, all of them seen."""
        self._start, self._x, self._r = start, x, np.array(r)
        self.jacobian = np.zeros((len(r), 4))
        self._input, self._sign = 0, 1.0
        self._open = [True] * len(r)

    @property
    def done(self) -> bool:
        """Whether every input has been tried."""
        return self._input == len(self._sizes)

    @property
    def command(self) -> X:
        """The next move; back to where it began when every input has been tried."""
        if self.done:
            return self._start
        changed = list(self._start)
        changed[self._input] += self._sign * self._sizes[self._input]
        changed[3] = min(max(changed[3], 0.0), 1.0)  # an open hand does not open further
        return tuple(changed)

    def take(self, x: X, r: Floats, seen: list[bool]) -> None:
        """Take what a move led to: measured inputs, residuals, and which of them are of fingers that see."""
        j = self._input
        moved = x[j] - self._x[j]
        for i, is_open in enumerate(self._open):
            if is_open and seen[i] and abs(moved) > 0.5 * abs(self._sizes[j]):
                self.jacobian[i, j] = (r[i] - self._r[i]) / moved
                self._open[i] = False
        if any(self._open) and self._sign > 0.0:
            self._sign = -1.0
            return
        self._input, self._sign = j + 1, 1.0
        self._open = [True] * len(self._r)

    def get_state(self) -> tuple[X, X, Floats, Floats, list[bool], int, float]:
        """Return where it began, what it found, and what comes next."""
        return self._start, self._x, self._r, np.array(self.jacobian), list(self._open), self._input, self._sign

    def set_state(self, state: tuple[X, X, Floats, Floats, list[bool], int, float]) -> None:
        """Go back to a state that `get_state` gave."""
        self._start, self._x, self._r, jacobian, is_open, self._input, self._sign = state
        self.jacobian, self._open = np.array(jacobian), list(is_open)
