"""Units of one library share its functions as long as one of them has it loaded, and no longer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.buffers import joined
from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.loading import load_unit


def loaded(d: FmuDescription, folder: Path) -> Any:
    def log(_status: int, _message: str) -> None:
        pass

    return load_unit(d, folder, "unit", log, lambda _call: None)


@pytest.mark.parametrize("fmi", [2, 3])
def test_functions_are_shared_until_the_library_is_unloaded(fmi: int, tmp_path: Path):
    d = describe_fmu(native_fmu("gain", fmi))
    unpack(d.path, tmp_path, d.fmi, d.identifier)
    first, second = loaded(d, tmp_path), loaded(d, tmp_path)
    shared = first.dll
    assert second.dll is shared
    first.freeInstance()
    third = loaded(d, tmp_path)
    assert third.dll is shared
    for unit in (second, third):
        unit.freeInstance()
    last = loaded(d, tmp_path)
    assert last.dll is not shared
    last.freeInstance()


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_log_line_goes_to_the_unit_that_wrote_it_however_many_are_loaded(
    fmu: Callable[..., Path], fmi: int, tmp_path: Path
):
    d = describe_fmu(fmu("Mass", fmi))
    unpack(d.path, tmp_path, d.fmi, d.identifier)
    logs: list[list[str]] = [[], []]

    def loaded(log: list[str]) -> Any:
        def take(_status: int, message: str) -> None:
            log.append(message)

        return load_unit(d, tmp_path, "mass", take, lambda _what: None)

    units = [loaded(log) for log in logs]
    with pytest.raises(FMICallException):
        units[0].doStep(0.0, 0.1)
    assert any("DoStep" in line for line in logs[0])
    assert logs[1] == []
    for unit in units:
        unit.freeInstance()


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
