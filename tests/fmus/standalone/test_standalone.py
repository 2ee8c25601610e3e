"""FMUs that bring their interpreter: they step in a folder that holds the C library and nothing else."""

from pathlib import Path

import pytest
from support.fmus.bare_folder import BareFolder, can_be_entered

from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.build import build, cached
from handover.fmus.catalog import UNITS

pytestmark = [
    pytest.mark.skipif(not can_be_entered(), reason="only the superuser may enter a folder as the root"),
]

IN_CI = "GraspScene"
"""A unit with a package of compiled code, pymunk."""
STEPS = 5
ELSEWHERE = {"PYTHONHOME": "/nowhere", "PYTHONPATH": "/nowhere", "LD_LIBRARY_PATH": "/nowhere", "PATH": "/nowhere"}
"""What of the host's environment must not reach the interpreter in the FMU."""
LARGEST = {"TendonArm": 100e6, "Push": 40e6}
"""Bytes of a file, of the arm with Exudyn and SciPy and of a unit that only computes."""
LARGEST_OF_ALL = 150e6
"""Bytes of any file; with OpenCV it has some 105 MB."""
OTHER_WAYS = {"FMU_PYTHON": "/nowhere/python3", "FMU_LIBPYTHON": "/nowhere/libpython.so", "FMU_PYTHON_PROCESS": "0"}
"""Settings of which an FMU with an interpreter takes no note."""


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> BareFolder:
    return BareFolder(tmp_path_factory.mktemp("root"))


def units() -> list[object]:
    """Return all units; one in the slow tier, the others in a tier of their own."""
    return [pytest.param(n, marks=pytest.mark.slow if n == IN_CI else pytest.mark.platforms) for n in UNITS]


@pytest.mark.parametrize("name", units())
def test_a_unit_steps_without_python_as_it_does_with_it(name: str, root: BareFolder, tmp_path: Path):
    entry = UNITS[name]
    built = build(entry, 3, tmp_path, standalone=True)
    description = describe_fmu(built)
    assert not description.capabilities.needs_tool
    assert built.stat().st_size <= LARGEST.get(name, LARGEST_OF_ALL)
    print(f"{built.name}: {built.stat().st_size / 1e6:.1f} MB")
    standalone, plain = root.unpack(built), root.unpack(cached(name, 3))
    inside = root.step(standalone, float(entry.step), STEPS, inside=True, environment=ELSEWHERE | OTHER_WAYS)
    assert len(inside.outputs) == STEPS
    assert {line.count(" ") for line in inside.outputs} == {len(description.outputs)}
    assert inside.outputs == root.step(plain, float(entry.step), STEPS, inside=False).outputs
    if name in (IN_CI, "TendonArm"):
        alike = root.step(standalone, float(entry.step), STEPS, 3, inside=True)
        assert alike.outputs == [line for line in inside.outputs for _ in range(3)]


@pytest.mark.platforms
@pytest.mark.parametrize(("fmi", "scalar"), [(2, False), (3, True)])
def test_so_do_its_other_forms(fmi: int, scalar: bool, root: BareFolder, tmp_path: Path):
    entry = UNITS["FreeFlyer"]
    built = build(entry, fmi, tmp_path, scalar=scalar, standalone=True)
    standalone, plain = root.unpack(built), root.unpack(cached(entry.name, fmi, scalar=scalar))
    inside = root.step(standalone, float(entry.step), STEPS, inside=True, environment=ELSEWHERE | OTHER_WAYS)
    assert len(inside.outputs) == STEPS
    assert inside.outputs == root.step(plain, float(entry.step), STEPS, inside=False).outputs
