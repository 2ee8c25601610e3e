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

COMPILED = pytest.mark.parametrize("compiled", [False, True], ids=["general", "compiled"])


def failed(bad: str, fmi: int, record: Path, *, compiled: bool) -> tuple[UnitFailure, CallLog]:
    call_log, system, options = CallLog(), fed_by(native_fmu(bad, fmi), fmi), MasterOptions(compiled=compiled)
    with (
        pytest.raises(UnitFailure) as caught,
        Master(system, options, call_log) as master,
        Recorder(record) as recorder,
    ):
        master.run(Fraction(1), [recorder])
    return caught.value, call_log


@COMPILED
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("bad", "kind", "text", "line"),
    [
        ("errs", UnitError, "bad: fmi{0}DoStep at t = 0.2 s answered Error", "the solver failed at t = 0.2"),
        ("fatal", UnitFatal, "bad: fmi{0}DoStep at t = 0.2 s answered Fatal", "memory is corrupt at t = 0.2"),
    ],
)
def test_an_answer_of_error_is_reported_with_call_time_and_log(
    bad: str, kind: type, text: str, line: str, fmi: int, compiled: bool, tmp_path: Path
):
    failure, _ = failed(bad, fmi, tmp_path / "r.parquet", compiled=compiled)
    assert type(failure) is kind
    assert failure.headline == text.format(fmi)
    assert line in str(failure)
    data = failure.as_data()
    assert data == {
        "kind": kind.kind,
        "instance": "bad",
        "call": f"fmi{fmi}DoStep",
        "time": 0.2,
        "status": {"errs": "Error", "fatal": "Fatal"}[bad],
        "log": [f"[{data['status']}] {line}"],
    }
    assert json.loads(json.dumps(data)) == data
    assert Record(tmp_path / "r.parquet").time.tolist() == [0.0, 0.1, 0.2]


@COMPILED
@pytest.mark.parametrize(("bad", "value"), [("gives_nan", "NaN"), ("gives_infinity", "-infinity")])
@pytest.mark.parametrize(("fmi", "call"), [(2, "fmi2GetReal"), (3, "fmi3GetFloat64")])
def test_nan_and_infinity_are_found_before_they_feed_or_are_recorded(
    bad: str, value: str, fmi: int, call: str, compiled: bool, tmp_path: Path
):
    failure, call_log = failed(bad, fmi, tmp_path / "r.parquet", compiled=compiled)
    assert isinstance(failure, NotFinite)
    assert failure.headline == f"bad: {call} at t = 0.3 s gave y = {value}, which feeds reader.u"
    assert (failure.port, failure.index, failure.as_data()["value"]) == ("y", (), value)
    assert not np.isfinite(failure.value)
    record = Record(tmp_path / "r.parquet")
    assert record.time.tolist() == [0.0, 0.1, 0.2]
    assert np.isfinite(record["bad.y"]).all()
    if not compiled:
        assert call_log.after("reader", call, "bad") == [f"fmi{fmi}Terminate", f"fmi{fmi}FreeInstance"]


@COMPILED
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("bad", "left"), [("errs", ["FreeInstance"]), ("fatal", []), ("gives_nan", ["Terminate", "FreeInstance"])]
)
def test_the_others_are_terminated_and_freed_and_the_failed_one_as_the_standard_has_it(
    bad: str, left: list[str], fmi: int, compiled: bool, tmp_path: Path
):
    _, call_log = failed(bad, fmi, tmp_path / "r.parquet", compiled=compiled)
    ends = [(unit, call) for unit, call in call_log.calls if call.endswith(("Terminate", "FreeInstance"))]
    for unit in ("source", "reader"):
        assert [c for u, c in ends if u == unit] == [f"fmi{fmi}Terminate", f"fmi{fmi}FreeInstance"]
    assert [c for u, c in ends if u == "bad"] == [f"fmi{fmi}{name}" for name in left]


@COMPILED
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_that_is_discarded_is_reported_and_the_unit_terminated(fmi: int, compiled: bool):
    s, call_log = System(), CallLog()
    s.add("bad", native_fmu("discards", fmi), period=Fraction(1, 10))
    with pytest.raises(UnitDiscarded) as caught, Master(s, MasterOptions(compiled=compiled), call_log) as master:
        master.run(Fraction(1))
    assert caught.value.headline.startswith(f"bad: fmi{fmi}DoStep at t = 0 s answered Discard")
    assert "a step of 0.1 s is longer than 0.04 s" in str(caught.value)
    assert [call for _, call in call_log.calls][-2:] == [f"fmi{fmi}Terminate", f"fmi{fmi}FreeInstance"]


@pytest.mark.parametrize("fmi", [2, 3])
def test_after_fatal_no_instance_of_the_same_fmu_is_called(fmi: int):
    system, call_log = fed_by(native_fmu("fatal", fmi), fmi), CallLog()
    system.add("sibling", native_fmu("fatal", fmi), at=1e9)
    with pytest.raises(UnitFatal), Master(system, MasterOptions(), call_log) as master:
        master.run(Fraction(1))
    at = call_log.calls.index(("source", f"fmi{fmi}Terminate"))
    assert {unit for unit, _ in call_log.calls[at:]} == {"source", "reader"}


def test_numbers_that_feed_nobody_may_be_what_they_are(tmp_path: Path):
    system = fed_by(native_fmu("gain"), 3)
    system.add("alone", native_fmu("gives_nan"))
    with Master(system) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(1), [recorder])
    assert np.isnan(Record(tmp_path / "r.parquet")["alone.y"]).any()


def test_a_unit_that_gives_infinity_as_it_is_initialised_is_refused():
    s, call_log = System(), CallLog()
    source, reader = (
        s.add("source", native_fmu("sine"), a=1e308, phase=math.pi / 2, b=1e308),
        s.add("reader", native_fmu("integrator")),
    )
    s.connect(source.y.y, reader.u.u)
    with (
        pytest.raises(InitializationError, match=r"source does not start: y = infinity") as caught,
        Master(s, heartbeat=call_log),
    ):
        pass
    assert isinstance(caught.value.failure, NotFinite)
    assert [call for _, call in call_log.calls][-2:] == ["fmi3FreeInstance"] * 2


def test_every_failure_has_a_kind_of_its_own_and_its_data():
    made: list[UnitFailure] = [
        UnitError("u", "fmi3DoStep", 1.0, "Error"),
        UnitFatal("u", "fmi3DoStep", 1.0, "Fatal"),
        UnitDiscarded("u", "fmi2DoStep", 1.0, ["no"], reached=1.25),
        NotFinite("u", "fmi3GetFloat64", 1.0, "p", (2, 3), float("inf"), readers=["v.x", "w.x"]),
        UnitTerminated("u", "fmi3DoStep", 1.0),
        UnitHung("u", "fmi3DoStep", 1.0, 2.5),
        UnitCrashed("u", "fmi3DoStep", 1.0, "segmentation fault"),
    ]
    assert [str(f).splitlines()[0] for f in made] == [
        "u: fmi3DoStep at t = 1 s answered Error",
        "u: fmi3DoStep at t = 1 s answered Fatal",
        "u: fmi2DoStep at t = 1 s answered Discard, having reached t = 1.25 s",
        "u: fmi3GetFloat64 at t = 1 s gave p[2,3] = infinity, which feeds v.x, w.x",
        "u: fmi3DoStep at t = 1 s asked to end the simulation",
        "u: fmi3DoStep at t = 1 s did not return within 2.5 s",
        "unit u crashed in fmi3DoStep at t = 1 s: segmentation fault",
    ]
    data: list[dict[str, Any]] = [f.as_data() for f in made]
    assert len({d["kind"] for d in data}) == len(made)
    assert data[2]["last_successful_time"] == 1.25
    assert (data[3]["port"], data[3]["element"], data[3]["value"]) == ("p", [2, 3], "infinity")
    assert json.dumps(data, allow_nan=False)
