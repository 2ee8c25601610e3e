"""The master takes the compiled plan where it can, and says in the log why where it cannot."""

import logging
import shutil
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.master import stepper_factory
from handover.cosim.master.master import Master
from handover.cosim.native_libraries import TARGETS, CompilationError, NativeLibraries, host_platform, zig_cc
from handover.cosim.plan import compile as plan_compile
from handover.cosim.plan import memory
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


def loop() -> System:
    s = System()
    a, b = s.add("a", native_fmu("gain", 2), a=0.5), s.add("b", native_fmu("gain", 3), a=0.5, b=1.0)
    s.connect(a.y.y, b.u.u)
    s.connect(b.y.y, a.u.u)
    return s


def follows_no_more() -> System:
    s = System()
    unit = s.add("unit", native_fmu("gain", 2))
    s.follow(unit.u.u, HeldValue([1.0]))
    s.disconnect(unit.u.u)
    return s


@pytest.fixture
def logged(caplog: pytest.LogCaptureFixture) -> Callable[[System, MasterOptions], list[str]]:
    """Runs a system for a while; returns what the plan logged: nothing where there is one."""

    def run(system: System, options: MasterOptions) -> list[str]:
        with caplog.at_level(logging.INFO, "handover.cosim"), Master(system, options) as master:
            lines = [text for r in caplog.records if "plan" in (text := r.getMessage())]
            assert isinstance(master.stepper, GridStepper if lines else PlanStepper)
            master.run(Fraction(1, 5))
        return lines

    return run


@pytest.mark.parametrize(
    ("system", "options", "why"),
    [
        (build(), {}, None),
        (follows_no_more(), {}, None),
        (build(), {"compiled": False}, "the options ask for none"),
        (build(), {"extrapolation": Extrapolation.LINEAR}, "inputs are extrapolated"),
        (build(), {"algorithm": Algorithm.NEWTON}, "the coupling is newton"),
        (build(Fraction(2**64, 2**65 + 1)), {}, "a tick of 18446744073709551616/36893488147419103233 s is too"),
        (loop(), {}, "units make a loop"),
        (loop(), {"algorithm": Algorithm.JACOBI}, "units make a loop"),
    ],
)
def test_a_plain_system_is_compiled_and_where_it_is_not_it_says_why(
    system: System, options: dict[str, object], why: str | None, logged: Callable[..., list[str]]
):
    lines = logged(system, MasterOptions(**options))  # type: ignore[arg-type]
    assert len(lines) == (why is not None)
    assert all(line.startswith(f"no compiled plan: {why}") for line in lines)


def test_without_its_library(monkeypatch: pytest.MonkeyPatch, logged: Callable[..., list[str]]):
    monkeypatch.setattr(stepper_factory, "loop", lambda: None)
    assert logged(build(), MasterOptions()) == ["no compiled plan: its library is not compiled for this machine"]


def test_a_compiler_that_refuses_does_not_keep_a_system_from_running(
    monkeypatch: pytest.MonkeyPatch, logged: Callable[..., list[str]]
):
    def refuse() -> None:
        raise CompilationError("master's plan", "some-machine", "no space left")

    monkeypatch.setattr(memory, "plan_library", refuse)
    memory.loop.cache_clear()
    try:
        lines = logged(build(), MasterOptions())
    finally:
        memory.loop.cache_clear()
    assert lines[0] == "the master's plan does not compile for some-machine:\nno space left"


@pytest.mark.parametrize("compiled", [True, False])
def test_the_cpu_time_of_each_step_is_taken_where_it_is_asked_for(compiled: bool):
    for asked in (True, False):
        with Master(build(), MasterOptions(compiled=compiled, cpu_times=asked)) as master:
            master.run(Fraction(1))
            master.run(Fraction(100))
            assert len(master.cpu["sine"]) == (1000 if asked else 0)
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


def test_what_the_compiler_says_is_reported_and_nothing_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert plan_library() is not None
    made = libraries(tmp_path / "plan")
    (made.folder / "exact_time.c").write_text("double exact_time(int ticks { }")
    with pytest.raises(CompilationError, match=r"(?s)the master's plan does not compile for .*exact_time\.c:1"):
        made.compile(host_platform())
    assert list((made.folder / "bin" / host_platform()).iterdir()) == []
    monkeypatch.setattr(plan_compile, "FOLDER", made.folder)
    monkeypatch.setattr(plan_compile, "has_compiler", lambda: False)
    assert plan_library() is None  # without a compiler there is what was compiled
