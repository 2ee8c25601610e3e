"""The master takes the compiled plan where it can, and says in the log why where it cannot."""

import ctypes
import logging
import shutil
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.master.master import Master
from handover.cosim.native_libraries import TARGETS, CompilationError, NativeLibraries, host_platform, zig_cc
from handover.cosim.plan import choice, memory
from handover.cosim.plan import compile as plan_compile
from handover.cosim.plan.compile import FOLDER, SOURCES, plan_library
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.stepping.stepper import GridStepper
from handover.cosim.system.system import System
from handover.cosim.system.time_series import HeldValue


def build(period: Fraction = Fraction(1, 10)) -> System:
    s = System()
    s.add("sine", native_fmu("sine", 2), period=period)
    return s


def logged(options: MasterOptions, caplog: pytest.LogCaptureFixture, period: Fraction = Fraction(1, 10)) -> list[str]:
    with caplog.at_level(logging.INFO, "handover.cosim.plan"), Master(build(period), options) as master:
        assert isinstance(master.stepper, GridStepper)
        master.run(Fraction(1))
    return [r.getMessage() for r in caplog.records]


def test_a_plain_system_is_compiled(caplog: pytest.LogCaptureFixture):
    with caplog.at_level(logging.INFO, "handover.cosim.plan"), Master(build()) as master:
        assert isinstance(master.stepper, PlanStepper)
    assert caplog.records == []


def test_one_whose_input_follows_values_no_more_is_compiled():
    s = System()
    unit = s.add("unit", native_fmu("gain", 2))
    s.follow(unit.u.u, HeldValue([1.0]))
    s.disconnect(unit.u.u)
    with Master(s) as master:
        assert isinstance(master.stepper, PlanStepper)


@pytest.mark.parametrize(
    ("options", "period", "why"),
    [
        (MasterOptions(compiled=False), Fraction(1, 10), "the options ask for none"),
        (MasterOptions(extrapolation=Extrapolation.LINEAR), Fraction(1, 10), "inputs are extrapolated"),
        (MasterOptions(algorithm=Algorithm.NEWTON), Fraction(1, 10), "the coupling is newton"),
        (MasterOptions(), Fraction(2**64, 2**65 + 1), "a tick of 18446744073709551616/36893488147419103233 s is too"),
    ],
)
def test_what_a_plan_cannot_do(options: MasterOptions, period: Fraction, why: str, caplog: pytest.LogCaptureFixture):
    (line,) = logged(options, caplog, period)
    assert line.startswith(f"no compiled plan: {why}")


@pytest.mark.parametrize("algorithm", [Algorithm.GAUSS_SEIDEL, Algorithm.JACOBI])
def test_a_loop_that_is_gone_over_again(algorithm: Algorithm, caplog: pytest.LogCaptureFixture):
    s = System()
    a, b = s.add("a", native_fmu("gain", 2), a=0.5), s.add("b", native_fmu("gain", 3), a=0.5, b=1.0)
    s.connect(a.y.y, b.u.u)
    s.connect(b.y.y, a.u.u)
    options = MasterOptions(algorithm=algorithm)
    with caplog.at_level(logging.INFO, "handover.cosim.plan"), Master(s, options) as master:
        assert isinstance(master.stepper, GridStepper)
    assert [r.getMessage() for r in caplog.records] == ["no compiled plan: units make a loop"]


def test_without_its_library(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture):
    def no_library() -> ctypes.CDLL | None:
        return None

    monkeypatch.setattr(choice, "loop", no_library)
    assert logged(MasterOptions(), caplog) == ["no compiled plan: its library is not compiled for this machine"]


def test_a_compiler_that_refuses_does_not_keep_a_system_from_running(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    def refuse() -> None:
        raise CompilationError("master's plan", "some-machine", "no space left")

    monkeypatch.setattr(memory, "plan_library", refuse)
    memory.loop.cache_clear()
    try:
        lines = logged(MasterOptions(), caplog)
    finally:
        memory.loop.cache_clear()
    assert lines[0] == "the master's plan does not compile for some-machine:\nno space left"


@pytest.mark.parametrize("compiled", [True, False])
def test_the_cpu_time_of_each_step_is_taken_where_it_is_asked_for(compiled: bool):
    for asked in (True, False):
        with Master(build(), MasterOptions(compiled=compiled, cpu_times=asked)) as master:
            master.run(Fraction(1))
            master.run(Fraction(500))
            assert len(master.cpu["sine"]) == (5000 if asked else 0)
            assert sum(master.cpu["sine"]) < 10.0


def libraries(folder: Path) -> NativeLibraries:
    """Return the libraries of a copy of the sources, of which nothing is compiled."""
    shutil.copytree(FOLDER, folder, ignore=shutil.ignore_patterns("bin", "*.py", "__pycache__"))
    (folder / "unused.h").write_text(f"/* {folder} */")  # so that no cache has libraries of these sources
    return NativeLibraries("master's plan", "plan", folder, {"plan": SOURCES}, zig_cc)


@pytest.mark.parametrize(
    "target",
    [pytest.param(t, marks=pytest.mark.slow if t == "aarch64-linux" else pytest.mark.platforms) for t in TARGETS],
)
def test_it_compiles_for_every_platform(target: str, tmp_path: Path):
    made = libraries(tmp_path / "plan")
    assert not made.is_current(target)
    made.compile(target)
    assert made.is_current(target)
    content = made.library(target, "plan").read_bytes()
    assert all(name in content for name in (b"plan_arrive", b"plan_depart", b"plan_run", b"plan_time"))
    (made.folder / "plan.h").write_text("/* other */")
    assert not made.is_current(target)


def test_what_the_compiler_says_is_reported_and_nothing_is_left(tmp_path: Path):
    made = libraries(tmp_path / "plan")
    (made.folder / "exact_time.c").write_text("double exact_time(int ticks { }")
    with pytest.raises(CompilationError, match=r"(?s)the master's plan does not compile for .*exact_time\.c:1"):
        made.compile(host_platform())
    assert list((made.folder / "bin" / host_platform()).iterdir()) == []


def test_without_a_compiler_there_is_what_was_compiled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    assert plan_library() is not None
    made = libraries(tmp_path / "plan")
    monkeypatch.setattr(plan_compile, "FOLDER", made.folder)
    monkeypatch.setattr(plan_compile, "has_compiler", lambda: False)
    assert plan_library() is None
