"""A unit discards a step: it is repeated shorter by all, or the run ends and says so."""

from fractions import Fraction
from typing import Any

import pytest
from support.cosim.call_log import CallLog
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import grid, observed_rows
from support.wording import Wording

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.failures import StepDiscarded
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System


def system(fmi: int, other: str = "integrator", **flags: bool) -> System:
    """A unit that takes no steps above 0.04 s, in steps of 0.1 s beside another one."""
    s = System()
    s.add("short", native_fmu("discards", fmi, **flags))
    s.add("other", native_fmu(other, 3), u=1.0)
    return s


BEGINS = [begin + part for begin in grid(10)[:5] for part in (0.0, 0.04, 0.08)] + [0.5]
HALVES = [0.0, 0.025, 0.0625, 0.1, 0.125]  # FMI 3 gives no time up to which the unit came


@pytest.mark.parametrize(
    ("fmi", "algorithm", "times"),
    [(2, Algorithm.JACOBI, BEGINS), (2, Algorithm.GAUSS_SEIDEL, BEGINS), (3, Algorithm.GAUSS_SEIDEL, HALVES)],
)
def test_all_repeat_a_step_as_far_as_the_unit_came(fmi: int, algorithm: Algorithm, times: list[float]):
    options = MasterOptions(repeat_discarded=True, algorithm=algorithm)
    rows = observed_rows(system(fmi), Fraction(1, 2), "short.y", "other.x", options=options)
    assert list(rows)[: len(times)] == pytest.approx(times, abs=1e-12)
    for t, row in rows.items():
        assert row == pytest.approx((t, t), abs=1e-12)


@pytest.mark.parametrize(("fmi", "reached"), [(2, 0.04), (3, 0.0)])
def test_without_repetition_a_discarded_step_ends_the_run(fmi: int, reached: float, wording: Wording):
    call_log = CallLog()
    with pytest.raises(StepDiscarded) as failure, Master(system(fmi), MasterOptions(), call_log) as master:
        master.run(Fraction(1))
    assert failure.value.reached == pytest.approx(reached)
    wording.check(failure.value)
    wording.check(failure.value.message)
    assert [c for unit, c in call_log.calls if unit == "short"][-2:] == [f"fmi{fmi}Terminate", f"fmi{fmi}FreeInstance"]


def alone(unit: str, fmi: int, **start: Any) -> System:
    s = System()
    s.add("unit", native_fmu(unit, fmi), **start)
    return s


@pytest.mark.parametrize(
    "s",
    [
        pytest.param(system(2, canGetAndSetFMUstate=False, canSerializeFMUstate=False), id="it keeps no state"),
        pytest.param(system(2, "fixed_step"), id="others keep none"),
        pytest.param(alone("discards", 3, longest=1e-9), id="every step"),
        pytest.param(alone("pending", 2), id="a step that goes on by itself"),
    ],
)
def test_what_cannot_be_repeated_ends_the_run(s: System, wording: Wording):
    with pytest.raises(UnitFailure) as failure:
        observed_rows(s, Fraction(1, 2), options=MasterOptions(repeat_discarded=True))
    assert isinstance(failure.value, StepDiscarded) == ("pending" not in str(s.units))
    wording.check(failure.value)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON])
def test_repetition_changes_nothing_where_nothing_is_discarded(algorithm: Algorithm):
    s = System()
    mass, spring = s.add("mass", native_fmu("mass"), x0=1.0), s.add("spring", native_fmu("sprung_mass"), k_c=2.0)
    s.connect(mass.y.x, spring.u.x1)
    s.connect(mass.y.v, spring.u.v1)
    s.connect(spring.y.f, mass.u.f)
    plain, repeating = (MasterOptions(algorithm=algorithm, repeat_discarded=repeats) for repeats in (False, True))
    names, stop = ("mass.x", "spring.x", "spring.f"), Fraction(1)
    assert observed_rows(s, stop, *names, options=plain) == observed_rows(s, stop, *names, options=repeating)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
def test_an_instant_is_one_row_where_a_unit_changes_the_rounding(algorithm: Algorithm):
    s = System()
    for at in (0.55, 0.65):
        s.add(f"rounds_at_{at}".replace(".", "_"), native_fmu("round_up_in_step", 3), at=at)
    s.add("other", native_fmu("integrator", 3), u=1.0)
    options = MasterOptions(repeat_discarded=True, algorithm=algorithm)
    assert list(observed_rows(s, Fraction(1), "other.x", options=options)) == grid(10)
