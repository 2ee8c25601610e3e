"""Tables of inputs over time: values, kinds, and that no text raises anything but one error."""

import contextlib
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.wording import Wording

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.input_file import read_inputs

INPUTS = {
    p.name: p
    for p in (
        FmuPort(name="x", kind=Kind.REAL, causality=Causality.INPUT, fmi_type="Float64", references=(1,), start="2.5"),
        FmuPort(name="g", kind=Kind.ENUMERATION, causality=Causality.INPUT, fmi_type="Enumeration", references=(2,),
                items=(("PARK", 1), ("DRIVE", 4)), start="1"),
        FmuPort(name="n", kind=Kind.INTEGER, causality=Causality.INPUT, fmi_type="Int8", references=(3,),
                width=Width("Int8"), minimum=-5),
        FmuPort(name="R", kind=Kind.REAL, causality=Causality.INPUT, fmi_type="Float64", references=(4,), shape=(2, 2),
                start="1 2 3 4"),
        FmuPort(name="b", kind=Kind.INTEGER, causality=Causality.INPUT, fmi_type="UInt64", references=(6,),
                width=Width("UInt64")),
        FmuPort(name="s", kind=Kind.STRING, causality=Causality.INPUT, fmi_type="String", references=(5,)),
    )
}  # fmt: skip


def test_each_kind_is_read_and_entries_without_a_column_keep_their_start(tmp_path: Path):
    table = tmp_path / "inputs.csv"
    table.write_text(
        'time, "g",n,"R[2,1]",b\n\n0,drive,-5,30,1\n1.5,1,7,40,18446744073709551615\n', encoding="utf-8-sig"
    )
    series = read_inputs(table, INPUTS, {"R": [[9.0, 8.0], [7.0, 6.0]]}).series
    assert set(series) == {"g", "n", "R", "b"}
    assert series["b"].at(2.0).tolist() == [2**64 - 1]
    assert [series["g"].at(t).tolist() for t in (0.0, 1.4, 1.5)] == [[4], [4], [1]]
    assert [series["n"].at(t).tolist() for t in (0.0, 9.0)] == [[-5], [7]]
    assert series["R"].linear
    assert series["R"].at(0.75).tolist() == [9.0, 8.0, 35.0, 6.0]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time,x\n",
        "x\n0\n",
        "time\n0\n1\n",
        "time;x\n0,5;0\n",
        "time,force\n0,1\n",
        "time,x,x\n0,1,1\n",
        "time,x\n0,1\n0.2,1\n0.1,1\n",
        "time,x\n0,1\nsoon,one\n",
        "time,x\n0,1\n1,nan\n",
        "time,x\n0,1\n1\n",
        'time,x\n0,"1\n',
        "time,R\n0,1\n",
        "time,s\n0,a\n",
        "time,g\n0,reverse\n",
        "time,n\n0,1.5\n",
        "time,n\n0,-6\n",
        "time,n\n0,200\n",
        "time,x\n0,1\n0,2\n" + "0,a\n" * 9,
    ],
    ids=repr,
)
def test_what_is_no_table_or_does_not_fit_an_input_is_reported(tmp_path: Path, text: str, wording: Wording):
    table = tmp_path / "inputs.csv"
    table.write_text(text)
    with pytest.raises(UsageError) as raised:
        read_inputs(table, INPUTS, {})
    wording.check(raised.value)


def test_a_start_value_that_the_table_replaces_is_a_fault(tmp_path: Path):
    table = tmp_path / "inputs.csv"
    table.write_text('time,x,"R[1,1]"\n0,1,2\n')
    read = read_inputs(table, INPUTS, {})
    assert [len(read.faults(INPUTS, [name])) for name in ("x", "R[1,1]", "R", "R[1,2]", "n")] == [1, 1, 0, 0, 0]
    table.write_text('time,"R[1,1]","R[1,2]","R[2,1]","R[2,2]"\n0,1,2,3,4\n')
    assert len(read_inputs(table, INPUTS, {}).faults(INPUTS, ["R"])) == 1


@pytest.mark.parametrize(
    ("times", "lines"), [((0, 1), 0), ((5, 6), 1), ((2, 3), 1), ((-3, -2), 1), ((-3, 0), 1), ((-3, 9), 0), ((7,), 0)]
)
def test_a_table_none_of_whose_times_are_in_the_run_is_reported(tmp_path: Path, times: Sequence[float], lines: int):
    table = tmp_path / "inputs.csv"
    table.write_text("time,x\n" + "".join(f"{t},1\n" for t in times))
    assert len(read_inputs(table, INPUTS, {}).notes(0.0, 2.0)) == lines


@settings(max_examples=150)
@given(st.text(alphabet='time,xg01.e-+\n"R[]; \r', max_size=60) | st.binary(max_size=40))
def test_whatever_is_in_the_file_there_is_one_line_of_error(
    tmp_path_factory: pytest.TempPathFactory, text: str | bytes
):
    table = tmp_path_factory.getbasetemp() / "fuzzed.csv"
    table.write_bytes(text if isinstance(text, bytes) else ("time,x\n" + text).encode())
    with contextlib.suppress(UsageError):
        read_inputs(table, INPUTS, {})
