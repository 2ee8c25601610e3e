"""Thousands of instances, one after the other, leave no memory behind."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support.processes import program, with_path

from handover.fmus.build import build_block, cached

LIMIT = 2_000_000

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def growth(fmu: Path, fmi: int, kind: str, count: int) -> int:
    done = subprocess.run(
        program("faults/cycles.py", fmu, fmi, kind, count),
        env=with_path(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    print(f"{fmu.name} {kind}: {found['grown'] / 1000:.0f} kB after {count} cycles")
    return found["grown"]


@pytest.mark.machine
@pytest.mark.slow
def test_instances_leave_nothing_behind(tmp_path: Path):
    fmu = build_block("support.sample_units.every_kind:EveryKind", 3, tmp_path)
    assert growth(fmu, 3, "run", 600) < 600 / 5000 * LIMIT


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", ["bare", "run"])
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", ["EveryKind", "Push", "Thrusters"])
def test_five_thousand_instances_grow_memory_by_less_than_two_megabytes(unit: str, fmi: int, kind: str, tmp_path: Path):
    sample = unit == "EveryKind"
    fmu = build_block(f"support.sample_units.every_kind:{unit}", fmi, tmp_path) if sample else cached(unit, fmi)
    assert growth(fmu, fmi, kind, 5000) < LIMIT
