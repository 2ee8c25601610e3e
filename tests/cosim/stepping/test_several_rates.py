"""Units with several rates: results count, and are recorded, from the time to which a step leads."""

from fractions import Fraction

import pytest
from native_units import native_fmu
from observed_rows import observed_rows

from handover.cosim.master.checkpoint import take_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.signals import Signals
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


def test_of_each_unit_a_row_holds_what_it_had_at_its_time():
    seen = observed_rows(integrators(Fraction(1, 2), Fraction(1, 10)), Fraction(1), *SIGNALS)
    assert [seen[t][1] for t in (0.0, 0.1, 0.4)] == [0.0] * 3
    assert seen[0.5][1] == seen[0.9][1] > 0.0
    assert seen[0.5][2] == 0.0  # nothing of the slow unit's first half second counted before it was over
    assert seen[1.0][2] == pytest.approx(0.5 * seen[0.5][1])


def test_steps_that_are_no_multiples_of_each_other_are_recorded_where_they_end():
    seen = observed_rows(integrators(Fraction(1, 4), Fraction(1, 10)), Fraction(1, 2), "ramp.y")
    assert list(seen) == [0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5]
    assert [y for (y,) in seen.values()] == pytest.approx([0.0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5])


@pytest.mark.parametrize("algorithm", [Algorithm.GAUSS_SEIDEL, Algorithm.FIXED_POINT, Algorithm.JACOBI])
def test_no_algorithm_lets_a_result_count_before_its_time(algorithm: Algorithm):
    options = MasterOptions(algorithm=algorithm)
    seen = observed_rows(integrators(Fraction(1, 2), Fraction(1, 10)), Fraction(1), "slow.x", options=options)
    assert [x for t, (x,) in seen.items() if t < 0.5] == [0.0] * 5


def test_the_general_path_and_units_in_processes_of_their_own_have_the_same_values():
    rows = [
        observed_rows(integrators(Fraction(1, 4), Fraction(1, 10)), Fraction(2), *SIGNALS, options=options)
        for options in (
            MasterOptions(),
            MasterOptions(compiled=False),
            MasterOptions(isolated=("slow",)),
            MasterOptions(isolated=("all",)),
            MasterOptions(isolated=("all",), compiled=False),
        )
    ]
    assert rows == rows[:1] * len(rows)


def test_where_the_step_adapts_results_do_not_depend_on_the_rates_that_units_ask_for():
    step = AdaptiveStep(initial=Fraction(1, 10), largest=Fraction(1, 10))
    rows = [
        observed_rows(integrators(slow, Fraction(1, 10)), Fraction(1), "fast.x", options=MasterOptions(adaptive=step))
        for slow in (Fraction(1, 10), Fraction(1, 2))
    ]
    assert rows[0] == rows[1]


def test_a_run_goes_on_from_a_checkpoint_amid_a_slow_step():
    def build() -> System:
        return integrators(Fraction(1, 2), Fraction(1, 10))

    rest: dict[float, tuple[float, ...]] = {}

    def observe(t: float, signals: Signals) -> None:
        rest[t] = tuple(float(signals[name]) for name in SIGNALS)

    with Master(build()) as master:
        master.run(Fraction(7, 10), [])
        checkpoint = take_checkpoint(master, 0)
    with Master(build()) as master:
        checkpoint.restore(master)
        master.run(Fraction(2), [observe])
    whole = observed_rows(build(), Fraction(2), *SIGNALS)
    assert rest == {t: values for t, values in whole.items() if t >= checkpoint.time}
