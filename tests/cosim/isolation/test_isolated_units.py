"""Isolated units step at the same time, log, take CPU time and share pictures; those in Python find one."""

import os
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu

from handover.cosim.exceptions import InvalidFmu, UnitFailure
from handover.cosim.fmu.failures import UnitError
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.isolation import unit_process
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus import interpreter


def expect_meeting(fmi: int, options: MasterOptions) -> None:
    """Expect two units to meet in their steps: in one process neither would ever return."""
    s = System()
    first, second = s.add("first", native_fmu("meets", fmi), who=0), s.add("second", native_fmu("meets", fmi), who=1)
    third = s.add("third", native_fmu("hub", fmi))
    s.connect(first.y.y, third.u.u1)
    s.connect(second.y.y, third.u.u2)
    with Master(s, options) as master:
        master.run(Fraction(1, 2))
        assert [int(master.signals[f"{name}.n"]) for name in ("first", "second")] == [5, 5]


@pytest.mark.parametrize(
    ("fmi", "isolated", "algorithm", "compiled"),
    [
        (2, ("all",), Algorithm.JACOBI, True),
        (3, ("first",), Algorithm.GAUSS_SEIDEL, True),
        (3, ("first",), Algorithm.JACOBI, False),
        (2, ("all",), Algorithm.GAUSS_SEIDEL, False),
    ],
)
def test_two_units_step_at_the_same_time(
    fmi: int, isolated: tuple[str, ...], algorithm: Algorithm, compiled: bool, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):  # fmt: skip
    monkeypatch.setenv("MEETING_FOLDER", str(tmp_path))
    expect_meeting(fmi, MasterOptions(algorithm=algorithm, compiled=compiled, isolated=isolated))


def test_with_events_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("MEETING_FOLDER", str(tmp_path))
    expect_meeting(3, MasterOptions(isolated=("all",), repeat_discarded=True))


@pytest.mark.parametrize(
    ("isolated", "algorithm", "compiled"),
    [
        (("second",), Algorithm.JACOBI, True),
        (("second",), Algorithm.GAUSS_SEIDEL, False),
        (("first", "third"), Algorithm.JACOBI, False),
        (("first", "third"), Algorithm.GAUSS_SEIDEL, True),
    ],
)
def test_of_two_failures_that_of_one_process_is_raised(isolated: tuple[str, ...], algorithm: Algorithm, compiled: bool):
    """Three units, of which the last two fail in the same step."""
    failures: list[UnitFailure] = []
    for which in ((), isolated):
        s = System()
        s.add("first", native_fmu("gain"))
        s.add("second", native_fmu("errs"))
        s.add("third", native_fmu("errs"))
        with (
            pytest.raises(UnitError) as caught,
            Master(s, MasterOptions(algorithm=algorithm, compiled=compiled, isolated=which)) as master,
        ):
            master.run(Fraction(1))
        failures.append(caught.value)
    assert failures[0].as_data() == failures[1].as_data()
    assert failures[0].unit == "second"


STEPS = 10


def cpu_seconds(fmi: int, **options: Any) -> dict[str, float]:
    """Return the CPU time of a heavy unit's steps and of a light one's that it feeds."""
    system = System()
    heavy = system.add("heavy", native_fmu("heavy", fmi), work=500)
    light = system.add("light", native_fmu("heavy", fmi), work=0)
    system.connect(heavy.y.y, light.u.u)
    with Master(system, MasterOptions(cpu_times=True, **options)) as master:
        master.run(Fraction(STEPS, 10))
        assert {name: len(spent) >= STEPS for name, spent in master.cpu.items()} == {"heavy": True, "light": True}
        return {name: sum(spent) for name, spent in master.cpu.items()}


@pytest.mark.parametrize(
    ("fmi", "options"),
    [
        (2, {"algorithm": Algorithm.GAUSS_SEIDEL}),
        (3, {"algorithm": Algorithm.JACOBI, "compiled": False}),
        (3, {"repeat_discarded": True}),
    ],
)
def test_cpu_time_of_an_isolated_unit_counts(fmi: int, options: dict[str, Any]):
    here, alone = cpu_seconds(fmi, **options), cpu_seconds(fmi, isolated=("all",), **options)
    assert here["heavy"] > 0.01
    assert 0.4 * here["heavy"] < alone["heavy"] < 2.5 * here["heavy"]
    assert alone["light"] < 0.2 * alone["heavy"]


class Listener(Heartbeat):
    """Keeps all lines."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def log(self, unit: str, message: str) -> None:
        self.lines.append(f"{unit}: {message}")


def heard(fmi: int, lines: int, *isolated: str) -> list[str]:
    s, listener = System(), Listener()
    s.add("talks", native_fmu("talks", fmi), lines=lines)
    with Master(s, MasterOptions(isolated=isolated), listener) as master:
        master.run(Fraction(1, 5))
    return listener.lines


@pytest.mark.parametrize(("lines", "fmi"), [(1, 2), (2000, 3)])
def test_every_line_is_heard(lines: int, fmi: int):
    """2,000 lines are more than the memory for the log holds."""
    all_lines = heard(fmi, lines, "talks")
    assert all_lines == heard(fmi, lines)
    assert len(all_lines) == 2 * lines
    assert all_lines[-1] == f"talks: [Warning] line {lines} of {lines} of the step from t = 0.1 s"


in_proc = pytest.mark.skipif(sys.platform != "linux", reason="looks for files in memory in /proc")

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


@pytest.fixture(scope="module")
def together(fmu: FmuOf) -> Callable[[Algorithm], list[object]]:
    """Return what is seen in one process."""

    @cache
    def rows(algorithm: Algorithm) -> list[object]:
        return seen(fmu, MasterOptions(algorithm=algorithm))[0]

    return rows


@in_proc
@pytest.mark.parametrize(
    ("algorithm", "compiled"),
    [
        (Algorithm.GAUSS_SEIDEL, True),
        pytest.param(Algorithm.JACOBI, False, marks=pytest.mark.slow),
    ],
)
def test_a_picture_lies_in_the_camera_s_memory_alone(
    fmu: FmuOf, together: Callable[[Algorithm], list[object]], algorithm: Algorithm, compiled: bool
):
    options = MasterOptions(algorithm=algorithm, compiled=compiled, isolated=("all",))
    rows, (of_camera, of_viewer) = seen(fmu, options)
    assert rows == together(algorithm)
    assert 2 * PHOTO <= of_camera < 4 * PHOTO  # the one that the master holds, the next, and room for larger ones
    assert of_viewer < PHOTO / 2


@pytest.mark.parametrize("isolated", ["camera", pytest.param("viewer", marks=pytest.mark.slow)])
def test_one_of_them_may_be_in_this_process(fmu: FmuOf, together: Callable[[Algorithm], list[object]], isolated: str):
    options = MasterOptions(isolated=(isolated,))
    assert seen(fmu, options)[0] == together(options.algorithm)


_SOURCE = """
import numpy
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Float64

class Doubling(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Float64("y", causality=Fmi3Causality.output))

    def do_step(self, current_time, step_size):
        self.y = float(numpy.float64(2.0) * (current_time + step_size))
        return True
"""


@pytest.fixture(scope="module")
def doubling(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of a class in Python, by pythonfmu3."""
    folder = tmp_path_factory.mktemp("pythonfmu3")
    source = folder / "doubling.py"
    source.write_text(_SOURCE)
    command = [sys.executable, "-m", "pythonfmu3", "build", "-f", str(source), "-d", str(folder)]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
    return folder / "Doubling.fmu"


def isolated(fmu: Path) -> Master:
    system = System()
    system.add("unit", fmu, period=Fraction(1, 10))
    return Master(system, MasterOptions(isolated=("unit",)))


@pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library")
def test_it_runs_with_this_python(doubling: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "/usr/bin:/bin")  # as where the virtual environment is not activated
    rows: list[tuple[float, float]] = []

    def observe(t: float, signals: Signals) -> None:
        rows.append((t, float(signals["unit.y"])))

    with isolated(doubling) as master:
        master.run(Fraction(1, 2), [observe])
    assert rows == [(t, pytest.approx(2.0 * t)) for t in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)]


def test_where_this_python_has_no_library_cause_and_cure_are_reported(doubling: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(unit_process, "_libpython", lambda: "")
    with pytest.raises(InvalidFmu) as reported:
        isolated(doubling).__enter__()
    assert "but names no library of Python that it needs" in str(reported.value)
    assert "Cure: run it without isolation, or install Debian's libpython3" in str(reported.value)
