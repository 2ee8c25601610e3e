"""Algebraic loops are found at ports, solved at the start and at each step, or rejected with the loop spelled out.

Outputs without declared dependencies are presumed to depend on all inputs: a loop through them is one until it proves
to be none, and is not rejected.
"""

import json
import logging
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import grid, observed_rows
from support.cosim.oscillator import PLAIN, STATES
from support.rewritten_archive import described_otherwise
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import InitializationError, ScheduleError
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.initial_values import ChainedDerivatives
from handover.cosim.stepping.iteration import NotConverged
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.loops import declared_loops
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System

GAINS = (-2.0, 0.5, 3.0)
NAMES = ("u0.y", "u1.y", "u2.y")


def cycle(fmu: Path, gains: tuple[float, ...] = GAINS, change: LinearTransformation | None = None) -> System:
    """Return units y = a u + 1, each of which feeds the next, the last one the first; `change` is between two."""
    s = System()
    units = [s.add(f"u{i}", fmu, a=a, b=1.0) for i, a in enumerate(gains)]
    for source, target in zip(units, [*units[1:], units[0]], strict=True):
        s.connect(source.y.y, target.u.u, change if source is units[1] else None)
    return s


def solution() -> list[float]:
    a, b, c = GAINS
    return np.linalg.solve(np.eye(3) - np.array([[0, 0, a], [b, 0, 0], [0, c, 0]]), np.ones(3)).tolist()


@pytest.mark.parametrize(
    ("algorithm", "fmi", "dependencies"),
    [(a, 2 + (i + d) % 2, d) for i, a in enumerate(Algorithm) for d in (False, True)],
)
def test_a_loop_of_three_units_is_solved_at_the_start_and_at_the_steps(
    algorithm: Algorithm, fmi: int, dependencies: bool
):
    system = cycle(native_fmu("gain", fmi, dependencies=dependencies))
    rows = observed_rows(system, Fraction(1, 2), *NAMES, options=MasterOptions(algorithm=algorithm))
    assert [*rows.values()] == [pytest.approx(solution(), rel=1e-7)] * 6


def driven(sampled: bool = False, **flags: Any) -> System:
    """Return x' = 1 and y = x - 2 z, z = 3 y + 1: a loop of two units whose solution moves with time."""
    s = System()
    ramp = s.add("ramp", native_fmu("integrator"), u=1.0, period=Fraction(1, 10))
    y = s.add("y", native_fmu("sum", **flags), a1=1.0, a2=-2.0, sampled=sampled)
    z = s.add("z", native_fmu("gain", **flags), a=3.0, b=1.0, sampled=sampled)
    s.connect(ramp.y.x, y.u.u1)
    s.connect(z.y.y, y.u.u2)
    s.connect(y.y.y, z.u.u)
    return s


@pytest.mark.parametrize(("algorithm", "sampled"), [*((a, True) for a in Algorithm), (Algorithm.JACOBI, False)])
def test_a_loop_is_solved_at_each_step_with_jacobi_from_what_the_others_had_before(algorithm: Algorithm, sampled: bool):
    rows: dict[float, tuple[float, ...]] = {}
    with Master(driven(sampled), MasterOptions(algorithm=algorithm)) as master:
        for stop in (Fraction(1, 2), Fraction(1)):
            master.run(stop, [lambda t, y: rows.update({t: tuple(float(y[n]) for n in ("ramp.x", "y.y", "z.y"))})])
            state = json.loads(json.dumps(master.stepper.get_state()))
            assert state["coupling"]["count"]["steps"] == master.iterations.steps >= 10 * stop
            master.stepper.set_state(state)
        assert master.iterates
    assert list(rows) == pytest.approx(grid(10))
    for t, (x, y, z) in rows.items():
        assert x == pytest.approx(t)
        known = max(t - 0.1, 0.0) if algorithm.coupling.traits.parallel else t
        assert (y, z) == pytest.approx(((known - 2.0) / 7.0, (3.0 * known + 1.0) / 7.0), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("options", "late"),
    [
        pytest.param({}, 0.0, id="beside events"),
        pytest.param({"algorithm": Algorithm.JACOBI, "repeat_discarded": True}, 0.1, id="discarding"),
        pytest.param({"algorithm": Algorithm.JACOBI, "adaptive": AdaptiveStep(relative=0.03, absolute=0.03)}, 0.1),
        pytest.param({"algorithm": Algorithm.JACOBI, "extrapolation": Extrapolation.LINEAR}, 0.1, id="extrapolated"),
    ],
)
def test_loops_are_solved_however_steps_are_taken(options: dict[str, Any], late: float):
    s = driven()
    if not options:
        s.add("ball", native_fmu("ball"), period=Fraction(1, 10))
    x, y, z = observed_rows(s, Fraction(1), "ramp.x", "y.y", "z.y", options=MasterOptions(**options))[1.0]
    assert x == pytest.approx(1.0)
    assert z == pytest.approx(3.0 * y + 1.0, rel=1e-5, abs=1e-7)
    assert y == pytest.approx((x - 2.0) / 7.0, rel=1e-6, abs=late / 7.0 * 1.0001)


def test_of_a_loop_of_several_rates_those_iterate_that_are_due_and_a_unit_may_feed_itself():
    s = System()
    fast = s.add("fast", native_fmu("gain"), a=-2.0, b=1.0, period=Fraction(1, 10), sampled=True)
    slow = s.add("slow", native_fmu("gain"), a=0.5, b=1.0, period=Fraction(1, 5), sampled=True)
    s.connect(fast.y.y, slow.u.u)
    s.connect(slow.y.y, fast.u.u)
    with Master(s) as master:
        master.run(Fraction(1, 2))
        y = [float(master.signals[name]) for name in ("fast.y", "slow.y")]
        assert master.iterations.steps == 3  # at 0, 0.2 and 0.4 s
    assert y == pytest.approx([-0.5, 0.75], rel=1e-7)
    s = System()
    a = s.add("a", native_fmu("gain"), a=-1.0, b=1.0)
    s.connect(a.y.y, a.u.u)
    assert observed_rows(s, Fraction(1, 2), "a.y")[0.5][0] == pytest.approx(0.5)


@pytest.mark.parametrize("dependencies", [True, False])
def test_a_cycle_of_units_that_is_none_of_reals_is_no_loop(dependencies: bool, caplog: pytest.LogCaptureFixture):
    """Declared, truth of one acts on truth of the other alone, and counts go the other way; else, only reals loop."""
    s = System()
    fmu = native_fmu("discrete_passer", dependencies=dependencies)
    both, other = s.add("both", fmu, count_in=7), s.add("other", fmu)
    s.connect(both.y.count, other.u.count_in)
    s.connect(other.y.truth, both.u.truth_in)
    schedule = Schedule(s)
    assert not schedule.loops
    assert [g.units for g in schedule.continuous_groups] == [("both",), ("other",)]
    if dependencies:
        assert "both steps first where units wait for each other; it gets the previous values of other" in caplog.text
    with Master(s) as master:
        assert int(master.signals["other.count"]) == 7
        master.run(Fraction(1, 2))
        assert not master.iterates


def test_a_chain_is_worked_out_at_the_start_though_it_comes_back_to_units():
    s = System()
    a, b, c, d = (s.add(n, native_fmu("two_gains"), a1=2.0, a2=3.0, u1=5.0) for n in "abcd")
    for first, second in ((a, b), (c, d)):  # there, back and there again
        s.connect(first.y.y1, second.u.u1)
        s.connect(second.y.y1, first.u.u2)
        s.connect(first.y.y2, second.u.u2)
    s.connect(b.y.y2, c.u.u1)
    with Master(s) as master:
        assert float(master.signals["d.y2"]) == 5.0 * 36.0 * 36.0


def test_loops_are_found_with_their_ports(wording: Wording):
    (loop,) = declared_loops(driven(), ["ramp", "y", "z"])
    assert set(loop.units) == {"y", "z"}
    assert {str(c.source) for c in loop.connections} == {"y.y", "z.y"}
    wording.check(loop.message)


@pytest.mark.parametrize("algorithm", [Algorithm.GAUSS_SEIDEL, Algorithm.JACOBI])
def test_a_loop_that_cannot_be_solved_is_refused_and_spelled_out(algorithm: Algorithm, wording: Wording):
    whole = System()
    a = whole.add("a", native_fmu("discrete_passer"))
    whole.connect(a.y.count, a.u.count_in)
    for system in (driven(canGetAndSetFMUState=False), whole):
        with pytest.raises(ScheduleError) as caught:
            Master(system, MasterOptions(algorithm=algorithm))
        wording.check(caught.value)


@pytest.mark.parametrize("algorithm", [Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON])
def test_a_loop_without_a_solution_fails_with_its_name(algorithm: Algorithm):
    system = cycle(native_fmu("gain"), (1.0, 2.0, 0.5))
    with (
        pytest.raises(InitializationError) as caught,
        Master(system, MasterOptions(algorithm=algorithm, max_iterations=20)),
    ):
        pass
    failure = caught.value.failure
    assert isinstance(failure, NotConverged)
    assert set(failure.units) == {"u0", "u1", "u2"}
    (name, by), *_ = failure.moving
    assert name == "u2.y -> u0.u"
    assert abs(by) > 0.1
    assert "u2.y -> u0.u still moves by" in failure.message
    for error in (failure, caught.value):
        assert "u0.y -> u1.u, u1.u feeds through to u1.y" in str(error)


@pytest.mark.parametrize("fmi", [2, 3])
def test_directional_derivatives_take_the_place_of_differences(fmi: int, monkeypatch: pytest.MonkeyPatch):
    found: list[Floats] = []
    chained = ChainedDerivatives.__call__

    def noted(self: ChainedDerivatives) -> Floats:
        found.append(chained(self))
        return found[-1]

    monkeypatch.setattr(ChainedDerivatives, "__call__", noted)
    flag = "providesDirectionalDerivative" + ("" if fmi == 2 else "s")
    a, b, c = GAINS
    A = np.array([[0, 0, a], [b, 0, 0], [0, 100.0 * c, 0]])
    for given in (True, False):
        system = cycle(native_fmu("gain", fmi, **{flag: given}), change=LinearTransformation(100.0, 1.0))
        with Master(system) as master:
            y = [float(master.signals[name]) for name in NAMES]
        assert y == pytest.approx(np.linalg.solve(np.eye(3) - A, [1.0, 1.0, 1.0 + c]).tolist(), rel=1e-6)
    assert [d.tolist() for d in found] == [[[a * b * c * 100.0]]]


@pytest.mark.parametrize(("algorithm", "fmi"), [(Algorithm.JACOBI, 3), (Algorithm.GAUSS_SEIDEL, 2)])
def test_a_presumed_loop_of_units_without_states_is_solved_at_the_start_and_reported(
    algorithm: Algorithm, fmi: int, caplog: pytest.LogCaptureFixture, wording: Wording
):
    stateless: dict[str, Any] = {"canGetAndSetFMUstate" if fmi == 2 else "canGetAndSetFMUState": False}
    system = cycle(native_fmu("gain", fmi, dependencies=False, **stateless))
    with caplog.at_level(logging.WARNING), Master(system, MasterOptions(algorithm=algorithm)) as master:
        assert [float(master.signals[name]) for name in NAMES] == pytest.approx(solution(), rel=1e-7)
        master.run(Fraction(1))
        assert not master.iterates
        assert isinstance(master.stepper, PlanStepper)
    (reported,) = (r.getMessage() for r in caplog.records if "algebraic loop" in r.getMessage())
    wording.check(reported)


def test_a_presumed_loop_around_a_declared_one_leaves_that_solved():
    s = System()
    a, b = s.add("a", native_fmu("sum", 3), a1=-2.0), s.add("b", native_fmu("gain", 3), b=1.0)
    c = s.add("c", native_fmu("gain", 3, dependencies=False, canGetAndSetFMUState=False), a=0.0, b=3.0)
    s.connect(b.y.y, a.u.u1)
    s.connect(a.y.y, b.u.u)
    s.connect(c.y.y, a.u.u2)
    s.connect(a.y.y, c.u.u)
    assert [loop.is_presumed for loop in Schedule(s).loops] == [False]
    with Master(s) as master:  # a = -2 b + 3, b = a + 1
        master.run(Fraction(1))
        assert float(master.signals["a.y"]) == pytest.approx(1.0 / 3.0, rel=1e-6)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.NEWTON])
def test_a_presumed_loop_that_is_none_starts_as_it_would_with_declared_dependencies(algorithm: Algorithm):
    found: list[list[float]] = []
    for dependencies in (True, False):
        system = PLAIN.three_units(Fraction(1, 10), 3, dependencies=dependencies)
        with Master(system, MasterOptions(algorithm=algorithm)) as master:
            found.append([float(master.signals[name]) for name in (*STATES, "spring.f1", "spring.f2")])
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("fmi", "algorithm", "initial"),
    [
        (2, Algorithm.GAUSS_SEIDEL, "declared"),
        (3, Algorithm.NEWTON, "declared"),
        (2, Algorithm.FIXED_POINT, "presumed"),
        (3, Algorithm.JACOBI, "presumed"),
    ],
)
def test_at_the_start_the_dependencies_of_initial_unknowns_count(
    fmi: int, algorithm: Algorithm, initial: str, tmp_path: Path
):
    """The outputs declare that they depend on nothing at the steps."""
    outputs, unknowns = (
        r"(<Outputs>\s*<Unknown index|<Output valueReference)",
        r"(<InitialUnknowns>\s*<Unknown index|<InitialUnknown valueReference)",
    )

    def change(text: str) -> str:
        text, n = re.subn(outputs + r'(="2" )[^/]*/>', r'\1\2dependencies="" />', text)
        assert n == 1
        if initial == "presumed":
            text, n = re.subn(unknowns + r'(="2" )[^/]*/>', r"\1\2/>", text)
            assert n == 1
        return text

    fmu = described_otherwise(native_fmu("gain", fmi), tmp_path / "gain.fmu", change)
    d = describe_fmu(fmu)
    assert (d.feedthrough, d.presumed_feedthrough) == ({}, {})
    of_start = d.initial_feedthrough if initial == "declared" else d.presumed_initial_feedthrough
    assert of_start == {"y": ("u",)}
    with Master(cycle(fmu), MasterOptions(algorithm=algorithm)) as master:
        assert [float(master.signals[name]) for name in NAMES] == pytest.approx(solution(), rel=1e-7)
