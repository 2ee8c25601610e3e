"""Whatever a unit does, `handover run` says what, with its status, keeps the rows until then, and frees the others."""

import sys
from pathlib import Path
from typing import Any

import pytest
from support.faults.fault_rows import FAULTS, Fault
from support.faults.fault_table import faults_of, run_fault

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what a crash does depends on the system")


def rows() -> list[Any]:
    """Return the rows with standard and way.

    CI runs a unit in a process of its own and by the plan or on the general path, in turn, or both ways where not the
    same is right of them, and in one of the standards; the rest is for fuzz.
    """
    found: list[Any] = []
    for i, fault in enumerate(FAULTS):
        in_one_process = [way for way in fault.ways if way != "isolated"]
        tried = ["isolated", in_one_process[i // 2 % len(in_one_process)]]
        tried = tried if fault.differs else [tried[i % 2]]
        for k, way in enumerate(fault.ways):
            for fmi in fault.standards:
                turn = fmi == fault.standards[(i + k) % len(fault.standards)]
                slow = pytest.mark.slow if turn and way in tried else pytest.mark.fuzz
                tiers = () if turn and way in fault.fast else (slow,)
                found.append(pytest.param(fault, fmi, way, marks=tiers, id=f"{fault.name}-{fmi}-{way}"))
    return found


@pytest.mark.parametrize(("fault", "fmi", "way"), rows())
def test_a_fault_is_reported_and_harms_nothing_else(fault: Fault, fmi: int, way: str, tmp_path: Path):
    seen = run_fault(fault, fmi, way, tmp_path)
    assert not faults_of(fault, fmi, way, seen), seen.output
