from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.fmu.buffers import joined


def apply_copies(copies: list[tuple[NDArray[Any], NDArray[Any]]]) -> None:
    for target, source in copies:
        target[...] = source


def test_copies_that_follow_each_other_on_both_sides_become_one():
    a, b = np.zeros(9), np.arange(9.0)
    copies = joined([(a[3:7], b[4:8]), (a[0:3], b[1:4])])
    apply_copies(copies)
    assert len(copies) == 1
    assert a.tolist() == [1, 2, 3, 4, 5, 6, 7, 0, 0]


def test_copies_that_do_not_follow_each_other_stay_apart():
    a, b, c = np.zeros(6), np.arange(6.0), np.full(6, 9.0)
    for second in ((a[3:5], b[2:4]), (a[3:5], c[3:5]), (a[4:6], b[3:5])):
        a[:] = 0.0
        copies = joined([(a[0:3], b[0:3]), second])
        apply_copies(copies)
        assert len(copies) == 2
        assert a[:3].tolist() == [0, 1, 2]
        assert second[0].tolist() == second[1].tolist()


def test_types_may_differ_between_the_sides():
    a, b = np.zeros(4), np.array([5, 6, 7, 8], dtype=np.int32)
    copies = joined([(a[0:2], b[0:2]), (a[2:4], b[2:4])])
    apply_copies(copies)
    assert len(copies) == 1
    assert a.tolist() == [5, 6, 7, 8]
