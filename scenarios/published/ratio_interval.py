"""The bootstrap's interval of a ratio of two groups."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import LEVEL, RESAMPLES, Statistic


def ratio_interval(x: Floats, y: Floats, statistic: Statistic) -> tuple[float, float] | None:
    """Return the percentile interval, at 1 - LEVEL, of statistic(x) / statistic(y); each group is resampled by itself.

    A resample whose denominator is 0 counts as an infinite ratio, or as none if its numerator is 0 too. None if that
    leaves the interval an end that is not finite.
    """
    rng = np.random.default_rng(0)
    above, below = (statistic(v[rng.integers(len(v), size=(RESAMPLES, len(v)))], axis=-1) for v in (x, y))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = above / below
    ratios = ratios[~np.isnan(ratios)]
    if not len(ratios):
        return None
    low, high = (float(v) for v in np.quantile(ratios, [LEVEL / 2, 1.0 - LEVEL / 2], method="inverted_cdf"))
    return (low, high) if np.isfinite(high) else None
