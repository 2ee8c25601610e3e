"""What others see of a unit with every width of numbers: its model description, FMPy, our own master."""

import xml.etree.ElementTree as ET
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pyarrow.parquet as pq
import pytest
from fmpy.validation import validate_fmu
from support.fmus.workshop import Workshop

from handover.cosim.exceptions import InitializationError, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.system import System

BLOCK = "every_width:EveryWidth"

WIDTHS = [f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]


def port_of(width: str) -> str:
    return width.lower().replace("uint", "u").replace("int", "i")


def test_fmi_3_names_types_bounds_and_starts(workshop: Workshop):
    assert validate_fmu(str(workshop.fmu(BLOCK, 3))) == []
    variables = declared(workshop.fmu(BLOCK, 3), "ModelVariables/*")
    types = {name: v.tag for name, v in variables.items()}
    assert types["x"] == types["v"] == types["stretch"] == types["v_out"] == "Float32"
    assert {width: types[port_of(width)] for width in WIDTHS} == {width: width for width in WIDTHS}
    assert {width: types[f"{port_of(width)}_out"] for width in WIDTHS} == {width: width for width in WIDTHS}
    assert limits_of(variables["i8"]) == {"min": "-128", "max": "127", "start": "-128"}
    assert limits_of(variables["u64"]) == {"max": str(2**64 - 1), "start": "11"}
    assert np.float32(limits_of(variables["stretch"])["start"]) == np.float32(0.1)
    assert [np.float32(entry) for entry in limits_of(variables["v"])["start"].split()] == list(
        np.array([0.1, 0.2, 0.3], dtype=np.float32)
    )


def test_fmi_2_says_the_range_of_narrow_integers_by_min_and_max(workshop: Workshop):
    assert validate_fmu(str(workshop.fmu(BLOCK, 2))) == []
    variables = declared(workshop.fmu(BLOCK, 2), "ModelVariables/ScalarVariable")
    limits = {name: limits_of(v[0]) for name, v in variables.items()}
    assert variables["x"][0].tag == variables["v[2]"][0].tag == "Real"
    assert {variables[port_of(width)][0].tag for width in WIDTHS} == {"Integer"}
    assert limits["u16"] == {"min": "0", "max": "65535", "start": "65535"}
    assert limits["i8_out"] == {"min": "-128", "max": "127"}
    assert limits["u32"] == {"min": "0", "start": "7"}
    assert limits["i32"] == {"start": str(-(2**31))}
    assert limits["i64"] == {"start": "9"}
    assert limits["shift"] == {"min": "-300", "max": "300", "start": "0"}


def declared(fmu: Path, path: str) -> dict[str, ET.Element]:
    with zipfile.ZipFile(fmu) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    return {v.attrib["name"]: v for v in root.findall(path)}


def limits_of(element: ET.Element) -> dict[str, str]:
    return {name: element.attrib[name] for name in ("min", "max", "start") if name in element.attrib}


def test_the_page_says_widths(workshop: Workshop):
    with zipfile.ZipFile(workshop.fmu(BLOCK, 3)) as archive:
        page = archive.read("documentation/index.html").decode()
    assert "<code>x</code></td><td>Float32</td>" in page
    assert "<code>i16_out</code></td><td>Int16</td>" in page
    assert "<code>i64</code></td><td>Int64</td>" in page


@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpys_own_simulation_runs_with_every_width(workshop: Workshop, fmi: int):
    outputs = [f"{port_of(width)}_out" for width in WIDTHS] + ["x_out"]
    start = {"i8": -5, "u16": 40000, "u64": 2**40, "x": 0.25} if fmi == 3 else {"i8": -5, "u16": 40000, "x": 0.25}
    result = fmpy.simulate_fmu(str(workshop.fmu(BLOCK, fmi)), stop_time=0.3, start_values=start, output=outputs)
    last = {name: result[name][-1] for name in outputs}
    assert last["i8_out"] == -5
    assert last["u16_out"] == 40000
    assert last["u64_out"] == (2**40 if fmi == 3 else 11)
    assert last["x_out"] == pytest.approx(0.025, rel=1e-7)


def told_by_second(workshop: Workshop, fmi: int, *, scalar: bool = False, **start: Any) -> str:
    """What the second of two units sees whose inputs are the first one's outputs."""
    s = System()
    fmu = workshop.fmu(BLOCK, fmi) if not scalar else workshop.scalar_fmu(BLOCK)
    first, second = s.add("first", workshop.fmu(BLOCK, 3), **start), s.add("second", fmu)
    for name in ("x", "v", *(port_of(width) for width in WIDTHS)):
        s.connect(getattr(first.y, f"{name}_out"), getattr(second.u, name))
    seen: list[str] = []
    with Master(s) as master:
        master.run(Fraction(1, 10), [lambda t, y: seen.append(y.text("second.told"))])  # noqa: ARG005
    return seen[-1]


@pytest.mark.parametrize("fmi", [2, 3])
def test_our_own_master_wires_every_width(workshop: Workshop, fmi: int):
    v = np.array([0.5, 0.1, -2.0], dtype=np.float32)
    seen = told_by_second(
        workshop, fmi, x=1.0, v=v, i8=100, u8=200, i16=300, u16=50000, i32=-70000, u32=80000, i64=5, u64=6
    )
    assert seen == repr(
        (float(np.float32(0.1)), (2.0 * v.astype(float)).tolist(), 100, 200, 300, 50000, -70000, 80000, 5, 6)
    )


def test_our_own_master_wires_the_scalar_form_too(workshop: Workshop):
    assert told_by_second(workshop, 3, scalar=True, u64=2**64 - 1) == told_by_second(workshop, 3, u64=2**64 - 1)


@pytest.mark.parametrize(
    ("start", "told"),
    [
        ({"i8": 128}, "128 is out of range: from -128 to 127"),
        ({"u8": -1}, "-1 does not fit UInt8 (from 0 to 255)"),
        ({"u64": 2**64}, "does not fit UInt64 (from 0 to 18446744073709551615)"),
        ({"x": 1e39}, "1e+39 does not fit Float32"),
    ],
)
def test_our_own_master_refuses_start_values_that_do_not_fit(workshop: Workshop, start: dict[str, Any], told: str):
    with pytest.raises(WiringError) as raised:
        told_by_second(workshop, 3, **start)
    assert told in str(raised.value)


def test_our_own_master_lets_no_number_lose_its_upper_bits(workshop: Workshop):
    s = System()
    first, second = s.add("first", workshop.fmu(BLOCK, 3), i64=300), s.add("second", workshop.fmu(BLOCK, 3))
    s.connect(first.y.i64_out, second.u.u8)
    with pytest.raises(InitializationError, match=r"first\.i64_out is 300, which does not fit UInt8 \(from 0 to 255\)"):
        Master(s).__enter__()


def test_a_record_keeps_every_digit(workshop: Workshop, tmp_path: Path):
    s = System()
    s.add("unit", workshop.fmu(BLOCK, 3), u64=2**64 - 1, x=0.3)
    with Master(s) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(1, 10), [recorder])
    table = pq.read_table(tmp_path / "r.parquet")
    assert table["unit.u64_out"].to_pylist()[-1] == 2**64 - 1
    assert table["unit.x_out"].to_pylist()[-1] == np.float32(float(np.float32(0.3)) * float(np.float32(0.1)))
