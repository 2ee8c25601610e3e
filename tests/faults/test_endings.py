"""A unit's request to end the simulation is an end: recorded to the time reached, alike in the plan and without it."""

from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.call_log import CallLog
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.failures import UnitTerminated
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

IN_TURN = pytest.mark.parametrize(("fmi", "algorithm"), [(2, Algorithm.JACOBI), (3, Algorithm.GAUSS_SEIDEL)])


def around(name: str, fmi: int, period: Fraction = Fraction(1, 10)) -> System:
    """Return a unit of 0.1 s with an integrator before it and one behind it in the order of steps, all y' = 1."""
    s = System()
    s.add("before", native_fmu("integrator", fmi), u=1.0)
    s.add("bad", native_fmu(name, fmi), period=period)
    s.add("after", native_fmu("integrator", fmi), u=1.0)
    return s


def run(
    system: System, options: MasterOptions, file: Path, *, observed: bool = False
) -> tuple[Record, UnitTerminated | None, list[tuple[float, float]], CallLog]:
    seen: list[tuple[float, float]] = []
    log = CallLog()

    def look(t: float, signals: Signals) -> None:
        seen.append((t, float(signals["bad.y"])))

    with Master(system, options, log) as master, Recorder(file) as recorder:
        assert isinstance(master.stepper, PlanStepper) == (options.compiled and options.adaptive is None)
        master.run(Fraction(1), [recorder, look] if observed else [recorder])
        if master.ended is not None:
            assert master.time == master.ended.reached
            with pytest.raises(RuntimeError, match=r"bad ended the simulation at t = .* s: make another master"):
                master.run(Fraction(2))
    return Record(file), master.ended, seen, log


@IN_TURN
def test_a_run_is_recorded_to_the_end_of_the_step_that_a_unit_completed(fmi: int, algorithm: Algorithm, tmp_path: Path):
    files: list[bytes] = []
    for i, (compiled, observed) in enumerate([(False, True), (True, True), (True, False)]):
        file = tmp_path / f"{i}.parquet"
        options = MasterOptions(algorithm=algorithm, compiled=compiled)
        record, ended, seen, log = run(around("ends", fmi), options, file, observed=observed)
        assert ended is not None
        assert (ended.unit, ended.call, ended.t, ended.reached) == ("bad", f"fmi{fmi}DoStep", 0.2, 0.3)
        assert ended.summary == "unit bad ended the simulation at t = 0.3 s"
        assert record.time.tolist() == [0.0, 0.1, 0.2, 0.3]
        for signal in ("before.x", "bad.y", "after.x"):
            assert record[signal].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
        assert [t for t, _ in seen] == ([0.0, 0.1, 0.2, 0.3] if observed else [])
        last = [call.removeprefix(f"fmi{fmi}") for unit, call in log.calls if unit == "bad"][-2:]
        assert last == ["Terminate", "FreeInstance"]
        files.append(file.read_bytes())
    assert files[0] == files[1] == files[2]


@IN_TURN
def test_a_run_is_recorded_to_the_time_within_a_step_at_which_a_unit_ended(
    fmi: int, algorithm: Algorithm, tmp_path: Path
):
    files: list[bytes] = []
    for compiled in (True, False):
        file = tmp_path / f"{compiled}.parquet"
        record, ended, _, _ = run(
            around("ends_within_step", fmi), MasterOptions(algorithm=algorithm, compiled=compiled), file
        )
        assert ended is not None
        assert (ended.t, ended.reached) == (0.2, 0.25)
        assert record.time.tolist() == [0.0, 0.1, 0.2, 0.25]
        assert record["bad.y"].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.25])
        before = 0.3 if algorithm is Algorithm.GAUSS_SEIDEL else 0.2  # as the docstring of Master.run says
        assert [record["before.x"][-1], record["after.x"][-1]] == pytest.approx([before, 0.2])
        files.append(file.read_bytes())
    assert files[0] == files[1]


@pytest.mark.parametrize(("fmi", "compiled"), [(2, True), (3, False)])
def test_of_two_requests_the_first_counts_and_a_unit_that_is_already_farther_keeps_the_signals_of_that_time(
    fmi: int, compiled: bool, tmp_path: Path
):
    s = around("ends", fmi)
    s.add("second", native_fmu("ends", fmi))
    s.add("last", native_fmu("integrator", fmi), u=1.0)
    s.add("slow", native_fmu("integrator", fmi), u=1.0, period=Fraction(1, 2))
    record, ended, _, _ = run(s, MasterOptions(compiled=compiled), tmp_path / "r.parquet")
    assert ended is not None
    assert ended.unit == "bad"
    assert record.time[-1] == 0.3
    for signal in ("second.y", "last.x"):
        assert record[signal][-1] == pytest.approx(0.3)
    assert not record["slow.x"].any()  # its first step leads to 0.5 s


PATHS = {
    "fixed-point": MasterOptions(algorithm=Algorithm.FIXED_POINT, compiled=False),
    "newton": MasterOptions(algorithm=Algorithm.NEWTON, compiled=False),
    "events": MasterOptions(repeat_discarded=True, compiled=False),
    "adaptive": MasterOptions(adaptive=AdaptiveStep(initial=Fraction(1, 10), largest=Fraction(1, 10))),
}


@pytest.mark.parametrize(("path", "fmi"), [(path, 2 + i % 2) for i, path in enumerate(PATHS)])
def test_a_run_of_any_kind_ends_so(path: str, fmi: int, tmp_path: Path):
    s = around("ends", fmi)
    s.connect(s.units["before"].y.x, s.units["bad"].u.u)
    record, ended, _, _ = run(s, PATHS[path], tmp_path / "r.parquet")
    assert ended is not None
    assert record.time[-1] == ended.reached
    assert 0.25 < ended.reached <= 0.3 + 1e-12
    assert all(record.time[1:] > record.time[:-1])


def test_a_unit_ends_the_simulation_at_an_event(tmp_path: Path):
    s = around("ends_at_event", 3)
    record, ended, _, _ = run(s, MasterOptions(compiled=False), tmp_path / "r.parquet")
    assert ended is not None
    assert (ended.call, ended.reached) == ("fmi3UpdateDiscreteStates", 0.25)
    assert record.time.tolist() == [0.0, 0.1, 0.2, 0.25]
    for signal in ("before.x", "bad.y", "after.x"):  # the others are brought to the event
        assert record[signal].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.25])
