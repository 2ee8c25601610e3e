"""Whatever a unit does, `handover run` says what, with its status, keeps the rows until then, and frees the others."""

import sys
from pathlib import Path
from typing import Any

import pytest
from support.faults.fault_rows import FAULTS, WAYS, Fault
from support.faults.fault_table import faults_of, run_fault

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what a crash does depends on the system")


def rows() -> list[Any]:
    """Return the rows with standard and way: of each way, the standards taking turns, one runs in CI; all as fuzz."""
    found: list[Any] = []
    for i, fault in enumerate(FAULTS):
        for k, way in enumerate(fault.ways):
            for fmi in fault.standards:
                turn = fmi == fault.standards[(i + k) % len(fault.standards)]
                tiers = () if turn and way in fault.fast else (pytest.mark.slow if turn else pytest.mark.fuzz,)
                found.append(pytest.param(fault, fmi, way, marks=tiers, id=f"{fault.name}-{fmi}-{way}"))
    return found


@pytest.mark.parametrize(("fault", "fmi", "way"), rows())
def test_a_fault_is_told_and_harms_nothing_else(fault: Fault, fmi: int, way: str, tmp_path: Path):
    seen = run_fault(fault, fmi, way, tmp_path)
    assert not faults_of(fault, fmi, way, seen), seen.output


def test_every_fault_is_there_once():
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names) >= 40


def test_a_way_is_left_out_with_its_reason_only():
    for fault in FAULTS:
        assert set(fault.left_out) | set(fault.differs) <= set(WAYS)
        assert all(fault.left_out.values())
        assert fault.ways
