"""Runs at the edges: nothing to run, no time to run for, runs that cannot go on; and the order of a unit's calls."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.cosim.call_log import CallLog
from support.cosim.checkpointed_runs import oscillator
from support.cosim.native_units import Edited, native_fmu
from support.cosim.observed_rows import observed_rows
from support.wording import Wording

from handover.cosim.exceptions import InvalidOptions, ScheduleError, UnitFailure, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.port_names import PortName
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


def ramp() -> System:
    s = System()
    s.add("ramp", native_fmu("integrator"), u=1.0, period=Fraction(1, 4))
    return s


@pytest.mark.parametrize("options", [OPTIONS[name] for name in ("plan", "grid", "events")])
def test_a_system_without_units_passes_through_time(options: MasterOptions, tmp_path: Path):
    with Master(System(), options) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(3, 2), [recorder])
    assert Record(tmp_path / "r.parquet").time.tolist() == [2.0]  # whole ticks, and a tick without units is 1 s


def test_more_steps_than_can_be_done_are_refused(wording: Wording):
    with pytest.raises(ScheduleError) as refused:
        Master(ramp(), stop=Fraction(10) ** 300)
    wording.check(refused.value)
    Master(ramp(), stop=Fraction(10) ** 9)


@all_ways
def test_a_run_goes_on_from_where_it_is_but_neither_back_nor_without_units(options: MasterOptions):
    seen: list[tuple[float, float]] = []

    def alarmed(t: float, _y: object) -> None:
        if t > 0.6:
            raise KeyboardInterrupt

    with Master(ramp(), options) as master:
        for stop in (0, 0, Fraction(1, 2), 1, 1):
            master.run(Fraction(stop), [lambda t, y: seen.append((t, float(y["ramp.x"])))])
        assert (master.time, seen[0], seen[1]) == (1.0, (0.0, 0.0), (0.0, 0.0))
        assert seen[-1] == seen[-2] == pytest.approx((1.0, 1.0))
        for stop in (-1, Fraction(1, 2)):
            with pytest.raises(ValueError, match=f"a run to {float(stop):g} s, but 1 s are reached"):
                master.run(Fraction(stop), [lambda *_: seen.clear()])
        assert (master.time, len(seen) > 4) == (1.0, True)
    with pytest.raises(RuntimeError, match="the units are freed"):
        master.run(Fraction(2))
    with master:  # loads them once more
        with pytest.raises(KeyboardInterrupt):
            master.run(Fraction(1), [alarmed])
        master.run(Fraction(1))
        assert master.signals["ramp.x"] == pytest.approx(1.0)
        with pytest.raises(RuntimeError, match="entered already"):
            master.__enter__()


@all_ways
def test_a_unit_that_failed_does_not_go_on(options: MasterOptions):
    s = System()
    s.add("bad", native_fmu("errs", 2), at=0.45)
    with Master(s, options) as master:
        with pytest.raises(UnitFailure):
            master.run(Fraction(1))
        with pytest.raises(RuntimeError, match="bad failed, and the standards forbid further calls of it"):
            master.run(Fraction(1))


@pytest.mark.parametrize(("compiled", "fmi"), [(True, 2), (False, 3)])
def test_a_unit_that_gives_nothing_has_a_record_of_times(fmi: int, compiled: bool, tmp_path: Path):
    s = System()
    s.add("sink", native_fmu("sink", fmi))
    with Master(s, MasterOptions(compiled=compiled)) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(1, 2), [recorder])
    assert Record(tmp_path / "r.parquet").time.tolist() == [k / 10 for k in range(6)]


@pytest.mark.parametrize(("way", "fmi"), [*((way, 3) for way in OPTIONS if way != "jacobi"), ("plan", 2)])
def test_units_are_given_the_end_of_their_last_step_and_none_is_asked_to_step_beyond_it(way: str, fmi: int):
    s = System()
    for name, period in (("tenths", Fraction(1, 10)), ("thirds", Fraction(1, 3)), ("slow", Fraction(3, 10))):
        s.add(name, native_fmu("clerk", fmi), period=period)
    with Master(s, OPTIONS[way], stop=Fraction(1)) as master:
        master.run(Fraction(1))
        stops = [float(master.signals[f"{name}.stop"]) for name in s.units]
        assert stops == [1.0, 1.0, pytest.approx(1.2)]
        with pytest.raises(ValueError, match=r"a run to 2 s, but units were given the stop time 1 s"):
            master.run(Fraction(2))


@pytest.mark.parametrize(("fmi", "isolated"), [(2, ()), (2, ("all",)), (3, ()), (3, ("all",))])
def test_a_unit_is_given_a_tolerance_by_name_or_for_all_or_its_own(
    fmi: int, isolated: tuple[str, ...], edited: Edited, wording: Wording
):
    s, own = System(), edited("clerk", fmi, ('stopTime="1"', 'stopTime="1" tolerance="1e-3"'))
    s.add("proposing", own)
    s.add("silent", native_fmu("clerk", fmi))
    options = MasterOptions(isolated=isolated)
    for tolerances, given in (
        ({}, [1e-3, -1.0]),
        ({"all": 1e-5}, [1e-5, 1e-5]),
        ({"all": 1e-5, "silent": 1e-7}, [1e-5, 1e-7]),
    )[-1 if isolated else 0 :]:
        with Master(s, replace(options, unit_tolerances=tolerances)) as master:
            assert float(master.signals["silent.stop"]) == -1.0
            assert [float(master.signals[f"{name}.tolerance"]) for name in s.units] == given
    with pytest.raises(InvalidOptions) as refused:
        Master(s, replace(options, unit_tolerances={"silnt": 1e-5}))
    wording.check(refused.value)


def observed_from(start: Fraction, options: MasterOptions) -> dict[float, tuple[float, ...]]:
    """Run units at several rates, one of them sampled, for 2 s."""
    s = System()
    s.start = start
    s.add("mass", native_fmu("mass", 2), period=Fraction(1, 16), k=10.0, x0=1.0)
    s.add("ramp", native_fmu("integrator", 3), u=1.0, period=Fraction(1, 4))
    s.add("sampled", native_fmu("gain", 3), sampled=True, period=Fraction(1, 2))
    s.connect(PortName("mass", "x"), PortName("sampled", "u"))
    return observed_rows(s, start + 2, "mass.x", "ramp.x", "sampled.y", options=options)


@all_ways
def test_a_run_from_another_start_is_the_same_at_later_times(options: MasterOptions):
    expected = observed_from(Fraction(0), options)
    assert len(expected) > 4
    for start in (Fraction(10**6) + Fraction(1, 10), Fraction(-5, 3))[: 2 if options is OPTIONS["plan"] else 1]:
        found = observed_from(start, options)
        assert [*found] == [float(start + Fraction(t)) for t in expected]
        np.testing.assert_allclose([*found.values()], [*expected.values()], rtol=1e-9)


@pytest.mark.parametrize("fmi", [2, 3])
def test_units_are_given_the_start_and_inputs_follow_values_from_it_on(fmi: int):
    s = System()
    s.start = Fraction(5)
    s.add("clerk", native_fmu("clerk", fmi), period=Fraction(1, 2))
    passer = s.add("gain", native_fmu("gain", fmi), period=Fraction(1, 2))
    s.follow(passer.u.u, TimeSeries([0.0, 10.0], [[0.0], [20.0]], linear=True))
    seen = observed_rows(s, Fraction(6), "clerk.start", "clerk.now", "gain.y")
    assert seen == {5.0: (5.0, 5.0, 10.0), 5.5: (5.0, 5.5, 10.0), 6.0: (5.0, 6.0, 11.0)}


def test_a_start_that_is_not_exact_is_refused(wording: Wording):
    s = ramp()
    s.start = 0.1  # type: ignore[assignment]
    with pytest.raises(WiringError) as refused:
        s.check()
    wording.check(refused.value)


START = {
    2: ["Instantiate", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode"],
    3: ["InstantiateCoSimulation", "EnterInitializationMode", "ExitInitializationMode"],
}
LINEAR = Extrapolation.LINEAR


@pytest.mark.parametrize(
    "options",
    [
        *(MasterOptions(algorithm=a, compiled=False) for a in Algorithm),
        *(MasterOptions(algorithm=a, repeat_discarded=True) for a in (Algorithm.JACOBI, Algorithm.NEWTON)),
        MasterOptions(adaptive=AdaptiveStep(), extrapolation=LINEAR),
        MasterOptions(algorithm=Algorithm.FIXED_POINT, adaptive=AdaptiveStep(), extrapolation=LINEAR),
    ],
    ids=lambda o: f"{o.algorithm.value} {'adaptive' if o.adaptive else 'events' if o.repeat_discarded else 'grid'}",
)
def test_outputs_are_fetched_only_after_a_step_or_a_restored_state(options: MasterOptions):
    call_log = CallLog()
    with Master(oscillator(), options, call_log) as master:
        for stop in (0, Fraction(1, 8), Fraction(1, 8), Fraction(1, 5)):
            master.run(Fraction(stop))
    for unit, fmi in (("a", 2), ("b", 3), ("between", 3)):
        calls = [call.removeprefix(f"fmi{fmi}") for name, call in call_log.calls if name == unit]
        assert [c for c in calls if c in START[fmi]] == START[fmi]
        assert calls[-2:] == ["Terminate", "FreeInstance"]
        assert _faults(calls[calls.index("ExitInitializationMode") + 1 : -2]) == []


def _faults(calls: Sequence[str]) -> list[tuple[str, str]]:
    """Return where a Get directly follows a Set; SetFMUState cancels the inputs that were set before it."""
    entries = [c for c in calls if not c.startswith(("GetFMU", "FreeFMU"))]
    return [(a, b) for a, b in pairwise(entries) if a.startswith("Set") and a[:6] != "SetFMU" and b.startswith("Get")]
