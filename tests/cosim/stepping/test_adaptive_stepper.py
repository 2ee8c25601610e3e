"""Step sizes by the estimated error, on the two-mass oscillator and on units that cannot repeat steps."""

import math
from fractions import Fraction

import pytest
from support.cosim.native_units import native_fmu
from support.cosim.oscillator import PLAIN, STATES, STIFF

from handover.cosim.master.master import Master
from handover.cosim.stepping.adaptive_stepper import AdaptiveStepper, PiController, StepStatistics, StepTooSmall
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System

H = Fraction(1, 100)


def following(
    tolerance: float, algorithm: Algorithm = Algorithm.GAUSS_SEIDEL, initial: Fraction | None = None
) -> MasterOptions:
    control = AdaptiveStep(relative=tolerance, absolute=tolerance / 10, initial=initial)
    return MasterOptions(algorithm=algorithm, extrapolation=Extrapolation.LINEAR, adaptive=control, cpu_times=True)


def statistics(master: Master) -> StepStatistics:
    assert isinstance(master.stepper, AdaptiveStepper)
    return master.stepper.statistics


def test_the_global_error_follows_the_tolerance():
    """A tolerance of each step gives a global error that goes with its power p / (p + 1), p = 2."""
    large, small = (PLAIN.error_of(PLAIN.three_units(H, 3), following(x)) for x in (1e-3, 1e-5))
    assert large < 100 * 1e-3
    assert small < 100 * 1e-5
    assert math.log10(large / small) / 2 > 0.6


def test_fewer_steps_for_the_same_error_where_a_transient_dies_away():
    fixed_options = MasterOptions(algorithm=Algorithm.JACOBI, extrapolation=Extrapolation.LINEAR, cpu_times=True)
    steps: list[int] = []
    errors: list[float] = []
    for options in (following(1e-3, Algorithm.JACOBI), fixed_options):
        with Master(STIFF.three_units(H, 3), options) as master:
            errors.append(STIFF.largest_error_of(master, Fraction(8)))
            steps.append(len(master.cpu["a"]))
    assert errors[0] < errors[1]
    assert steps[0] < steps[1] / 2  # trials and halves counted


def test_a_first_step_that_is_too_long_is_rolled_back():
    with Master(PLAIN.three_units(H, 3), following(1e-4, initial=Fraction(1, 2))) as master:
        master.run(Fraction(1))
        found = statistics(master)
        at_end = [float(master.signals[s]) for s in STATES]
    assert found.rejected >= 1
    assert 0 < found.shortest < found.longest < 0.25
    assert at_end == pytest.approx(PLAIN.exact(1.0).tolist(), abs=5e-3)


def test_instants_of_sampled_units_and_the_stop_time_are_met_exactly():
    s = PLAIN.three_units(H, 3)
    s.add("clock", native_fmu("ramp"), period=Fraction(1, 7), sampled=True)
    seen: dict[float, float] = {}
    with Master(s, following(1e-3)) as master:
        master.run(Fraction(9, 7), [lambda t, y: seen.update({t: float(y["clock.y"])})])
        grid = master.schedule.tick / 2**40
    assert max(seen) == 9 / 7
    for k in range(10):
        assert seen[k / 7] == pytest.approx((k + 1) / 7)  # it acts at its instant, once
    assert len(set(seen.values())) == 10
    assert len(seen) > 30
    assert all(t == float(round(t / grid) * grid) for t in seen)


def test_a_step_that_a_unit_discards_is_tried_shorter():
    """It takes 0.04 s at most, and y = t shows no error."""
    s = System()
    s.add("impatient", native_fmu("discards"), period=Fraction(1, 10))
    seen: dict[float, float] = {}
    with Master(s, following(1e-4)) as master:
        master.run(Fraction(1), [lambda t, y: seen.update({t: float(y["impatient.y"])})])
        found = statistics(master)
    assert list(seen.values()) == pytest.approx(list(seen))
    assert found.rejected >= 1
    assert found.longest <= 0.08  # two halves


def test_a_step_below_the_smallest_names_the_signal_with_the_largest_error():
    control = AdaptiveStep(relative=1e-9, absolute=0.0, smallest=Fraction(1, 1000))
    seen: list[float] = []
    with Master(PLAIN.three_units(H, 3), MasterOptions(adaptive=control)) as master:
        with pytest.raises(StepTooSmall) as caught:
            master.run(Fraction(1), [lambda t, _: seen.append(t)])
        assert [float(master.signals[s]) for s in ("a.x", "b.x")] == [1.0, -0.5]
    e = caught.value
    assert seen == [0.0]
    assert e.signal.split(".")[0] == e.unit
    assert e.signal in ("a.v", "b.v", "a.x", "b.x", "spring.f1", "spring.f2")
    assert e.error > 1
    assert e.step == pytest.approx(1e-3, rel=0.25)
    assert not e.log  # the unit said nothing, and did not fail


def test_outputs_that_are_left_uncontrolled_do_not_shorten_the_step():
    def longest(*uncontrolled: str) -> float:
        control = AdaptiveStep(largest=Fraction(1, 2), uncontrolled=uncontrolled)
        with Master(PLAIN.three_units(H, 2), MasterOptions(adaptive=control)) as master:
            master.run(Fraction(2))
            return statistics(master).longest

    outputs = [f"{name}.{port}" for name, u in PLAIN.three_units(H, 2).units.items() for port in u.description.outputs]
    assert longest() < 0.1
    assert longest(*outputs) == 0.5


@pytest.mark.parametrize("power", [2, 3])
def test_the_step_settles_where_the_error_is_just_tolerated(power: int):
    """The error is (h / h_0)^k: with the margin s, (s / r)^(1 / k) = 1 asks for r = s^(k / 0.3) at rest."""
    controller, h, h_0 = PiController(power), 1.0, 37.0
    for _ in range(60):
        h *= controller.after_acceptance((h / h_0) ** power)
    assert (h / h_0) ** power == pytest.approx(0.9 ** (power / 0.3), rel=1e-3)


def test_changes_are_limited_a_growing_error_is_answered_early_and_a_rejected_step_gets_shorter():
    steady, growing = PiController(2), PiController(2)
    steady.after_acceptance(0.5)
    growing.after_acceptance(0.1)
    assert growing.after_acceptance(0.5) < steady.after_acceptance(0.5)
    assert PiController(2).after_acceptance(0.0) == 5.0
    assert PiController(2).after_rejection(1e30) == 0.2
    assert PiController(2).after_rejection(float("inf")) == 0.2
    assert PiController(2).after_rejection(1.0001) <= 0.9
    assert PiController(2).after_rejection(4.0) == pytest.approx(0.45)
