"""Chooses the size of steps from the errors of earlier ones."""

from collections.abc import Mapping
from typing import Any

_K_I, _K_P = 0.3, 0.4
_SAFETY = 0.9
_LEAST, _MOST = 0.2, 5.0
"""How much a step may shrink or grow at once."""
_FLOOR = 1e-10
"""An error of 0 would ask for an infinite step."""


class PiController:
    """Proportional-integral control of the step, which is smoother than to follow the last error alone.

    After a step with the error r, in units of what is tolerated, the next one is longer by
    s (1/r)^(k_I/k) (r_before/r)^(k_P/k), k_I = 0.3, k_P = 0.4, for an error that goes with the k-th power of the step;
    s is a margin. After a rejected step, and in the first step after that, the error alone counts: s (1/r)^(1/k).

    Source: K. Gustafsson, Control theoretic techniques for stepsize selection in explicit Runge-Kutta methods, ACM
    Trans. Math. Softw. 17 (1991) 533-554.
    """

    def __init__(self, power: int) -> None:
        self._power = power
        self._before: float | None = None

    def after_acceptance(self, error: float) -> float:
        """Return the next step's length over that of an accepted one, which was this erroneous."""
        r = max(error, _FLOOR)
        if self._before is None:
            change = _SAFETY * r ** (-1 / self._power)
        else:
            change = _SAFETY * r ** (-_K_I / self._power) * (self._before / r) ** (_K_P / self._power)
        self._before = r
        return min(max(change, _LEAST), _MOST)

    def after_rejection(self, error: float) -> float:
        """Return the next attempt's length over that of a rejected step, which was this erroneous."""
        self._before = None
        change = _SAFETY * error ** (-1 / self._power) if error < float("inf") else _LEAST
        return min(max(change, _LEAST), _SAFETY)

    def get_state(self) -> Mapping[str, Any]:
        """Return what is remembered as JSON can hold it."""
        return {"before": self._before}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to what `get_state` gave."""
        self._before = state["before"]
