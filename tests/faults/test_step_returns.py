"""A step of FMI 3 that returns early though that is not allowed, or with a time out of the step, fails the run."""

import json
import math
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.failures import InvalidReturn
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System

FIXED = {
    "plan": MasterOptions(),
    "plan, jacobi": MasterOptions(algorithm=Algorithm.JACOBI),
    "general path": MasterOptions(compiled=False),
    "jacobi": MasterOptions(algorithm=Algorithm.JACOBI, compiled=False),
    "fixed-point": MasterOptions(algorithm=Algorithm.FIXED_POINT),
    "newton": MasterOptions(algorithm=Algorithm.NEWTON),
    "extrapolated": MasterOptions(extrapolation=Extrapolation.LINEAR),
    "events": MasterOptions(repeat_discarded=True),
}
CONTROL = AdaptiveStep(initial=Fraction(1, 10), largest=Fraction(1, 10))
OPTIONS = {**FIXED, "adaptive": MasterOptions(adaptive=CONTROL)}
FAULTS = {
    "returns_early": "returned early, at t = {half} s of a step to {end} s, which was not allowed",
    "returns_before": "returned t = {before} s as its last successful time, but its step went from {t} s to {end} s",
    "returns_beyond": "returned t = {beyond} s as its last successful time, but its step went from {t} s to {end} s",
    "returns_no_number": "returned t = nan s as its last successful time, but its step went from {t} s to {end} s",
}


def with_reader(name: str) -> System:
    """Return a unit and an integrator in a cycle."""
    s = System()
    bad, reader = s.add("bad", native_fmu(name, 3)), s.add("reader", native_fmu("integrator", 3), u=1.0)
    s.connect(bad.y.y, reader.u.u)
    s.connect(reader.y.x, bad.u.u)
    return s


@pytest.mark.parametrize("path", FIXED)
@pytest.mark.parametrize("name", FAULTS)
def test_such_a_return_fails_the_run(name: str, path: str, tmp_path: Path):
    with (
        pytest.raises(InvalidReturn) as caught,
        Master(with_reader(name), FIXED[path]) as master,
        Recorder(tmp_path / "r.parquet") as recorder,
    ):
        master.run(Fraction(1), [recorder])
    fault = FAULTS[name].format(t=0.2, end=0.3, half=0.25, before=0.1, beyond=0.4)
    assert str(caught.value) == f"bad: fmi3DoStep at t = 0.2 s {fault}"
    data = json.loads(json.dumps(caught.value.as_data(), allow_nan=False))
    assert (data["kind"], data["instance"], data["call"], data["time"]) == ("invalid_return", "bad", "fmi3DoStep", 0.2)
    assert Record(tmp_path / "r.parquet").time.tolist() == [0.0, 0.1, 0.2]


@pytest.mark.parametrize("name", FAULTS)
def test_such_a_return_fails_a_run_of_adaptive_steps(name: str):
    with (
        pytest.raises(InvalidReturn, match=r"bad: fmi3DoStep at t = "),
        Master(with_reader(name), OPTIONS["adaptive"]) as master,
    ):
        master.run(Fraction(1))


@pytest.mark.parametrize("name", ["returns_before_in_events", "returns_beyond_in_events"])
def test_such_a_return_fails_a_unit_that_may_return_early(name: str):
    with (
        pytest.raises(InvalidReturn, match=r"bad: fmi3DoStep at t = 0\.2 s returned t = 0\.[14] s"),
        Master(with_reader(name)) as master,
    ):
        master.run(Fraction(1))
    assert master.has_events


@pytest.mark.parametrize("path", OPTIONS)
def test_a_return_at_the_end_but_for_rounding_is_none(path: str):
    s = System()
    s.add("unit", native_fmu("returns_nearly", 3))
    with Master(s, OPTIONS[path]) as master:
        master.run(Fraction(1))
        assert math.isclose(float(master.signals["unit.y"]), 1.0)
