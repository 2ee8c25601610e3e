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

OPTIONS = {
    "plan": MasterOptions(),
    "general path": MasterOptions(compiled=False),
    "plan, jacobi": MasterOptions(algorithm=Algorithm.JACOBI),
    "jacobi": MasterOptions(algorithm=Algorithm.JACOBI, compiled=False),
    "fixed-point": MasterOptions(algorithm=Algorithm.FIXED_POINT),
    "newton": MasterOptions(algorithm=Algorithm.NEWTON),
    "extrapolated": MasterOptions(extrapolation=Extrapolation.LINEAR),
    "events": MasterOptions(repeat_discarded=True),
    "adaptive": MasterOptions(adaptive=AdaptiveStep(initial=Fraction(1, 10), largest=Fraction(1, 10))),
}
OUT = "returned t = {} s as its last successful time, but its step went from 0.2 s to 0.3 s".format
FAULTS = {
    "returns_early": "returned early, at t = 0.25 s of a step to 0.3 s, which was not allowed",
    "returns_before": OUT(0.1),
    "returns_beyond": OUT(0.4),
    "returns_no_number": OUT("nan"),
}
CASES = [
    *((name, "plan") for name in FAULTS),
    *((list(FAULTS)[i % 4], path) for i, path in enumerate(OPTIONS) if i > 0),
    ("returns_early", "adaptive"),
    ("returns_before_in_events", "plan"),
    ("returns_beyond_in_events", "plan"),
]


@pytest.mark.parametrize(("name", "path"), CASES)
def test_such_a_return_fails_the_run(name: str, path: str, tmp_path: Path):
    s = System()
    bad, reader = s.add("bad", native_fmu(name, 3)), s.add("reader", native_fmu("integrator", 3), u=1.0)
    s.connect(bad.y.y, reader.u.u)
    s.connect(reader.y.x, bad.u.u)
    with (
        pytest.raises(InvalidReturn) as caught,
        Master(s, OPTIONS[path]) as master,
        Recorder(tmp_path / "r.parquet") as recorder,
    ):
        master.run(Fraction(1), [recorder])
    assert master.has_events == (path == "events" or name.endswith("in_events"))
    data = json.loads(json.dumps(caught.value.as_data(), allow_nan=False))
    assert (data["kind"], data["instance"], data["call"]) == ("invalid_return", "bad", "fmi3DoStep")
    if path != "adaptive":
        assert data["time"] == 0.2
        assert str(caught.value) == f"bad: fmi3DoStep at t = 0.2 s {FAULTS[name.removesuffix('_in_events')]}"
        assert Record(tmp_path / "r.parquet").time.tolist() == [0.0, 0.1, 0.2]


@pytest.mark.parametrize("path", ["plan", "general path", "events", "adaptive"])
def test_a_return_at_the_end_but_for_rounding_is_none(path: str):
    s = System()
    s.add("unit", native_fmu("returns_nearly", 3))
    with Master(s, OPTIONS[path]) as master:
        master.run(Fraction(1))
        assert math.isclose(float(master.signals["unit.y"]), 1.0)
