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

    CI runs a unit in a process of its own, and in turn by the plan or on the general path, in one of the standards;
    the rest is for fuzz.
    """
    found: list[Any] = []
    for i, fault in enumerate(FAULTS):
        in_one_process = [way for way in fault.ways if way != "isolated"]
        for k, way in enumerate(fault.ways):
            for fmi in fault.standards:
                turn = fmi == fault.standards[(i + k) % len(fault.standards)]
                in_ci = turn and way in ("isolated", in_one_process[i % len(in_one_process)])
                tiers = () if turn and way in fault.fast else (pytest.mark.slow if in_ci else pytest.mark.fuzz,)
                found.append(pytest.param(fault, fmi, way, marks=tiers, id=f"{fault.name}-{fmi}-{way}"))
    return found


@pytest.mark.parametrize(("fault", "fmi", "way"), rows())
def test_a_fault_is_told_and_harms_nothing_else(fault: Fault, fmi: int, way: str, tmp_path: Path):
    seen = run_fault(fault, fmi, way, tmp_path)
    assert not faults_of(fault, fmi, way, seen), seen.output
