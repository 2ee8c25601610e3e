"""The moments of a run that a replay shows, and the phases between them."""

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record

MOST = 240
"""Frames of a replay; the page moves bodies smoothly between them."""


def frame_rows(time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the rows of a record, rising, that lie about evenly in time, first and last among them."""
    last = len(time) - 1
    wanted: Floats = np.linspace(float(time[0]), float(time[-1]), min(MOST, len(time)))
    after = np.clip(np.searchsorted(time, wanted), min(1, last), last)
    nearest = after - (wanted - time[after - 1] < time[after] - wanted)
    return np.unique([0, *nearest.tolist(), last]).astype(np.int64)


def phase_changes(record: Record, signal: str) -> list[tuple[float, str]]:
    """Return when each phase begins, s, and its name as one reads it; nothing for the signal ""."""
    if not signal:
        return []
    values, names = record[signal], record.items(signal)
    begins = np.append(0, np.flatnonzero(np.diff(values)) + 1)
    return [
        (float(record.time[k]), names.get(int(values[k]), str(values[k])).replace("_", " ").lower()) for k in begins
    ]
