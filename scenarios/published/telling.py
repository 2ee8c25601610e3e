"""Writes rates, intervals, medians and p-values for claims and tables."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import time_interval


def told_rate(successes: int, n: int) -> str:
    """Return such as `11/15 (73 %)`."""
    return f"{successes}/{n} ({told_share(successes / n)})"


def told_share(share: float) -> str:
    """Return such as `73 %`."""
    return f"{100 * share:.0f} %"


def told_interval(low: float, high: float) -> str:
    """Return the interval of a rate such as `45 to 92 %`."""
    return f"{100 * low:.0f} to {told_share(high)}"


def told_p(p: float) -> str:
    """Return a p-value, such as `0.031` or `2e-12`."""
    return f"{p:.2g}"


def told_median(values: Floats, digits: int) -> str:
    """Return a median with its interval by bootstrap, such as `5.2 (4.8 to 6.1)`; "" of no values."""
    if not len(values):
        return ""
    interval, told = time_interval(values), f"{np.median(values):.{digits}f}"
    return told if interval is None else f"{told} ({interval.low:.{digits}f} to {interval.high:.{digits}f})"
