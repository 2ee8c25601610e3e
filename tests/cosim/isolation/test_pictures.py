"""Pictures of isolated units are copied once, into memory that others read."""

import os
import sys
from fractions import Fraction
from pathlib import Path

import pytest
from fmu_of import FmuOf

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks for files in memory in /proc")

PHOTO = 640 * 480 * 3


def seen(fmu: FmuOf, options: MasterOptions) -> tuple[list[object], list[int]]:
    """Run a camera and a viewer; return what was seen, and the bytes of memory that units share with this process."""
    s = System()
    camera, viewer = s.add("camera", fmu("Camera"), period=Fraction(1, 10)), s.add("viewer", fmu("Viewer"))
    s.connect(camera.y.photo, viewer.u.photo)
    rows: list[object] = []
    before = set(shared_memory())
    with Master(s, options) as master:
        names = ("camera.photo", "viewer.weight")
        master.run(Fraction(1), [lambda t, y: rows.append((t, *(y[name].tobytes() for name in names)))])
        shared = [size for file, size in shared_memory().items() if file not in before]
    return rows, shared


def shared_memory() -> dict[tuple[int, int], int]:
    """Return how many bytes are used of each file in memory that this process has open."""
    found: dict[tuple[int, int], int] = {}
    for entry in Path("/proc/self/fd").iterdir():
        try:
            if os.readlink(entry).startswith("/memfd:unit"):
                about = entry.stat()
                found[about.st_dev, about.st_ino] = about.st_blocks * 512
        except FileNotFoundError:  # the list's own
            continue
    return found


@pytest.mark.parametrize("compiled", [False, True], ids=["general", "plan"])
@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
def test_a_picture_lies_in_the_camera_s_memory_alone(fmu: FmuOf, algorithm: Algorithm, compiled: bool):
    plain = MasterOptions(algorithm=algorithm, compiled=compiled)
    both = MasterOptions(algorithm=algorithm, compiled=compiled, isolated=("all",))
    rows, (of_camera, of_viewer) = seen(fmu, both)
    assert rows == seen(fmu, plain)[0]
    assert 2 * PHOTO <= of_camera < 4 * PHOTO  # the one that the master holds, the next, and room for larger ones
    assert of_viewer < PHOTO / 2


@pytest.mark.parametrize("isolated", ["camera", "viewer"])
def test_one_of_them_may_be_in_this_process(fmu: FmuOf, isolated: str):
    assert seen(fmu, MasterOptions(isolated=(isolated,)))[0] == seen(fmu, MasterOptions())[0]
