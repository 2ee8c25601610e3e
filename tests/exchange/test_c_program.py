"""Units in a program in C that has no Python in it."""

import os
import sys
from pathlib import Path

import pytest
from c_program import compiled, run, run_and_repeat
from reference import FMI2_UNITS, References, expect_same

from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="c_program.c loads libraries with dlopen"),
    pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that a C program can load"),
]

LIGHT = ("HandoverPartner", "Thrusters")
CASES = [(name, fmi) for fmi in (2, 3) for name in (FMI2_UNITS if fmi == 2 else UNITS)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(tmp_path_factory.mktemp("c_program"))


@pytest.mark.parametrize(
    ("unit", "fmi"), [c if c[0] in LIGHT else pytest.param(*c, marks=pytest.mark.slow) for c in CASES]
)
def test_a_unit_gives_the_same(references: References, program: Path, unit: str, fmi: int, tmp_path: Path):
    wanted = references.varying(unit, fmi)
    found = run(program, unit, cached(unit, fmi), tmp_path)
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures


@pytest.mark.skipif(sys.platform != "linux", reason="clocks of other processes are Linux'")
def test_steps_made_again_cost_as_much_as_there_are(program: Path, tmp_path: Path):
    _, (few, many) = run_and_repeat(program, LIGHT[0], cached(LIGHT[0], 3), tmp_path, [20, 200])
    assert few * 3 < many < few * 30
