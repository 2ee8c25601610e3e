"""A system that is written as an SSP is the same system when it is read."""

import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.cosim import decay
from support.cosim.fmu_of import FmuOf
from support.cosim.ssp_schemas import expect_valid
from support.wording import Wording

from handover.cosim.exceptions import NotExportable, WiringError
from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.ssp.writing import bound_enumerations, write_ssp
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PortName, System
from handover.fmus.build import build_block

STEP = Fraction(1, 10)


def echoing(fmu: Callable[[str], Path], *names: str) -> System:
    s = System()
    counter = s.add("counter", fmu("Counter"), fails_at=100)
    echo = s.add("echo", fmu("Echo"), pair=np.array([0.1, -1e-300]), light="GREEN", odd=True, n=-3)
    for name in names:
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    return s


def rows(system: System) -> list[dict[str, float]]:
    seen: list[dict[str, float]] = []

    def observe(t: float, signals: Signals) -> None:
        seen.append({"time": t, **{c.name: float(c.values[c.index]) for c in signals.columns()}})

    with Master(system) as master:
        master.run(Fraction(1), [observe])
    return seen


@pytest.mark.parametrize("fmi", [2, 3])
def test_signals_bytes_and_start_values_are_the_same_and_the_schema_is_kept(fmu: FmuOf, tmp_path: Path, fmi: int):
    if fmi == 2:  # which knows no pictures
        s = System()
        mass, spring = s.add("mass", fmu("Mass", 2), x_0=1 / 3, m=0.7), s.add("spring", fmu("Spring", 2), k=2.5)
        s.connect(mass.y.x, spring.u.x, LinearTransformation(1.5, -0.1))
        s.connect(spring.y.f, mass.u.f)
    else:
        s = echoing(fmu, "n", "picture")
    file = write_ssp(s, tmp_path / "a.ssp", "a system", Fraction(5, 3))
    assert write_ssp(s, tmp_path / "again.ssp", "a system", Fraction(5, 3)).read_bytes() == file.read_bytes()
    assert len(expect_valid(file, "1.0" if fmi == 2 else "2.0")) == 3
    with SspFile(file) as ssp:
        assert (ssp.name, ssp.stop) == ("a system", Fraction(5, 3))
        assert {n: set(u.start) for n, u in ssp.system.units.items()} == {n: set(u.start) for n, u in s.units.items()}
        if fmi == 3:
            start = ssp.system.units["echo"].start
            assert (start["n"], start["odd"], start["light"]) == (-3, True, "GREEN")
            np.testing.assert_array_equal(start["pair"], [0.1, -1e-300])
        found = rows(ssp.system)
    wanted = rows(s)
    assert found == wanted
    assert wanted[0] != wanted[-1]


def test_arrays_enumerations_and_pictures_keep_to_the_schema_of_2_0(fmu: FmuOf, tmp_path: Path):
    s = echoing(fmu, "n", "odd", "light", "pair", "picture")
    s.units["counter"] = replace(s.units["counter"], period=Fraction(1, 3), sampled=True)
    assert len(expect_valid(write_ssp(s, tmp_path / "a.ssp", "a"), "2.0")) == 3


def test_enumerations_that_other_tools_must_find_in_the_fmu_are_named_with_their_numbers(fmu: FmuOf):
    units = echoing(fmu).units
    assert bound_enumerations(units["counter"]) == {}
    assert bound_enumerations(units["echo"]) == {"light": 2}


def test_a_step_that_is_not_the_fmu_s_own_is_kept_in_an_annotation(fmu: FmuOf, tmp_path: Path):
    s = System()
    s.add("slow", fmu("Counter"), period=Fraction(1, 3), sampled=True)
    s.add("own", fmu("Counter"))
    file = write_ssp(s, tmp_path / "a.ssp", "a")
    with SspFile(file) as ssp:
        assert {n: (u.period, u.sampled) for n, u in ssp.system.units.items()} == {
            "slow": (Fraction(1, 3), True),
            "own": (STEP, False),
        }
    with zipfile.ZipFile(file) as archive:
        assert archive.read("SystemStructure.ssd").count(b'ssc:Annotation type="handover.communication"') == 1
    with SspFile(file, Fraction(1, 5)) as ssp:
        assert {u.period for u in ssp.system.units.values()} == {Fraction(1, 5)}


def test_other_tools_find_the_step_where_they_look_for_it(fmu: FmuOf, tmp_path: Path):
    """OMSimulator at the system, libcosim and Ecos at the experiment and the components; by prefix."""
    s = System()
    s.add("slow", fmu("Mass", 2), period=Fraction(1, 4))
    s.add("own", fmu("Spring", 2))
    for parallel, base, hints in ((None, "0.05", ["0.25", "0.1"]), (Fraction(1, 50), "0.02", ["0.02", "0.02"])):
        file = write_ssp(s, tmp_path / f"{base}.ssp", "a", parallel_step=parallel)
        expect_valid(file, "1.0")
        with zipfile.ZipFile(file) as archive:
            written = " ".join(archive.read("SystemStructure.ssd").decode().split())
        uri = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
        assert (
            '<ssc:Annotation type="org.openmodelica"> <oms:Annotations> <oms:SimulationInformation> '
            f'<oms:FixedStepMaster description="oms-ma" stepSize="{base}" absoluteTolerance="0.0001"'
        ) in written
        assert f'xmlns:oms="{uri}"' in written
        assert f'<osp:Algorithm> <osp:FixedStepAlgorithm baseStepSize="{base}" />' in written
        assert re.findall('<osp:StepSizeHint value="([^"]*)"', written) == hints
        with SspFile(file) as ssp:
            assert ssp.parallel_step == parallel
            assert {n: u.period for n, u in ssp.system.units.items()} == {"slow": Fraction(1, 4), "own": STEP}


def test_transformations_and_conversions_are_written_out(tmp_path: Path):
    """Not every tool converts units; every one that knows transformations gets the same numbers."""
    metres = decay.pack(tmp_path / "m.fmu", b"")
    edits = (('"m"><BaseUnit m="1"', '"mm"><BaseUnit m="1" factor="0.001"'), ('unit="m"', 'unit="mm"'))
    millimetres = decay.pack(tmp_path / "mm.fmu", b"", decay.edited(*edits))
    s = System()
    a, b, c = s.add("a", metres), s.add("b", millimetres), s.add("c", metres)
    s.connect(a.y.y, b.u.u)
    s.connect(b.y.y, c.u.u, LinearTransformation(0.25, -2.0))
    s.connect(c.y.y, a.u.u)
    file = write_ssp(s, tmp_path / "a.ssp", "a")
    expect_valid(file, "1.0")
    with zipfile.ZipFile(file) as archive:
        assert len([n for n in archive.namelist() if n.endswith(".fmu")]) == 2
        written = archive.read("SystemStructure.ssd").decode()
    assert re.findall(r'factor="(.*)" offset="(.*)"', written) == [("1000.0", "0.0"), ("0.25", "-2.0")]
    assert written.count('suppressUnitConversion="true"') == 2
    with SspFile(file) as ssp:
        changes = {str(w.target): w.transformation for w in ssp.system.connections}
    assert changes == {"b.u": None, "c.u": LinearTransformation(0.25, -2.0), "a.u": None}


def test_what_cannot_be_exported_is_reported_and_nothing_is_written(fmu: FmuOf, tmp_path: Path, wording: Wording):
    s = System()
    scalar = build_block("support.cosim.master_blocks:Echo", 3, tmp_path, step=STEP, scalar=True)
    one, many = s.add("one", fmu("Counter")), s.add("many", scalar)
    s.connect(one.y.pair, many.u.pair)
    with pytest.raises(NotExportable) as refused:
        write_ssp(s, tmp_path / "a.ssp", "a")
    wording.check("; ".join(refused.value.faults))
    s.connect(one.y.n, PortName("many", "m"))
    with pytest.raises(WiringError):
        write_ssp(s, tmp_path / "a.ssp", "a")
    with zipfile.ZipFile(fmu("Counter")) as archive:
        archive.extractall(tmp_path / "counter")
    s = System()
    s.add("one", tmp_path / "counter")
    with pytest.raises(NotExportable) as refused:
        write_ssp(s, tmp_path / "a.ssp", "a")
    assert [fault.partition(":")[0] for fault in refused.value.faults] == ["one"]
    assert not (tmp_path / "a.ssp").exists()
