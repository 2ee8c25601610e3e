"""A unit discards a step: it is repeated shorter by all, or the run ends and says so."""

from fractions import Fraction

import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import grid, observed_rows

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.failures import StepDiscarded
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]
REPEATING = MasterOptions(repeat_discarded=True)


def system(fmi: int, other: str = "integrator", **flags: bool) -> System:
    """A unit that takes no steps above 0.04 s, in steps of 0.1 s beside another one."""
    s = System()
    s.add("short", native_fmu("discards", fmi, **flags))
    s.add("other", native_fmu(other, 3), u=1.0)
    return s


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_all_repeat_a_step_as_far_as_the_unit_came(algorithm: Algorithm):
    options = MasterOptions(repeat_discarded=True, algorithm=algorithm)
    rows = observed_rows(system(2), Fraction(1, 2), "short.y", "other.x", options=options)
    shorter = [begin + part for begin in grid(10)[:5] for part in (0.0, 0.04, 0.08)] + [0.5]
    assert list(rows) == pytest.approx(shorter, abs=1e-12)
    for t, row in rows.items():
        assert row == pytest.approx((t, t), abs=1e-12)


def test_fmi_3_gives_no_time_so_halves_are_tried():
    rows = observed_rows(system(3), Fraction(1, 5), "short.y", "other.x", options=REPEATING)
    assert list(rows)[:5] == pytest.approx([0.0, 0.025, 0.0625, 0.1, 0.125], abs=1e-12)
    for t, row in rows.items():
        assert row == pytest.approx((t, t), abs=1e-12)


@pytest.mark.parametrize(("fmi", "came"), [(2, "0.04"), (3, "0")])
def test_without_repetition_a_discarded_step_ends_the_run(fmi: int, came: str):
    with pytest.raises(StepDiscarded) as failure:
        observed_rows(system(fmi), Fraction(1, 2), "short.y")
    assert failure.value.reached == pytest.approx(float(came))
    assert failure.value.headline == (
        f"short: fmi{fmi}DoStep at t = 0 s answered Discard, having reached t = {came} s; "
        "steps are repeated shorter only with --repeat-discarded (repeat_discarded of MasterOptions)"
    )
    assert failure.value.message.startswith("[Discard] a step of 0.1 s is longer than 0.04 s (steps are repeated")


def test_a_unit_that_cannot_roll_back_is_reported():
    s = system(2, canGetAndSetFMUstate=False, canSerializeFMUstate=False)
    with pytest.raises(StepDiscarded, match=r"having reached t = 0.04 s; short cannot save its state or vary its step"):
        observed_rows(s, Fraction(1, 2), "short.y", options=REPEATING)


def test_others_that_cannot_roll_back_are_reported():
    s = system(2, "fixed_step")
    with pytest.raises(StepDiscarded, match="the others would have to roll back too, and other cannot save its state"):
        observed_rows(s, Fraction(1, 2), "short.y", options=REPEATING)


def test_a_unit_that_discards_every_step_ends_the_run():
    s = System()
    s.add("short", native_fmu("discards", 3), longest=1e-9)
    with pytest.raises(StepDiscarded, match=r"steps down to 9.77e-05 s were tried"):
        observed_rows(s, Fraction(1, 2), "short.y", options=REPEATING)


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_repetition_changes_nothing_where_nothing_is_discarded(algorithm: Algorithm):
    def two_masses() -> System:
        s = System()
        mass, spring = s.add("mass", native_fmu("mass"), x0=1.0), s.add("spring", native_fmu("sprung_mass"), k_c=2.0)
        s.connect(mass.y.x, spring.u.x1)
        s.connect(mass.y.v, spring.u.v1)
        s.connect(spring.y.f, mass.u.f)
        return s

    names = ("mass.x", "spring.x", "spring.f")
    plain, repeating = (MasterOptions(algorithm=algorithm, repeat_discarded=repeats) for repeats in (False, True))
    assert observed_rows(two_masses(), Fraction(3), *names, options=repeating) == observed_rows(
        two_masses(), Fraction(3), *names, options=plain
    )


def test_units_are_distinguished_that_have_events():
    with Master(system(2)) as plain, Master(system(2), REPEATING) as repeating:
        assert (plain.has_events, repeating.has_events) == (False, True)
    s = System()
    s.add("ball", native_fmu("ball"))
    assert Master(s).has_events


def test_a_step_that_goes_on_by_itself_is_not_waited_for():
    s = System()
    s.add("pending", native_fmu("pending", 2))
    with pytest.raises(UnitFailure, match=r"pending: fmi2DoStep at t = 0.2 s answered Pending"):
        observed_rows(s, Fraction(1, 2), "pending.count")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_instant_is_one_row_where_a_unit_changes_the_rounding(algorithm: Algorithm):
    s = System()
    for at in (0.55, 0.65):
        s.add(f"rounds_at_{at}".replace(".", "_"), native_fmu("round_up_in_step", 3), at=at)
    s.add("other", native_fmu("integrator", 3), u=1.0)
    options = MasterOptions(repeat_discarded=True, algorithm=algorithm)
    assert list(observed_rows(s, Fraction(1), "other.x", options=options)) == [k / 10 for k in range(11)]
