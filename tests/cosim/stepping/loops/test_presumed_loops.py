"""Outputs without declared dependencies depend on all inputs: a loop through them is one until it proves to be none."""

import logging
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.rewritten_archive import described_otherwise

from handover.cosim.exceptions import ScheduleError
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System

STANDARDS = pytest.mark.parametrize("fmi", [2, 3])
ALGORITHMS = pytest.mark.parametrize("algorithm", list(Algorithm))
GAINS = (-2.0, 0.5, 3.0)


def cycle(fmi: int, *, fmu: Path | None = None, **flags: Any) -> System:
    """Return units y = a u + 1, each of which feeds the next, the last one the first."""
    s = System()
    path = fmu or native_fmu("gain", fmi, dependencies=False, **flags)
    units = [s.add(f"u{i}", path, a=a, b=1.0) for i, a in enumerate(GAINS)]
    for source, target in zip(units, [*units[1:], units[0]], strict=True):
        s.connect(source.y.y, target.u.u)
    return s


def solution() -> list[float]:
    A = np.zeros((3, 3))
    for i, a in enumerate(GAINS):
        A[i, i - 1] = a
    return np.linalg.solve(np.eye(3) - A, np.ones(3)).tolist()


def values(master: Master) -> list[float]:
    return [float(master.signals[f"u{i}.y"]) for i in range(3)]


@ALGORITHMS
@STANDARDS
def test_a_loop_is_solved_at_the_start_and_at_the_steps(fmi: int, algorithm: Algorithm):
    with Master(cycle(fmi), MasterOptions(algorithm=algorithm)) as master:
        assert values(master) == pytest.approx(solution(), rel=1e-7)
        master.run(Fraction(1))
        assert values(master) == pytest.approx(solution(), rel=1e-7)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
@STANDARDS
def test_a_loop_of_units_without_states_is_solved_at_the_start_and_told(
    fmi: int, algorithm: Algorithm, caplog: pytest.LogCaptureFixture
):
    stateless: dict[str, Any] = {"canGetAndSetFMUstate" if fmi == 2 else "canGetAndSetFMUState": False}
    with (
        caplog.at_level(logging.WARNING),
        Master(cycle(fmi, **stateless), MasterOptions(algorithm=algorithm)) as master,
    ):
        assert values(master) == pytest.approx(solution(), rel=1e-7)
        master.run(Fraction(1))
        assert not master.iterates
        assert isinstance(master.stepper, PlanStepper)
    (told,) = (r.getMessage() for r in caplog.records if "algebraic loop" in r.getMessage())
    assert "u2.y -> u0.u, u0.u may feed through to u0.y" in told
    assert "u0, u1, u2 do not save their states, so a step cannot be rolled back" in told
    assert "signals are late by a step" in told


def test_what_is_declared_of_a_loop_has_to_be_solved():
    s = System()
    declared = [s.add(n, native_fmu("gain", 3, canGetAndSetFMUState=False), a=-0.5) for n in "ab"]
    s.connect(declared[0].y.y, declared[1].u.u)
    s.connect(declared[1].y.y, declared[0].u.u)
    with pytest.raises(ScheduleError, match=r"1 algebraic loop cannot be solved .*\n.* a, b do not save their states"):
        Master(s)


def test_a_presumed_loop_around_a_declared_one_leaves_that_solved():
    s = System()
    a, b = s.add("a", native_fmu("sum", 3), a1=-2.0), s.add("b", native_fmu("gain", 3), b=1.0)
    c = s.add("c", native_fmu("gain", 3, dependencies=False, canGetAndSetFMUState=False), a=0.0, b=3.0)
    s.connect(b.y.y, a.u.u1)
    s.connect(a.y.y, b.u.u)
    s.connect(c.y.y, a.u.u2)
    s.connect(a.y.y, c.u.u)
    schedule = Schedule(s)
    assert [loop.is_presumed for loop in schedule.loops] == [False]
    with Master(s) as master:  # a = -2 b + 3, b = a + 1
        master.run(Fraction(1))
        assert float(master.signals["a.y"]) == pytest.approx(1.0 / 3.0, rel=1e-6)


@ALGORITHMS
def test_a_cycle_that_is_no_loop_starts_as_it_would_with_declared_dependencies(algorithm: Algorithm):
    found: list[list[float]] = []
    for dependencies in (True, False):
        s = System()
        mass = s.add("mass", native_fmu("mass", 3, dependencies=dependencies), k=10.0, x0=1.0)
        other = s.add("other", native_fmu("mass", 3, dependencies=dependencies), k=3.0)
        spring = s.add("spring", native_fmu("spring", 3), k=5.0, d=0.5)
        for unit, i in ((mass, 1), (other, 2)):
            s.connect(unit.y.x, getattr(spring.u, f"x{i}"))
            s.connect(unit.y.v, getattr(spring.u, f"v{i}"))
            s.connect(getattr(spring.y, f"f{i}"), unit.u.f)
        with Master(s, MasterOptions(algorithm=algorithm)) as master:
            start = [float(master.signals[name]) for name in ("mass.x", "mass.v", "spring.f1", "spring.f2")]
            master.run(Fraction(1, 5))
        found.append(start)
    assert found[0] == found[1]


def test_values_that_are_not_real_stay_out_of_presumed_loops():
    s = System()
    a, b = (s.add(n, native_fmu("discrete_passer", 3, dependencies=False), count_in=7) for n in "ab")
    s.connect(a.y.count, b.u.count_in)
    s.connect(b.y.truth, a.u.truth_in)
    s.connect(b.y.count, a.u.count_in)
    schedule = Schedule(s)
    assert not schedule.loops
    with Master(s) as master:
        master.run(Fraction(1, 2))
        assert not master.iterates


def edited(fmu: Path, folder: Path, pattern: str, replacement: str) -> Path:
    """Return a copy of an FMU whose description is changed."""

    def change(text: str) -> str:
        changed, n = re.subn(pattern, replacement, text, flags=re.DOTALL)
        assert n
        return changed

    return described_otherwise(fmu, folder / fmu.name, change)


@STANDARDS
@ALGORITHMS
@pytest.mark.parametrize("initial", ["declared", "presumed"])
def test_at_the_start_the_dependencies_of_initial_unknowns_count(
    fmi: int, algorithm: Algorithm, initial: str, tmp_path: Path
):
    """The outputs declare that they depend on nothing at the steps."""
    at_steps = (r'(<Outputs>\s*<Unknown index="2" )[^/]*/>', r'\1dependencies="" />')
    if fmi == 3:
        at_steps = (r'(<Output valueReference="2" )[^/]*/>', r'\1dependencies="" />')
    fmu = edited(native_fmu("gain", fmi), tmp_path, *at_steps)
    if initial == "presumed":
        (folder := tmp_path / "presumed").mkdir()
        at_start = (r'(<InitialUnknowns>\s*<Unknown index="2" )[^/]*/>', r"\1/>")
        if fmi == 3:
            at_start = (r'(<InitialUnknown valueReference="2" )[^/]*/>', r"\1/>")
        fmu = edited(fmu, folder, *at_start)
    d = describe_fmu(fmu)
    assert (d.feedthrough, d.presumed_feedthrough) == ({}, {})
    of_start = d.initial_feedthrough if initial == "declared" else d.presumed_initial_feedthrough
    assert of_start == {"y": ("u",)}
    with Master(cycle(fmi, fmu=fmu), MasterOptions(algorithm=algorithm)) as master:
        assert values(master) == pytest.approx(solution(), rel=1e-7)
