"""What a page keeps of the rows of a run under way."""

from itertools import pairwise

import pytest

from handover.scenarios.live.live_scene import Row, ThinnedRows


@pytest.mark.parametrize("most", [99, 100])
@pytest.mark.parametrize("at_once", [1, 7, 500])
def test_rows_are_thinned_evenly_however_many_come_and_the_newest_is_kept(most: int, at_once: int):
    thinned, rows = ThinnedRows(most), [Row((float(k), [])) for k in range(5000)]
    for first in range(0, len(rows), at_once):
        come = rows[first : first + at_once]
        thinned.add(come)
        times = [t for t, _ in thinned.rows]
        steps = {b - a for a, b in pairwise(times[:-1])}
        assert times[0] == 0.0
        assert times[-1] == come[-1][0]
        assert len(steps) <= 1, "rows lie at equal distances, but for the newest"
        assert len(times) <= most + 1
        assert len(times) >= min(first + len(come), most // 2)
