"""Step sizes by the estimated error, on the two-mass oscillator and on units that cannot repeat steps."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.oscillator import PLAIN, STATES, STIFF

from handover.cosim.exceptions import InvalidOptions, ScheduleError
from handover.cosim.master.checkpoint import read_checkpoint, take_checkpoint, write_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.stepping.adaptive_stepper import AdaptiveStepper, StepTooSmall
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.stepping.step_control import PiController, StepStatistics
from handover.cosim.system.signals import Signals
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


@pytest.mark.parametrize(("algorithm", "fmi"), [(Algorithm.JACOBI, 2), (Algorithm.GAUSS_SEIDEL, 3)])
def test_the_global_error_follows_the_tolerance(algorithm: Algorithm, fmi: int):
    """A tolerance of each step gives a global error that goes with its power p / (p + 1), p = 2."""
    tolerances = (1e-3, 1e-4, 1e-5)
    errors = [PLAIN.error_of(PLAIN.three_units(H, fmi), following(x, algorithm)) for x in tolerances]
    assert all(error < 100 * x for error, x in zip(errors, tolerances, strict=True))
    powers = np.log10(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(powers > 0.5)
    assert np.mean(powers) > 0.6


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

    def observe(t: float, signals: Signals) -> None:
        seen[t] = float(signals["clock.y"])

    with Master(s, following(1e-3)) as master:
        master.run(Fraction(9, 7), [observe])
        grid = master.schedule.tick / 2**40
    assert max(seen) == 9 / 7
    for k in range(10):
        assert seen[k / 7] == pytest.approx((k + 1) / 7)  # it acts at its instant, once
    assert len(set(seen.values())) == 10
    assert len(seen) > 30
    assert all(t == float(round(t / grid) * grid) for t in seen)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON])
def test_a_run_goes_on_bit_by_bit_from_a_checkpoint(algorithm: Algorithm, tmp_path: Path):
    found: list[tuple[list[float], StepStatistics]] = []

    def go_on(master: Master) -> None:
        master.run(Fraction(1))
        found.append(([float(master.signals[s]) for s in STATES], statistics(master)))

    system, options = PLAIN.three_units(H, 2), following(1e-4, algorithm)
    with Master(system, options) as master:
        master.run(Fraction(1, 2))
        write_checkpoint(tmp_path / "checkpoint", take_checkpoint(master, rows=0))
        go_on(master)
    with Master(system, options) as master:
        read_checkpoint(tmp_path / "checkpoint").restore(master)
        go_on(master)
    assert found[0] == found[1]


def test_a_step_that_a_unit_discards_is_tried_shorter():
    """It takes 0.04 s at most, and y = t shows no error."""
    s = System()
    s.add("impatient", native_fmu("discards"), period=Fraction(1, 10))
    seen: dict[float, float] = {}

    def observe(t: float, signals: Signals) -> None:
        seen[t] = float(signals["impatient.y"])

    with Master(s, following(1e-4)) as master:
        master.run(Fraction(1), [observe])
        found = statistics(master)
    assert list(seen.values()) == pytest.approx(list(seen))
    assert found.rejected >= 1
    assert found.longest <= 0.08  # two halves


def test_units_that_cannot_be_rolled_back_or_vary_their_step_are_all_named():
    s = System()
    s.add("good", native_fmu("mass"))
    s.add("forgetful", native_fmu("mass", canGetAndSetFMUState=False))
    s.add("rigid", native_fmu("fixed_step"))
    s.add("ball", native_fmu("ball"))
    with pytest.raises(ScheduleError) as caught:
        Master(s, following(1e-3))
    message = str(caught.value)
    faults = ("forgetful cannot save its state", "ball has events, at which steps end", "rigid takes fixed steps only")
    assert message == f"the step cannot follow the error: {'; '.join(faults)}"


def test_nothing_to_control_is_refused():
    s = System()
    s.add("clock", native_fmu("ramp"), sampled=True)
    with pytest.raises(ScheduleError, match="all units act at instants"):
        Master(s, following(1e-3))


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
    assert f"the error of {e.signal} is" in str(e)
    assert not e.log  # the unit said nothing, and did not fail
    assert e.verdict == "the step could not follow its error"


def test_faulty_tolerances_and_limits_are_reported_together():
    with pytest.raises(InvalidOptions) as caught:
        AdaptiveStep(
            relative=-1.0,
            absolute=float("nan"),
            smallest=Fraction(1, 10),
            largest=Fraction(1, 100),
            initial=Fraction(1, 1000),
        )
    assert caught.value.faults == (
        "the relative tolerance is -1.0; a number from 0 on is right",
        "the absolute tolerance is nan; a number from 0 on is right",
        "the largest step, 0.01 s, is below the smallest, 0.1 s",
        "the first step, 0.001 s, is out of the range from 0.1 s to 0.01 s",
    )
    with pytest.raises(InvalidOptions, match="both tolerances are 0"):
        AdaptiveStep(relative=0.0, absolute=0.0)


def test_outputs_that_are_left_uncontrolled_do_not_shorten_the_step():
    def longest(*uncontrolled: str) -> float:
        control = AdaptiveStep(largest=Fraction(1, 2), uncontrolled=uncontrolled)
        with Master(PLAIN.three_units(H, 2), MasterOptions(adaptive=control)) as master:
            master.run(Fraction(2))
            return statistics(master).longest

    outputs = [f"{name}.{port}" for name, u in PLAIN.three_units(H, 2).units.items() for port in u.description.outputs]
    assert longest() < 0.1
    assert longest(*outputs) == 0.5


def test_an_uncontrolled_output_that_does_not_exist_is_refused():
    s = System()
    s.add("mass", native_fmu("mass"))
    with pytest.raises(ScheduleError, match=r"there is no output 'mass\.w': did you mean mass\."):
        Master(s, MasterOptions(adaptive=AdaptiveStep(uncontrolled=("mass.w",))))


@pytest.mark.parametrize("power", [2, 3])
def test_the_step_settles_where_the_error_is_just_tolerated(power: int):
    """The error is (h / h_0)^k: with the margin s, (s / r)^(1 / k) = 1 asks for r = s^(k / 0.3) at rest."""
    controller, h, h_0 = PiController(power), 1.0, 37.0
    for _ in range(60):
        h *= controller.after_acceptance((h / h_0) ** power)
    assert (h / h_0) ** power == pytest.approx(0.9 ** (power / 0.3), rel=1e-3)


def test_a_growing_error_is_answered_before_it_is_too_large():
    steady, growing = PiController(2), PiController(2)
    steady.after_acceptance(0.5)
    growing.after_acceptance(0.1)
    assert growing.after_acceptance(0.5) < steady.after_acceptance(0.5)


def test_changes_are_limited_and_a_rejected_step_gets_shorter():
    assert PiController(2).after_acceptance(0.0) == 5.0
    assert PiController(2).after_rejection(1e30) == 0.2
    assert PiController(2).after_rejection(float("inf")) == 0.2
    assert PiController(2).after_rejection(1.0001) <= 0.9
    assert PiController(2).after_rejection(4.0) == pytest.approx(0.45)
