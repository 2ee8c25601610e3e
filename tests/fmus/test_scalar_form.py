"""FMI 3 with a variable for every entry of an array, for hosts that know no arrays."""

import ctypes
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from support.fmus.ctypes_host import OK, CtypesHost
from support.fmus.validity import problems_of
from support.fmus.workshop import expect_error
from support.wording import Wording

from handover.cosim.blocks.variable import indices_of
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.build import build_block, cached

BLOCK = "support.sample_units.every_kind:EveryKind"


def root_of(fmu: Path) -> ET.Element:
    with zipfile.ZipFile(fmu) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


@pytest.fixture(scope="session")
def every_kind(fmu_folder: Path) -> Path:
    return build_block(BLOCK, 3, fmu_folder, scalar=True)


def test_entries_are_scalars_named_as_in_fmi_2_and_nothing_has_dimensions(every_kind: Path):
    root = root_of(every_kind)
    variables = root.find("ModelVariables")
    assert every_kind.name == "EveryKind.fmi3-scalar.fmu"
    assert root.attrib["fmiVersion"] == "3.0"
    assert variables is not None
    assert list(root.iter("Dimension")) == []
    assert [v.attrib["valueReference"] for v in variables] == [str(i) for i in range(len(variables))]
    starts = {v.attrib["name"]: v.attrib.get("start") for v in variables}
    assert [starts[f"p0[{i}]"] for i in (1, 2, 3)] == ["1.0", "2.0", "3.0"]
    assert [starts[f"M[{i},{j}]"] for i in (1, 2) for j in (1, 2)] == ["1.0", "0.0", "0.0", "1.0"]
    assert [n for n in starts if n.startswith("N[")] == [f"N[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)]


def test_each_entry_of_an_output_depends_on_every_entry_of_its_inputs(every_kind: Path):
    root = root_of(every_kind)
    reference = {
        v.attrib["name"]: v.attrib["valueReference"]
        for v in root.iter()
        if "valueReference" in v.attrib and "name" in v.attrib
    }
    entries = " ".join(reference[f"M[{i},{j}]"] for i in (1, 2, 3) for j in (1, 2, 3))
    now = {e.attrib["valueReference"]: e.attrib["dependencies"] for e in root.iter("Output")}
    first = {e.attrib["valueReference"]: e.attrib["dependencies"] for e in root.iter("InitialUnknown")}
    assert now[reference["N[1,1]"]] == now[reference["N[3,3]"]] == entries
    assert now[reference["p[2]"]] == ""
    assert entries in first[reference["N[2,1]"]]
    assert now.keys() == first.keys()


def test_integers_have_32_bits_if_their_declaration_allows_it(every_kind: Path, fmu_folder: Path):
    types = {
        v.attrib["name"]: v.tag for v in root_of(every_kind).iter() if {"name", "valueReference"} <= v.attrib.keys()
    }
    assert [types[name] for name in ("n", "seed", "k", "total")] == ["Int32"] * 4
    wide = root_of(build_block("support.sample_units.every_width:EveryWidth", 3, fmu_folder, scalar=True))
    assert {"Int8", "UInt16", "UInt64"} <= {v.tag for v in wide.iter()}


def test_an_integer_that_outgrows_32_bits_is_refused_not_cut(every_kind: Path, wording: Wording):
    host = CtypesHost(every_kind, 3)
    try:
        assert host.instantiate()
        assert host.initialise() == OK
        assert host.put("Int32", "k", 2**31 - 1) == OK
        assert host.step(0.0, 0.25) == OK
        assert host.take("Int32", "total") == [2**31 - 1]
        assert host.step(0.25, 0.25) == OK
        expect_error(wording, host, host.transfer("GetInt32", "total", (ctypes.c_int32 * 1)()))
    finally:
        host.close()


def test_the_forms_are_reproduced_and_kept_apart_and_fmi_2_is_always_scalar(every_kind: Path, tmp_path: Path):
    assert build_block(BLOCK, 3, tmp_path, scalar=True).read_bytes() == every_kind.read_bytes()
    plain, asked = (build_block(BLOCK, 2, tmp_path / str(scalar), scalar=scalar) for scalar in (False, True))
    assert asked.name == "EveryKind.fmi2.fmu"
    assert asked.read_bytes() == plain.read_bytes()
    array, scalar = cached("Push", 3), cached("Push", 3, scalar=True)
    assert array.parent != scalar.parent
    assert describe_fmu(array).token != describe_fmu(scalar).token
    assert scalar.stat().st_ino == cached("Push", 3, scalar=True).stat().st_ino


def test_a_catalogued_unit_is_valid_and_gives_the_same_bits_in_both_forms():
    array, scalar = cached("FreeFlyer", 3), cached("FreeFlyer", 3, scalar=True)
    assert problems_of(scalar) == []
    description, other = describe_fmu(array), describe_fmu(scalar)
    for side in ("parameters", "inputs", "outputs"):
        ports = [{n: p.signature for n, p in getattr(d, side).items()} for d in (description, other)]
        assert ports[0] == ports[1]
    assert description.feedthrough == other.feedthrough
    outputs = [p for p in description.outputs.values() if p.kind.value == "real"]
    step = description.step or 0.0
    whole = fmpy.simulate_fmu(str(array), stop_time=3 * step, output_interval=step, output=[p.name for p in outputs])
    names = [n for p in outputs for n in element_names(p.name, p.shape)]
    entries = fmpy.simulate_fmu(str(scalar), stop_time=3 * step, output_interval=step, output=names)
    assert len(whole) == len(entries) == 4
    for p in outputs:
        seen = np.column_stack([entries[n] for n in element_names(p.name, p.shape)])
        assert seen.tobytes() == np.reshape(whole[p.name], seen.shape).tobytes()


def element_names(name: str, shape: tuple[int, ...]) -> list[str]:
    return [f"{name}[{','.join(map(str, index))}]" for index in indices_of(shape)] if shape else [name]
