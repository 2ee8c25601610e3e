"""FMI 3 with a variable for every entry of an array, for hosts that know no arrays."""

import ctypes
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import fmpy
import numpy as np
import pytest
from support.fmus.ctypes_host import ERROR, OK, SIZE, CtypesHost
from support.fmus.validity import problems_of

from handover.cosim.blocks.variable import indices_of
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.system.signals import Signals
from handover.fmus.build import build_block, cached
from handover.scenarios.free_flyer.parameters import ImpedanceParameters
from handover.scenarios.free_flyer.push.impedance import FlyerImpedance

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


def test_an_integer_that_outgrows_32_bits_is_refused_not_cut(every_kind: Path):
    host = CtypesHost(every_kind, 3)
    try:
        assert host.instantiate()
        assert host.initialise() == OK
        k, total = (ctypes.byref(ctypes.c_uint32(host.references[name])) for name in ("k", "total"))
        number = ctypes.c_int32(2**31 - 1)
        assert host.call("SetInt32", k, SIZE(1), ctypes.byref(number), SIZE(1)) == OK
        assert host.step(0.0, 0.25) == OK
        assert host.call("GetInt32", total, SIZE(1), ctypes.byref(number), SIZE(1)) == OK
        assert host.step(0.25, 0.25) == OK
        assert host.call("GetInt32", total, SIZE(1), ctypes.byref(number), SIZE(1)) == ERROR
        assert "the value 4294967294 of 'total' (value reference" in host.log[-1]
    finally:
        host.close()


def test_the_same_sources_give_the_same_bytes(every_kind: Path, tmp_path: Path):
    assert build_block(BLOCK, 3, tmp_path, scalar=True).read_bytes() == every_kind.read_bytes()


def test_fmi_2_is_always_scalar(tmp_path: Path):
    plain, asked = (build_block(BLOCK, 2, tmp_path / str(scalar), scalar=scalar) for scalar in (False, True))
    assert asked.name == "EveryKind.fmi2.fmu"
    assert asked.read_bytes() == plain.read_bytes()


def test_the_cache_keeps_both_forms_apart():
    array, scalar = cached("Push", 3), cached("Push", 3, scalar=True)
    assert array.parent != scalar.parent
    assert root_of(array).attrib["instantiationToken"] != root_of(scalar).attrib["instantiationToken"]
    assert scalar.stat().st_ino == cached("Push", 3, scalar=True).stat().st_ino


@pytest.mark.parametrize("name", ["FreeFlyer", pytest.param("StereoCamera", marks=pytest.mark.slow)])
def test_catalogued_units_are_valid_and_give_the_same_bits_in_both_forms(name: str):
    array, scalar = cached(name, 3), cached(name, 3, scalar=True)
    assert problems_of(scalar) == []
    description = describe_fmu(array)
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


@pytest.mark.parametrize("name", ["FreeFlyer", "StereoCamera"])
def test_our_own_master_sees_the_same_ports_in_both_forms(name: str):
    array, scalar = describe_fmu(cached(name, 3)), describe_fmu(cached(name, 3, scalar=True))
    for side in ("parameters", "inputs", "outputs"):
        ports = [{n: p.signature for n, p in getattr(d, side).items()} for d in (array, scalar)]
        assert ports[0] == ports[1]
    assert array.feedthrough == scalar.feedthrough


def test_our_own_master_runs_both_forms_alike():
    units = FlyerImpedance.units
    forms: list[Callable[[str], Path]] = [
        lambda unit: cached(units[unit], 3),
        lambda unit: cached(units[unit], 3, scalar=True),
        lambda unit: cached(units[unit], 3, scalar=unit in ("robot", "push")),
    ]
    seen = [poses(form) for form in forms]
    assert seen[0] == seen[1] == seen[2]
    assert len(set(seen[0])) == 16


def poses(fmu: Callable[[str], Path]) -> list[bytes]:
    parameters = ImpedanceParameters()
    system = FlyerImpedance().build(parameters, 0, fmu)
    told: list[bytes] = []

    def observe(t: float, y: Signals) -> None:  # noqa: ARG001
        told.append(np.concatenate([y["robot.p_WB"], y["robot.q_WB"]]).tobytes())

    with Master(system) as master:
        master.run(Fraction(2, 125) * 15, [observe])
    return told


def test_the_page_says_how_entries_are_named(every_kind: Path, fmu_folder: Path):
    pages: list[str] = []
    for fmu in (every_kind, build_block(BLOCK, 3, fmu_folder)):
        with zipfile.ZipFile(fmu) as archive:
            pages.append(archive.read("documentation/index.html").decode())
    assert ["R[1,2]" in page for page in pages] == [True, False]
