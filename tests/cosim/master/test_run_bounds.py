"""Runs at the edges: nothing to run, no time to run for, and runs that cannot go on."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import Edited, native_fmu

from handover.cosim.exceptions import InvalidOptions, UnitFailure, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.port_names import PortName
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.cosim.system.time_series import TimeSeries

OPTIONS = {
    "plan": MasterOptions(),
    "grid": MasterOptions(compiled=False),
    "jacobi": MasterOptions(algorithm=Algorithm.JACOBI),
    "newton": MasterOptions(algorithm=Algorithm.NEWTON),
    "events": MasterOptions(repeat_discarded=True),
    "adaptive": MasterOptions(adaptive=AdaptiveStep()),
}
all_ways = pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)


def ramp(fmi: int = 3) -> System:
    s = System()
    s.add("ramp", native_fmu("integrator", fmi), u=1.0, period=Fraction(1, 4))
    return s


@pytest.mark.parametrize("options", [o for name, o in OPTIONS.items() if name != "adaptive"])
def test_a_system_without_units_passes_through_time(options: MasterOptions, tmp_path: Path):
    with Master(System(), options) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(3, 2), [recorder])
    assert Record(tmp_path / "r.parquet").time.tolist() == [2.0]  # whole ticks, and a tick without units is 1 s


@all_ways
def test_a_run_to_where_it_is_shows_that_point_and_steps_nothing(options: MasterOptions):
    times: list[float] = []
    with Master(ramp(), options) as master:
        for stop in (0, 0, 1, 1):
            master.run(Fraction(stop), [lambda t, y: times.append(t + float(y["ramp.x"]))])
        assert master.time == 1.0
    assert times[:2] == [0.0, 0.0]
    assert times[-1] == times[-2] == pytest.approx(2.0)


@all_ways
def test_time_does_not_go_back(options: MasterOptions):
    seen: list[float] = []
    with Master(ramp(), options) as master:
        with pytest.raises(ValueError, match=r"a run to -1 s, but 0 s are reached"):
            master.run(Fraction(-1), [lambda t, _: seen.append(t)])
        master.run(Fraction(1))
        with pytest.raises(ValueError, match=r"a run to 0.5 s, but 1 s are reached"):
            master.run(Fraction(1, 2), [lambda t, _: seen.append(t)])
        assert master.time == 1.0
    assert seen == []


@all_ways
def test_units_that_are_freed_are_not_called(options: MasterOptions):
    with Master(ramp(), options) as master:
        master.run(Fraction(1))
    with pytest.raises(RuntimeError, match="the units are freed"):
        master.run(Fraction(2))
    with master:  # loads them once more
        master.run(Fraction(1, 2))
        assert master.signals["ramp.x"] == pytest.approx(0.5)


def test_units_are_not_loaded_twice_at_once():
    with Master(ramp()) as master:
        with pytest.raises(RuntimeError, match="entered already"):
            master.__enter__()
        master.run(Fraction(1))


@all_ways
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_that_failed_does_not_go_on(fmi: int, options: MasterOptions):
    s = System()
    s.add("bad", native_fmu("errs", fmi), at=0.45)
    with Master(s, options) as master:
        with pytest.raises(UnitFailure):
            master.run(Fraction(1))
        with pytest.raises(RuntimeError, match="bad failed, and the standards forbid further calls of it"):
            master.run(Fraction(1))


@all_ways
def test_a_run_goes_on_after_an_observer_that_raised(options: MasterOptions):
    def alarmed(t: float, _y: object) -> None:
        if t > 0.6:
            raise KeyboardInterrupt

    with Master(ramp(), options) as master:
        with pytest.raises(KeyboardInterrupt):
            master.run(Fraction(1), [alarmed])
        master.run(Fraction(1))
        assert master.signals["ramp.x"] == pytest.approx(1.0)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_that_gives_nothing_has_a_record_of_times(fmi: int, compiled: bool, tmp_path: Path):
    s = System()
    s.add("sink", native_fmu("sink", fmi))
    with Master(s, MasterOptions(compiled=compiled)) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(1, 2), [recorder])
    assert Record(tmp_path / "r.parquet").time.tolist() == [k / 10 for k in range(6)]


@all_ways
@pytest.mark.parametrize("fmi", [2, 3])
def test_units_are_given_the_end_of_their_last_step_and_none_is_asked_to_step_beyond_it(
    options: MasterOptions, fmi: int
):
    s = System()
    for name, period in (("tenths", Fraction(1, 10)), ("thirds", Fraction(1, 3)), ("slow", Fraction(3, 10))):
        s.add(name, native_fmu("clerk", fmi), period=period)
    with Master(s, options, stop=Fraction(1)) as master:
        master.run(Fraction(1))
        stops = [float(master.signals[f"{name}.stop"]) for name in s.units]
        assert stops == [1.0, 1.0, pytest.approx(1.2)]
        with pytest.raises(ValueError, match=r"a run to 2 s, but units were given the stop time 1 s"):
            master.run(Fraction(2))


@pytest.mark.parametrize("options", [MasterOptions(), MasterOptions(isolated=("all",))], ids=["here", "isolated"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_is_given_a_tolerance_by_name_or_for_all_or_its_own(fmi: int, options: MasterOptions, edited: Edited):
    s, own = System(), edited("clerk", fmi, ('stopTime="1"', 'stopTime="1" tolerance="1e-3"'))
    s.add("proposing", own)
    s.add("silent", native_fmu("clerk", fmi))

    def given(tolerances: dict[str, float]) -> list[float]:
        with Master(s, replace(options, unit_tolerances=tolerances)) as master:
            assert float(master.signals["silent.stop"]) == -1.0
            return [float(master.signals[f"{name}.tolerance"]) for name in s.units]

    assert given({}) == [1e-3, -1.0]
    assert given({"all": 1e-5}) == [1e-5, 1e-5]
    assert given({"all": 1e-5, "silent": 1e-7}) == [1e-5, 1e-7]
    with pytest.raises(InvalidOptions, match=r"there is no unit 'silnt' to give a tolerance; there are proposing"):
        Master(s, replace(options, unit_tolerances={"silnt": 1e-5}))


@pytest.mark.parametrize("tolerances", [{"a": 0.0}, {"a": float("nan")}, {1: 1e-3}, 1e-3])
def test_what_is_no_tolerance_is_refused(tolerances: Any):
    with pytest.raises(InvalidOptions, match="unit_tolerances"):
        MasterOptions(unit_tolerances=tolerances)


STARTS = [Fraction(7, 3), Fraction(-5, 3), Fraction(10**6) + Fraction(1, 10)]


def observed_from(start: Fraction, options: MasterOptions) -> tuple[list[float], list[tuple[float, ...]]]:
    """Run units at several rates, one of them sampled, for 2 s; return times and outputs."""
    s, times, rows = System(), list[float](), list[tuple[float, ...]]()
    s.start = start
    s.add("mass", native_fmu("mass", 2), period=Fraction(1, 16), k=10.0, x0=1.0)
    s.add("ramp", native_fmu("integrator", 3), u=1.0, period=Fraction(1, 4))
    s.add("sampled", native_fmu("gain", 3), sampled=True, period=Fraction(1, 2))
    s.connect(PortName("mass", "x"), PortName("sampled", "u"))
    with Master(s, options, stop=start + 2) as master:
        assert master.time == float(start)

        def observe(t: float, y: Signals) -> None:
            times.append(t)
            rows.append(tuple(float(y[name]) for name in ("mass.x", "ramp.x", "sampled.y")))

        master.run(start + 2, [observe])
    return times, rows


@all_ways
@pytest.mark.parametrize("start", STARTS, ids=float)
def test_a_run_from_another_start_is_the_same_at_later_times(start: Fraction, options: MasterOptions):
    times, rows = observed_from(start, options)
    from_0, expected = observed_from(Fraction(0), options)
    assert times == [float(start + Fraction(t)) for t in from_0]
    assert len(times) > 4
    np.testing.assert_allclose(rows, expected, rtol=1e-9)


@pytest.mark.parametrize("fmi", [2, 3])
def test_units_are_given_the_start_and_inputs_follow_values_from_it_on(fmi: int):
    s = System()
    s.start = Fraction(5)
    s.add("clerk", native_fmu("clerk", fmi), period=Fraction(1, 2))
    passer = s.add("gain", native_fmu("gain", fmi), period=Fraction(1, 2))
    s.follow(passer.u.u, TimeSeries([0.0, 10.0], [[0.0], [20.0]], linear=True))
    seen: list[tuple[float, ...]] = []
    with Master(s) as master:
        names = "clerk.start", "clerk.now", "gain.y"
        master.run(Fraction(6), [lambda t, y: seen.append((t, *(float(y[n]) for n in names)))])
    assert seen == [(5.0, 5.0, 5.0, 10.0), (5.5, 5.0, 5.5, 10.0), (6.0, 5.0, 6.0, 11.0)]


def test_a_start_that_is_not_exact_is_refused():
    s = ramp()
    s.start = 0.1  # type: ignore[assignment]
    with pytest.raises(WiringError, match=r"its start, 0\.1, is not exact; give Fraction\('0\.1'\)"):
        s.check()
