"""How long it takes from a hand's movement to the picture that shows it, as the page measures it, over a round."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

_LONGEST = 60_000.0
"""Time that counts as a measurement at most, ms; a page that was hidden for longer draws nothing."""
_MOST = 100_000
"""Measurements that are kept: of half an hour at 60 pictures a second."""


class LatencyLog:
    """Times from input to drawn picture in a round, ms: one for each picture that shows a newer sample of the hand."""

    def __init__(self) -> None:
        self._times: list[float] = []

    def add(self, values: Any) -> None:
        """Add times that a page has measured.

        Raises:
            ValueError: they are no list of finite times from 0 on, in ms; none of them is added.
        """
        given: list[Any] = cast(list[Any], values) if isinstance(values, list) else [None]
        if not all(_is_time(v) for v in given):
            raise ValueError(f"drawn takes a list of times from 0 to {_LONGEST:g} ms")
        self._times += [float(v) for v in given][: _MOST - len(self._times)]

    @property
    def median(self) -> float | None:
        """Median, ms; None if nothing was measured."""
        return self._quantile(0.5)

    @property
    def p95(self) -> float | None:
        """Time that 5 of 100 pictures exceed, ms."""
        return self._quantile(0.95)

    @property
    def longest(self) -> float | None:
        """The longest of them, ms."""
        return self._quantile(1.0)

    def _quantile(self, share: float) -> float | None:
        return round(float(np.quantile(self._times, share)), 3) if self._times else None


def _is_time(value: Any) -> bool:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and 0.0 <= value <= _LONGEST


def median_ms(ages: Sequence[float]) -> float | None:
    """Return the median of ages in s, in ms; None of none."""
    return round(1000.0 * float(np.median(ages)), 3) if len(ages) else None
