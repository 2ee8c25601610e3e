"""Few rows of a signal that look like all of them."""

import numpy as np
from numpy.typing import NDArray
from tsdownsample import MinMaxLTTBDownsampler

from handover.cosim.blocks.ports import Floats

Rows = NDArray[np.int64]


def rows_of_curve(values: Floats, most: int) -> Rows:
    """Return rows of a curve, shape (rows,), between which straight lines look like it; about `most` at the most.

    Gaps (NaN) stay gaps. Rows are chosen by extremes and by the largest triangles.
    """
    if len(values) <= most:
        return np.arange(len(values))
    finite = np.isfinite(values)
    there = np.flatnonzero(finite)
    if len(there) > most:
        chosen = MinMaxLTTBDownsampler().downsample(np.ascontiguousarray(values[there]), n_out=most)
        there = there[chosen.astype(np.int64)]
    gaps = np.flatnonzero(~finite & np.concatenate(([True], finite[:-1])))  # the first row of each
    return np.union1d(there, gaps[:most])


def rows_of_steps(values: Floats, most: int) -> Rows:
    """Return the rows where a value that is held changes, the first and the last; a curve's if they are too many."""
    if len(values) == 0:
        return np.zeros(0, np.int64)
    changes = changes_of(values)
    if len(changes) > most:
        return rows_of_curve(values, most)
    return np.union1d(np.append(changes, 0), [len(values) - 1])


def changes_of(values: Floats) -> Rows:
    """Return the rows whose value is another than that before; from gap to gap (NaN) is no change."""
    before, after = values[:-1], values[1:]
    return np.flatnonzero((before != after) & ~(np.isnan(before) & np.isnan(after))) + 1
