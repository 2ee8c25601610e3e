"""Algebraic loops are found at ports, solved at the start and at each step, or rejected with the loop spelled out."""

import json
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import InitializationError, ScheduleError
from handover.cosim.master.master import Master
from handover.cosim.stepping.initial_values import ChainedDerivatives
from handover.cosim.stepping.iteration import NotConverged
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.loops import declared_loops
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

CYCLE = (-2.0, 0.5, 3.0)
every = pytest.mark.parametrize("algorithm", [Algorithm.GAUSS_SEIDEL, Algorithm.FIXED_POINT, Algorithm.NEWTON])


def cycle(
    gains: tuple[float, ...] = CYCLE, fmi: int = 3, change: LinearTransformation | None = None, **flags: Any
) -> System:
    """Return units y = a u + 1, each of which feeds the next, the last one the first; `change` is between two."""
    s = System()
    units = [s.add(f"u{i}", native_fmu("gain", fmi, **flags), a=a, b=1.0) for i, a in enumerate(gains)]
    for source, target in zip(units, [*units[1:], units[0]], strict=True):
        s.connect(source.y.y, target.u.u, change if source is units[1] else None)
    return s


def solution(gains: tuple[float, ...] = CYCLE) -> list[float]:
    A = np.zeros((len(gains), len(gains)))
    for i, a in enumerate(gains):
        A[i, i - 1] = a
    return np.linalg.solve(np.eye(len(gains)) - A, np.ones(len(gains))).tolist()


@every
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_loop_of_three_units_is_solved_at_the_start(algorithm: Algorithm, fmi: int):
    with Master(cycle(fmi=fmi), MasterOptions(algorithm=algorithm)) as master:
        assert [float(master.signals[f"u{i}.y"]) for i in range(3)] == pytest.approx(solution(), rel=1e-7)


@pytest.mark.parametrize("fmi", [2, 3])
def test_jacobi_solves_loops_at_the_start_and_at_the_steps(fmi: int):
    seen: list[float] = []
    with Master(cycle(fmi=fmi), MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(Fraction(1), [lambda _t, y: seen.append(float(y["u0.y"]))])
    assert seen == pytest.approx([solution()[0]] * 11, rel=1e-7)
    assert master.iterates


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


@pytest.mark.parametrize("sampled", [False, True])
def test_jacobi_solves_a_loop_from_what_the_others_had_at_the_communication_point(sampled: bool):
    seen: list[tuple[float, ...]] = []

    def observe(_t: float, y: Signals) -> None:
        seen.append(tuple(float(y[n]) for n in ("ramp.x", "y.y", "z.y")))

    with Master(driven(sampled), MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(Fraction(1, 2), [observe])
        state = json.loads(json.dumps(master.stepper.get_state()))
        assert state["coupling"]["count"]["steps"] == master.iterations.steps == 5
        master.stepper.set_state(state)
        master.run(Fraction(1), [observe])
    times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]  # where the second run begins, again
    assert [x for x, _, _ in seen] == pytest.approx(times)
    for t, (_, y, z) in zip(times, seen, strict=True):
        x = max(t - 0.1, 0.0)
        assert (y, z) == pytest.approx(((x - 2.0) / 7.0, (3.0 * x + 1.0) / 7.0), rel=1e-6, abs=1e-9)


@every
@pytest.mark.parametrize("sampled", [False, True])
def test_a_loop_is_solved_at_each_step(algorithm: Algorithm, sampled: bool):
    seen: list[tuple[float, ...]] = []
    with Master(driven(sampled), MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1), [lambda _t, y: seen.append(tuple(float(y[n]) for n in ("ramp.x", "y.y", "z.y")))])
    assert master.iterates
    assert master.iterations.steps >= 10
    for x, y, z in seen:
        assert (y, z) == pytest.approx(((x - 2.0) / 7.0, (3.0 * x + 1.0) / 7.0), rel=1e-6, abs=1e-9)
    assert seen[-1][0] == pytest.approx(1.0)


def test_of_a_loop_of_several_rates_those_iterate_that_are_due():
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


def test_a_loop_is_solved_beside_units_with_events():
    s = driven()
    s.add("ball", native_fmu("ball"), period=Fraction(1, 10))
    with Master(s) as master:
        assert master.has_events
        master.run(Fraction(1))
        x, y, z = (float(master.signals[name]) for name in ("ramp.x", "y.y", "z.y"))
        state = json.loads(json.dumps(master.stepper.get_state()))
        assert state["coupling"]["count"]["steps"] == master.iterations.steps >= 10
        master.stepper.set_state(state)
    assert x == pytest.approx(1.0)
    assert (y, z) == pytest.approx((-1.0 / 7.0, 4.0 / 7.0), rel=1e-6)


@pytest.mark.parametrize(
    "options",
    [
        MasterOptions(algorithm=Algorithm.JACOBI, repeat_discarded=True),
        MasterOptions(algorithm=Algorithm.JACOBI, adaptive=AdaptiveStep(relative=0.03, absolute=0.03)),
        MasterOptions(algorithm=Algorithm.JACOBI, extrapolation=Extrapolation.LINEAR),
    ],
    ids=["events", "adaptive", "extrapolated"],
)
def test_jacobi_solves_loops_however_steps_are_taken(options: MasterOptions):
    s = driven()
    with Master(s, options) as master:
        master.run(Fraction(1))
        x, y, z = (float(master.signals[name]) for name in ("ramp.x", "y.y", "z.y"))
    assert z == pytest.approx(3.0 * y + 1.0, rel=1e-5, abs=1e-7)
    assert y == pytest.approx((x - 2.0) / 7.0, abs=0.1 / 7.0 * 1.0001)  # late by at most a step


def test_a_cycle_of_units_that_is_none_of_ports_is_no_loop(caplog: pytest.LogCaptureFixture):
    s = System()
    both = s.add("both", native_fmu("discrete_passer"), count_in=7)
    other = s.add("other", native_fmu("discrete_passer"))
    # truth of one acts on truth of the other alone; counts go the other way
    s.connect(both.y.count, other.u.count_in)
    s.connect(other.y.truth, both.u.truth_in)
    schedule = Schedule(s)
    assert not schedule.loops
    assert [g.units for g in schedule.groups] == [("both",), ("other",)]
    assert "both steps first where units wait for each other; it gets the previous values of other" in caplog.text
    with Master(s) as master:
        assert int(master.signals["other.count"]) == 7


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


def test_loops_are_found_with_their_ports():
    (loop,) = declared_loops(driven(), ["ramp", "y", "z"])
    assert set(loop.units) == {"y", "z"}
    assert {str(c.source) for c in loop.connections} == {"y.y", "z.y"}
    assert loop.message == "y.y -> z.u, z.u feeds through to z.y, z.y -> y.u2, y.u2 feeds through to y.y"


def test_a_unit_that_feeds_itself_is_a_loop():
    s = System()
    a = s.add("a", native_fmu("gain"), a=-1.0, b=1.0)
    s.connect(a.y.y, a.u.u)
    with Master(s) as master:
        master.run(Fraction(1, 2))
        assert float(master.signals["a.y"]) == pytest.approx(0.5)


def test_a_loop_whose_units_save_no_state_is_refused_and_spelled_out():
    with pytest.raises(ScheduleError) as caught:
        Master(driven(canGetAndSetFMUState=False))
    error_text = str(caught.value)
    assert "1 algebraic loop cannot be solved" in error_text
    assert (
        "y.y -> z.u, z.u feeds through to z.y, z.y -> y.u2, y.u2 feeds through to y.y: y, z do not save" in error_text
    )
    assert "a unit in the loop whose output has no direct feedthrough" in error_text
    assert "jacobi" not in error_text  # which solves loops, too
    with pytest.raises(ScheduleError, match="y, z do not save their states"):
        Master(driven(canGetAndSetFMUState=False), MasterOptions(algorithm=Algorithm.JACOBI))


def test_a_loop_of_values_that_are_not_real_is_refused():
    s = System()
    a = s.add("a", native_fmu("discrete_passer"))
    s.connect(a.y.count, a.u.count_in)
    for algorithm in Algorithm:
        with pytest.raises(ScheduleError, match=r"a\.count -> a\.count_in, .* feeds through to .* a\.count is integer"):
            Master(s, MasterOptions(algorithm=algorithm))


@every
def test_a_loop_without_a_solution_fails_with_its_name(algorithm: Algorithm):
    with (
        pytest.raises(InitializationError) as caught,
        Master(cycle((1.0, 2.0, 0.5)), MasterOptions(algorithm=algorithm, max_iterations=20)),
    ):
        pass
    failure = caught.value.failure
    assert isinstance(failure, NotConverged)
    assert set(failure.units) == {"u0", "u1", "u2"}
    assert "u0.y -> u1.u, u1.u feeds through to u1.y" in str(failure)
    (name, by), *_ = failure.moving
    assert name == "u2.y -> u0.u"
    assert abs(by) > 0.1
    assert "u2.y -> u0.u still moves by" in failure.message
    assert "u0.y -> u1.u, u1.u feeds through to u1.y" in str(caught.value)


@pytest.mark.parametrize("fmi", [2, 3])
def test_directional_derivatives_take_the_place_of_differences(fmi: int, monkeypatch: pytest.MonkeyPatch):
    error_text: list[Floats] = []
    chained = ChainedDerivatives.__call__

    def spy(self: ChainedDerivatives) -> Floats:
        error_text.append(chained(self))
        return error_text[-1]

    monkeypatch.setattr(ChainedDerivatives, "__call__", spy)
    flag = "providesDirectionalDerivative" + ("" if fmi == 2 else "s")
    a, b, c = CYCLE
    A = np.array([[0, 0, a], [b, 0, 0], [0, 100.0 * c, 0]])
    for given in (True, False):
        with Master(cycle(CYCLE, fmi, LinearTransformation(100.0, 1.0), **{flag: given})) as master:
            y = [float(master.signals[f"u{i}.y"]) for i in range(3)]
        assert y == pytest.approx(np.linalg.solve(np.eye(3) - A, [1.0, 1.0, 1.0 + c]).tolist(), rel=1e-6)
    assert [d.tolist() for d in error_text] == [[[a * b * c * 100.0]]]
