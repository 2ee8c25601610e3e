"""Outputs that feed nothing and are NaN or infinite: the run goes on, and its end tells them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.commands import call, data_in
from support.cosim.native_units import native_fmu

import handover
from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.runs.results.output_faults import (
    MAX_LINES,
    not_finite_lines,
    out_of_range_lines,
    outputs_not_finite,
    outputs_out_of_range,
)

NAN_LINE = "unit gives_nan: y = NaN at t = 0.3 s, which no unit reads"


@pytest.mark.parametrize(("fmi", "coupling"), [(2, ()), (3, ("--algorithm", "fixed-point"))])
def test_a_run_ends_with_a_line_and_goes_on_until_then(tmp_path: Path, fmi: int, coupling: tuple[str, ...]):
    given = ("--stop", "1", "--no-report", "--out", tmp_path / "r")
    result = call("run", native_fmu("gives_nan", fmi), *given, *coupling)
    assert result.exit_code == 0, result.output
    assert NAN_LINE in result.output.splitlines()
    summary = data_in(tmp_path / "r")
    assert summary["complete"]
    (reported,) = summary["not_finite"]
    assert (reported["instance"], reported["output"], reported["value"]) == ("gives_nan", "y", "NaN")
    assert reported["time"] == pytest.approx(0.3)
    y, metrics = Record(tmp_path / "r" / "signals.parquet")["gives_nan.y"], summary["metrics"]
    finite = y[np.isfinite(y)]
    assert [metrics[name]["value"] for name in ("min_y", "max_y")] == [finite.min(), finite.max()]
    assert metrics["last_y"]["value"] == (float(y[-1]) if np.isfinite(y[-1]) else None)
    assert ("not a number" in metrics["last_y"]["description"]) == np.isnan(y[-1])


def test_page_and_result_have_the_line(tmp_path: Path):
    ran = handover.run(native_fmu("gives_infinity", 3), stop=1, out=tmp_path / "r")
    line = "unit gives_infinity: y = -infinity at t = 0.3 s, which no unit reads"
    assert ran.warnings == (line,)
    ran.report()
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert line in page.replace("\u202f", " ").replace("\u00a0", " ")


def test_a_run_with_finite_outputs_tells_nothing(tmp_path: Path):
    result = call("run", native_fmu("gives_nan", 3), "--stop", "0.2", "--no-report", "--out", tmp_path / "r")
    assert result.exit_code == 0, result.output
    assert "no unit reads" not in result.output
    assert "not_finite" not in data_in(tmp_path / "r")


def test_outputs_beyond_their_range_are_named_with_the_first_time(tmp_path: Path):
    d, wired = describe_fmu(native_fmu("gain", 3)), System()
    y = d.outputs["y"]
    limited = {f"y{n}": replace(y, name=f"y{n}", minimum=0.0, maximum=1.0) for n in range(MAX_LINES + 3)}
    limited["n"] = replace(y, name="n", kind=Kind.INTEGER, minimum=None, maximum=3.0)
    limited["p"] = replace(y, name="p", shape=(2,), minimum=-1.0)
    wired.add("a", replace(d, outputs=limited))
    time = [0.0, 0.1, 0.2, 0.3]
    columns = {f"a.{name}": [0.0, float("inf"), 1.5, -2.0] for name in limited if name[0] == "y"}
    more = {"a.n": [0.0, 3.0, 4.0, 0.0], "a.p[1]": [0.0, 0.0, 0.0, -3.0], "a.p[2]": [0.0, -2.0, 0.0, 0.0]}
    file = tmp_path / "signals.parquet"
    found = outputs_out_of_range(record(file, time=time, **columns, **more), wired)
    assert [(f["value"], f["time"]) for f in found] == [(1.5, 0.2)] * (MAX_LINES + 3) + [(4.0, 0.2), (-2.0, 0.1)]
    assert found[-1]["index"] == "[2]"
    lines = out_of_range_lines(found)
    assert lines[0] == "unit a: y0 = 1.5 at t = 0.2 s, beyond its range, from 0 to 1"
    assert (len(lines), lines[-1].partition(":")[0]) == (MAX_LINES + 1, "5 more outputs go beyond the declared range")
    rounded = record(file, time=[0.0, 0.1], **{"a.y0": [-1e-17, float(np.float32(1.0000001))], "a.n": [3.0, -9.0]})
    assert outputs_out_of_range(rounded, wired) == []


def record(file: Path, **columns: list[float]) -> Path:
    pq.write_table(pa.Table.from_arrays([pa.array(v, pa.float64()) for v in columns.values()], list(columns)), file)
    return file


def test_of_an_array_the_first_entry_is_named_and_the_others_counted(tmp_path: Path):
    wired = System()
    for name in ("a", "a.b"):  # as of a nested system
        wired.add(name, native_fmu("gives_nan", 3))
    wired.connect(wired.units["a"].y.y, wired.units["a.b"].u.u)
    nan, inf = float("nan"), float("inf")
    file = record(
        tmp_path / "signals.parquet",
        **{"time": [0.0, 0.1, 0.2], "a.y": [0.0, 0.0, inf], "a.fine": [1.0, 2.0, 3.0]},
        **{"a.b.p[1]": [0.0, 0.0, nan], "a.b.p[2]": [0.0, nan, 0.0], "a.b.p[3]": [0.0, 0.0, 0.0]},
    )
    assert not_finite_lines(outputs_not_finite(file, wired)) == [
        "unit a: y = infinity at t = 0.2 s, which feeds a unit, though no step followed",
        "unit a.b: p[2] = NaN at t = 0.1 s (another entry too), which no unit reads",
    ]
    columns = {f"a.y{n}": [float("nan")] for n in range(MAX_LINES + 3)}
    lines = not_finite_lines(outputs_not_finite(record(file, time=[0.0], **columns), wired))
    assert len(lines) == MAX_LINES + 1  # a long list is shortened
    assert lines[-1].startswith("3 more outputs are not finite")
