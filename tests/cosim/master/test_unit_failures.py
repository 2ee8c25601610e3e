"""A failure says what happened as a type, in words and as data; the record ends at the last good step."""

import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.call_log import CallLog, fed_by
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import InitializationError, UnitFailure
from handover.cosim.fmu.failures import (
    NotFinite,
    UnitCrashed,
    UnitDiscarded,
    UnitError,
    UnitFatal,
    UnitHung,
    UnitTerminated,
)
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System


@pytest.mark.parametrize(("fmi", "compiled"), [(2, False), (3, False)])
@pytest.mark.parametrize(
    ("bad", "kind", "facts", "left"),
    [
        ("errs", UnitError, {"status": "Error", "log": ["[Error] the solver failed at t = 0.2"]}, ["FreeInstance"]),
        ("fatal", UnitFatal, {"status": "Fatal", "log": ["[Fatal] memory is corrupt at t = 0.2"]}, []),
        ("gives_nan", NotFinite, {"port": "y", "value": "NaN"}, ["Terminate", "FreeInstance"]),
        ("gives_infinity", NotFinite, {"port": "y", "value": "-infinity"}, ["Terminate", "FreeInstance"]),
    ],
)
def test_it_is_reported_and_units_are_ended_as_the_standard_has_it(
    bad: str, kind: type[UnitFailure], facts: dict[str, Any], left: list[str], fmi: int, compiled: bool,
    tmp_path: Path, wording: Wording,
):  # fmt: skip
    call_log, system, options = CallLog(), fed_by(native_fmu(bad, fmi), fmi), MasterOptions(compiled=compiled)
    with (
        pytest.raises(UnitFailure) as caught,
        Master(system, options, call_log) as master,
        Recorder(tmp_path / "r.parquet") as recorder,
    ):
        master.run(Fraction(1), [recorder])
    assert type(caught.value) is kind
    if not compiled:
        wording.check(caught.value)
    get = "fmi2GetReal" if fmi == 2 else "fmi3GetFloat64"
    call, time = (get, 0.3) if kind is NotFinite else (f"fmi{fmi}DoStep", 0.2)
    data = caught.value.as_data()
    expected = {"kind": kind.kind, "instance": "bad", "call": call, "time": pytest.approx(time), **facts}
    assert {name: data[name] for name in expected} == expected
    assert json.loads(json.dumps(data)) == data
    record = Record(tmp_path / "r.parquet")
    assert record.time.tolist() == [0.0, 0.1, 0.2]
    assert np.isfinite(record["bad.y"]).all()
    if kind is NotFinite and not compiled:  # found before it feeds anybody
        assert call_log.after("reader", call, "bad") == [f"fmi{fmi}Terminate", f"fmi{fmi}FreeInstance"]
    ends = [(unit, name) for unit, name in call_log.calls if name.endswith(("Terminate", "FreeInstance"))]
    for unit, names in (
        ("source", ["Terminate", "FreeInstance"]),
        ("bad", left),
        ("reader", ["Terminate", "FreeInstance"]),
    ):
        assert [c for u, c in ends if u == unit] == [f"fmi{fmi}{name}" for name in names]


def test_after_fatal_no_instance_of_the_same_fmu_is_called():
    system, call_log = fed_by(native_fmu("fatal"), 3), CallLog()
    system.add("sibling", native_fmu("fatal"), at=1e9)
    with pytest.raises(UnitFatal), Master(system, MasterOptions(), call_log) as master:
        master.run(Fraction(1))
    at = call_log.calls.index(("source", "fmi3Terminate"))
    assert {unit for unit, _ in call_log.calls[at:]} == {"source", "reader"}


def test_a_unit_that_gives_infinity_as_it_is_initialised_is_refused(wording: Wording):
    s, call_log = System(), CallLog()
    source = s.add("source", native_fmu("sine"), a=1e308, phase=math.pi / 2, b=1e308)
    s.connect(source.y.y, s.add("reader", native_fmu("integrator")).u.u)
    with pytest.raises(InitializationError) as caught, Master(s, heartbeat=call_log):
        pass
    wording.check(caught.value)
    assert isinstance(caught.value.failure, NotFinite)
    assert [call for _, call in call_log.calls][-2:] == ["fmi3FreeInstance"] * 2


def test_every_failure_has_a_kind_of_its_own_and_its_data(wording: Wording):
    made: list[UnitFailure] = [
        UnitError("u", "fmi3DoStep", 1.0, "Error"),
        UnitFatal("u", "fmi3DoStep", 1.0, "Fatal"),
        UnitDiscarded("u", "fmi2DoStep", 1.0, ["no"], reached=1.25),
        NotFinite("u", "fmi3GetFloat64", 1.0, "p", (2, 3), float("inf"), readers=["v.x", "w.x"]),
        UnitTerminated("u", "fmi3DoStep", 1.0),
        UnitHung("u", "fmi3DoStep", 1.0, 2.5),
        UnitCrashed("u", "fmi3DoStep", 1.0, "segmentation fault"),
    ]
    for failure in made:
        wording.check(failure)
    data: list[dict[str, Any]] = [f.as_data() for f in made]
    assert len({d["kind"] for d in data}) == len(made)
    assert data[2]["last_successful_time"] == 1.25
    assert (data[3]["port"], data[3]["element"], data[3]["value"]) == ("p", [2, 3], "infinity")
    assert json.dumps(data, allow_nan=False)
