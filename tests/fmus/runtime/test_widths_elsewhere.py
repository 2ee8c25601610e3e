"""What others see of a unit with every width of numbers: its model description, FMPy, our own master."""

import xml.etree.ElementTree as ET
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.fmus.ctypes_host import INTEGERS
from support.fmus.unit_calls import EVERY_WIDTH, port_of
from support.fmus.validity import problems_of
from support.fmus.workshop import Workshop
from support.wording import Wording

from handover.cosim.exceptions import InitializationError, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.system import System


def declared(fmu: Path, path: str) -> dict[str, ET.Element]:
    assert problems_of(fmu) == []
    with zipfile.ZipFile(fmu) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    return {v.attrib["name"]: v for v in root.findall(path)}


def limits_of(element: ET.Element) -> dict[str, str]:
    return {name: element.attrib[name] for name in ("min", "max", "start") if name in element.attrib}


def test_fmi_3_names_types_bounds_and_starts(workshop: Workshop):
    variables = declared(workshop.fmu(EVERY_WIDTH, 3), "ModelVariables/*")
    types = {name: v.tag for name, v in variables.items()}
    assert types["x"] == types["v"] == types["stretch"] == types["v_out"] == "Float32"
    for end in ("", "_out"):
        assert {width: types[port_of(width) + end] for width in INTEGERS} == {width: width for width in INTEGERS}
    assert limits_of(variables["i8"]) == {"min": "-128", "max": "127", "start": "-128"}
    assert limits_of(variables["u64"]) == {"max": str(2**64 - 1), "start": "11"}
    assert np.float32(limits_of(variables["stretch"])["start"]) == np.float32(0.1)
    starts = [np.float32(entry) for entry in limits_of(variables["v"])["start"].split()]
    assert starts == [np.float32(entry) for entry in (0.1, 0.2, 0.3)]


def test_fmi_2_says_the_range_of_narrow_integers_by_min_and_max(workshop: Workshop):
    variables = declared(workshop.fmu(EVERY_WIDTH, 2), "ModelVariables/ScalarVariable")
    limits = {name: limits_of(v[0]) for name, v in variables.items()}
    assert variables["x"][0].tag == variables["v[2]"][0].tag == "Real"
    assert {variables[port_of(width)][0].tag for width in INTEGERS} == {"Integer"}
    assert limits["u16"] == {"min": "0", "max": "65535", "start": "65535"}
    assert limits["i8_out"] == {"min": "-128", "max": "127"}
    assert limits["u32"] == {"min": "0", "start": "7"}
    assert limits["i32"] == {"start": str(-(2**31))}
    assert limits["i64"] == {"start": "9"}
    assert limits["shift"] == {"min": "-300", "max": "300", "start": "0"}


def told_by_second(workshop: Workshop, fmi: int, *, scalar: bool = False, **start: Any) -> str:
    """What the second of two units sees whose inputs are the first one's outputs."""
    s = System()
    fmu = workshop.fmu(EVERY_WIDTH, fmi) if not scalar else workshop.scalar_fmu(EVERY_WIDTH)
    first, second = s.add("first", workshop.fmu(EVERY_WIDTH, 3), **start), s.add("second", fmu)
    for name in ("x", "v", *(port_of(width) for width in INTEGERS)):
        s.connect(getattr(first.y, f"{name}_out"), getattr(second.u, name))
    seen: list[str] = []
    with Master(s) as master:
        master.run(Fraction(1, 10), [lambda t, y: seen.append(y.text("second.reported"))])  # noqa: ARG005
    return seen[-1]


@pytest.mark.parametrize(("fmi", "scalar"), [(2, False), (3, False), (3, True)])
def test_our_own_master_wires_every_width(workshop: Workshop, fmi: int, scalar: bool):
    v, most = np.array([0.5, 0.1, -2.0], dtype=np.float32), 6 if fmi == 2 else 2**64 - 1
    integers = {"i8": 100, "u8": 200, "i16": 300, "u16": 50000, "i32": -70000, "u32": 80000, "i64": 5, "u64": most}
    seen = told_by_second(workshop, fmi, scalar=scalar, x=1.0, v=v, **integers)
    assert seen == repr((float(np.float32(0.1)), (2.0 * v.astype(float)).tolist(), *integers.values()))


@pytest.mark.parametrize("start", [{"i8": 128}, {"u8": -1}, {"u64": 2**64}, {"x": 1e39}], ids=str)
def test_our_own_master_refuses_start_values_that_do_not_fit(
    workshop: Workshop, start: dict[str, Any], wording: Wording
):
    with pytest.raises(WiringError) as refused:
        told_by_second(workshop, 3, **start)
    wording.check(refused.value)


def test_our_own_master_lets_no_number_lose_its_upper_bits(workshop: Workshop, wording: Wording):
    s = System()
    first, second = s.add("first", workshop.fmu(EVERY_WIDTH, 3), i64=300), s.add("second", workshop.fmu(EVERY_WIDTH, 3))
    s.connect(first.y.i64_out, second.u.u8)
    with pytest.raises(InitializationError) as refused:
        Master(s).__enter__()
    wording.check(refused.value)


def test_a_record_keeps_every_digit(workshop: Workshop, tmp_path: Path):
    s = System()
    s.add("unit", workshop.fmu(EVERY_WIDTH, 3), u64=2**64 - 1, x=0.3)
    with Master(s) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(1, 10), [recorder])
    table = pq.read_table(tmp_path / "r.parquet")
    assert table["unit.u64_out"].to_pylist()[-1] == 2**64 - 1
    assert table["unit.x_out"].to_pylist()[-1] == np.float32(float(np.float32(0.3)) * float(np.float32(0.1)))
