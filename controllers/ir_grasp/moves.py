"""Commanded moves of wrist and closure with a reading at their end, and probing of the Jacobian. [Luberto] eq. (7)."""

from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats

_MADE = 0.5  # share of a probing move that the encoders must show (assumed)

X = tuple[float, ...]
"""Control inputs [p_x, p_y, yaw, sigma]: m, m, rad, 1."""


class Reading(NamedTuple):
    """Means over some scans at rest: encoders x and sensors, in ticks, shape (3,)."""

    x: X
    ticks: tuple[float, ...]


class Move:
    """Waits until the encoders have come to a goal or the time is up, lets the fingers calm down, averages scans.

    Args:
        tolerance: distance of encoders and goal at which the move is done, by input.
        calm: control periods between arrival and the first scan that counts. At least 1: what is read at the instant
            of arrival was scanned during the move.
    """

    def __init__(self, tolerance: X, calm: int) -> None:
        self._tolerance, self._calm = tolerance, calm
        self.goal: X = ()
        self._scans, self._periods, self._elapsed, self._rested = 0, 0, 0, 0
        self._sum: list[float] = []

    def start(self, goal: X, scans: int, periods: int) -> None:
        """Begin a move that ends with the mean of so many scans, or, if 0, on arrival.

        After so many control periods it counts as arrived in any case: what the fingers push against may keep the
        closure from its goal.
        """
        self.goal = goal
        self._scans, self._periods, self._elapsed, self._rested = scans, periods, 0, -1
        self._sum = [0.0] * 7

    def advance(self, x: X, ticks: X) -> Reading | None:
        """Read encoders and sensors once; return the reading when the move is over, else None."""
        if self._rested < 0 and (self._elapsed >= self._periods or self._arrived(x)):
            self._rested = 0
            if not self._scans:
                return Reading(x, ticks)
        elif self._rested >= 0:
            self._rested += 1
            if self._rested >= self._calm:
                self._sum = [a + b for a, b in zip(self._sum, (*x, *ticks), strict=True)]
            if self._rested == self._calm + self._scans - 1:
                mean = [a / self._scans for a in self._sum]
                return Reading(tuple(mean[:4]), tuple(mean[4:]))
        self._elapsed += 1
        return None

    def _arrived(self, x: X) -> bool:
        return all(abs(a - b) <= tol for a, b, tol in zip(x, self.goal, self._tolerance, strict=True))

    def get_state(self) -> tuple[X, tuple[int, int, int, int], list[float]]:
        """Return goal, counters and sums."""
        return self.goal, (self._scans, self._periods, self._elapsed, self._rested), list(self._sum)

    def set_state(self, state: tuple[X, tuple[int, int, int, int], list[float]]) -> None:
        """Restore a state that `get_state` gave."""
        self.goal, (self._scans, self._periods, self._elapsed, self._rested), total = state
        self._sum = list(total)


class Probing:
    """Gathers the Jacobian of the residuals column by column, J(:, j) = dr / dx_j, eq. (7), by measured moves.

    A residual whose finger loses the object on a move is measured once more by the opposite move. What stays unseen
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
        self._open: list[bool] = []  # residuals whose entry in the current column is not known
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
            if is_open and seen[i] and abs(moved) > _MADE * abs(self._sizes[j]):
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
        """Restore a state that `get_state` gave."""
        self._start, self._x, self._r, jacobian, is_open, self._input, self._sign = state
        self.jacobian, self._open = np.array(jacobian), list(is_open)
