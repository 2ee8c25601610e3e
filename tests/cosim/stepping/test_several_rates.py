"""Units with several rates: a result counts, and is recorded, from the end of its step; and inputs on lines between."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import observed_rows

from handover.cosim.master.master import Master
from handover.cosim.stepping.extrapolation import SampleHistory
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.stepping.jacobi import Jacobi
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.stepping.stepper import GridStepper
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.schedule import Slot
from handover.cosim.system.system import System

SIGNALS = ("ramp.y", "slow.x", "fast.x")


def integrators(slow: Fraction, fast: Fraction) -> System:
    """Return a system in which a slow unit integrates what a fast one says, y = t, and a fast one integrates that."""
    s = System()
    ramp = s.add("ramp", native_fmu("ramp"), period=fast)
    first = s.add("slow", native_fmu("integrator"), period=slow)
    second = s.add("fast", native_fmu("integrator"), period=fast)
    s.connect(ramp.y.y, first.u.u)
    s.connect(first.y.x, second.u.u, LinearTransformation())
    return s


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_of_each_unit_a_row_holds_what_it_had_at_its_time(algorithm: Algorithm):
    options = MasterOptions(algorithm=algorithm)
    seen = observed_rows(integrators(Fraction(1, 2), Fraction(1, 10)), Fraction(1), *SIGNALS, options=options)
    assert [row[1] for t, row in seen.items() if t < 0.5] == [0.0] * 5
    if algorithm.coupling.traits.parallel:
        assert seen[1.0][1] == 0.5 * 0.5  # the ramp's value at 0.5 s, held
        return
    assert seen[0.5][1] == seen[0.9][1] > 0.0
    assert seen[0.5][2] == 0.0  # nothing of the slow unit's first half second counted before it was over
    assert seen[1.0][2] == pytest.approx(0.5 * seen[0.5][1])


def test_steps_that_are_no_multiples_of_each_other_are_recorded_where_they_end():
    seen = observed_rows(integrators(Fraction(1, 4), Fraction(1, 10)), Fraction(1, 2), "ramp.y")
    assert list(seen) == [0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5]
    assert [y for (y,) in seen.values()] == pytest.approx([0.0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5])


def test_where_the_step_adapts_results_do_not_depend_on_the_rates_that_units_ask_for():
    step = AdaptiveStep(initial=Fraction(1, 10), largest=Fraction(1, 10))
    rows = [
        observed_rows(integrators(slow, Fraction(1, 10)), Fraction(1), "fast.x", options=MasterOptions(adaptive=step))
        for slow in (Fraction(1, 10), Fraction(1, 2))
    ]
    assert rows[0] == rows[1]


THIRD, SEVENTH = Fraction(1, 3000), Fraction(1, 7000)


class Counting(Jacobi):
    """A coupling that counts how often each unit steps, and from when at last."""

    def __init__(self) -> None:
        self.steps: dict[str, int] = {}
        self.begins: dict[str, float] = {}
        self.count = IterationCount()

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None: ...

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        for slot in (*sampled, *continuous):
            self.steps[slot.unit] = self.steps.get(slot.unit, 0) + 1
            self.begins[slot.unit] = t

    def get_state(self) -> Mapping[str, Any]:
        return {}

    def set_state(self, state: Mapping[str, Any]) -> None: ...


def thirds_and_sevenths() -> System:
    s = System()
    for name, period in (("third", THIRD), ("seventh", SEVENTH)):
        s.add(name, native_fmu("integrator"), period=period)
    return s


@pytest.mark.parametrize("first", [0, 10**7 - 21_000, 10**15])
def test_instants_are_exact_however_late(first: int):
    """Times are those, rounded once, of every tick that 7 (a third of 1 ms) or 3 (a seventh) divides."""
    counting, last = Counting(), first + 21_000
    with Master(thirds_and_sevenths()) as master:
        stepper = GridStepper(master.schedule, counting, master.ensemble)
    assert master.schedule.tick == Fraction(1, 21_000)
    due = {"third": -(-first // 7) * 7, "seventh": -(-first // 3) * 3}
    stepper.set_state({"tick": first, "due": due, "acted": {}, "coupling": {}})
    times: list[float] = []
    while not stepper.arrive(last):
        times.append(stepper.time)
        stepper.depart()
    assert times == [float(Fraction(tick, 21_000)) for tick in range(first, last) if tick % 3 == 0 or tick % 7 == 0]
    assert counting.steps == {"third": 3000, "seventh": 7000}
    ends = {"third": (due["third"] + 2999 * 7) // 7 * THIRD, "seventh": (due["seventh"] + 6999 * 3) // 3 * SEVENTH}
    assert counting.begins == {name: float(end) for name, end in ends.items()}


LINEAR = MasterOptions(extrapolation=Extrapolation.LINEAR)
LINEAR_JACOBI = MasterOptions(extrapolation=Extrapolation.LINEAR, algorithm=Algorithm.JACOBI)


def integrated_ramp(slow: Fraction, fast: Fraction, **placing: Any) -> System:
    """Return a system in which a fast unit integrates what a slow one says: y = t."""
    s = System()
    ramp = s.add("ramp", native_fmu("ramp"), period=slow, **placing)
    integrator = s.add("integrator", native_fmu("integrator"), period=fast)
    s.connect(ramp.y.y, integrator.u.u)
    return s


def course(system: System, signal: str, stop: Fraction, options: MasterOptions = LINEAR) -> dict[float, float]:
    return {t: y for t, (y,) in observed_rows(system, stop, signal, options=options).items()}


@pytest.mark.parametrize("fast", [Fraction(1, 10), Fraction(1, 7)])
def test_a_fast_unit_gets_a_slow_ones_values_at_its_own_times(fast: Fraction):
    seen = course(integrated_ramp(Fraction(1), fast), "integrator.x", Fraction(3))
    assert len(seen) == 3 / fast + 1
    assert list(seen.values()) == pytest.approx([t * t / 2 for t in seen], rel=1e-12, abs=1e-12)


def test_a_line_begins_level_and_is_drawn_on():
    seen = course(integrated_ramp(Fraction(1), Fraction(1, 4)), "integrator.x", Fraction(3), LINEAR_JACOBI)
    assert [seen[t] for t in (0.5, 1.0, 1.5, 2.5, 3.0)] == [0.0, 0.0, 0.625, 2.625, 4.0]


def test_what_acts_at_instants_is_held():
    seen = course(integrated_ramp(Fraction(1), Fraction(1, 4), sampled=True), "integrator.x", Fraction(3))
    assert seen[3.0] == 1 + 2 + 3


@pytest.mark.parametrize(("interpolates", "error"), [(True, 0.0), (False, 2 * (1 / 4) ** 2 / 12)])
def test_input_derivatives_are_used_where_a_unit_of_fmi2_interpolates(interpolates: bool, error: float):
    """x'' = 2 t + 1; a force that is held at its value in the middle of steps of h makes x lead by 2 h^2 t / 12."""
    s = System()
    ramp = s.add("ramp", native_fmu("ramp", 2), period=Fraction(1, 4))
    mass = s.add("mass", native_fmu("mass", 2, canInterpolateInputs=interpolates), period=Fraction(1, 4))
    s.connect(ramp.y.y, mass.u.f, LinearTransformation(2.0, 1.0))
    x = course(s, "mass.x", Fraction(1))[1.0]
    assert x == pytest.approx(1 / 3 + 1 / 2 + error, abs=1e-9)


def test_places_on_a_line_do_not_depend_on_how_late_it_is():
    def line_from(first: int) -> SampleHistory:
        values = np.array([1.0, 2.0])
        history = SampleHistory(values)
        history.record(first)
        values[...] = (1.3, -0.4)
        history.record(first + 3)
        return history

    early, late = 21, 21 * 10**13
    for half_ticks in range(-6, 20):
        a, b = (line_from(first).at(2 * first + half_ticks) for first in (early, late))
        assert a.tolist() == b.tolist() == pytest.approx([1 + 0.05 * half_ticks, 2 - 0.4 * half_ticks])
    assert line_from(late).rate(0.1).tolist() == pytest.approx([1.0, -8.0])
