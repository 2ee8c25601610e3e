"""Files that are no SSPs, or cannot be read, are rejected with one clear line."""

import contextlib
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.cosim.ssp_of import component, described, pack_ssp, system
from support.wording import Wording

from handover.cosim.exceptions import InvalidFmu, InvalidSsp, named_by_archive
from handover.cosim.ssp.ssp_file import SspFile

SOUND = described(system(component("a")))


def refusal(path: Path) -> str:
    with pytest.raises(InvalidSsp) as caught:
        SspFile(path)
    assert caught.value.path == path
    assert str(caught.value) == f"{path}: {'; '.join(caught.value.faults)}"
    assert "\n" not in str(caught.value)
    return "; ".join(caught.value.faults)


def test_what_is_no_ssp_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording):
    file, link = tmp_path / "a.ssp", zipfile.ZipInfo("resources/unit.fmu")
    for content in (b"<ssd/>", b"", b"PK\x03\x04 and no more", None):
        file.unlink(missing_ok=True)
        if content is not None:
            file.write_bytes(content)
        wording.check(refusal(file))
    for name in ("../x", "/etc/x", "C:/x", "..\\x", "a/../../x"):
        wording.check(refusal(pack_ssp(file, SOUND, {name: b"x"})))
    (tmp_path / "folder").mkdir()
    wording.check(refusal(tmp_path / "folder"))
    link.create_system, link.external_attr = 3, 0o120777 << 16
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("SystemStructure.ssd", SOUND)
        archive.writestr(link, "/etc/passwd")
    wording.check(refusal(file))
    for name in ("structure.ssd", "deep/SystemStructure.ssd", "systemstructure.SSD"):
        wording.check(refusal(pack_ssp(file, None, {name: SOUND})))
    wording.check(refusal(pack_ssp(file, SOUND, {"resources/unit.fmu": b"no zip"})))
    monkeypatch.setattr("handover.cosim.fmu.file.archive._SUSPECT_BYTES", 16 << 20)
    with zipfile.ZipFile(pack_ssp(file, SOUND, {}), "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("resources/zeros", bytes(17 << 20))
    wording.check(refusal(file))


def test_a_malformed_description_is_refused(tmp_path: Path, wording: Wording):
    for edits in (
        {"</ssd:System>": ""},
        {"?>": '?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>'},
        {"?>": '?><!DOCTYPE a [<!ENTITY b "c">]>', "whole": "&b;"},
        {'version="1.0" name': 'version="3.0" name'},
        {'version="1.0" name': "name"},
        {SOUND: "<html/>"},
        {"SSP1": "SSP7"},
        {'name="whole"': ""},
        {"ssd:Elements": "ssd:Parts"},
        {'"1.0" name': '"2.0" name', 'name="whole"': ""},
        {'"1.0" name': '"2.0" name', "ssd:System ": "ssd:S ", "ssd:System>": "ssd:S>"},
    ):
        changed = SOUND
        for old, new in edits.items():
            assert old in changed
            changed = changed.replace(old, new)
        wording.check(refusal(pack_ssp(tmp_path / "a.ssp", changed, {"resources/unit.fmu": b"x"})))


def test_an_element_that_cannot_be_taken_is_refused(tmp_path: Path, wording: Wording):
    for element in (
        component("a", source="resources/unti.fmu"),
        component("a", source="../unit.fmu"),
        component("a", source="resources/%2e%2e/%2e%2e/unit.fmu"),
        component("a", source="file:///tmp/unit.fmu"),
        component("a", source="http://127.0.0.1:9/unit.fmu"),
        component("a", source="//host/unit.fmu"),
        component("a", source="/tmp/unit.fmu"),
        component("a", source=""),
        component("a", source="#other"),
        component("a", more='type="application/x-ssp-package"'),
        component("a", more='implementation="ModelExchange"'),
        '<ssd:SignalDictionaryReference name="a" dictionary="b"/>',
        component("a") * 2,
        component("a" * 5000),
        '<ssd:System name="inner"/>',
        '<ssd:Component name="a"/>',
    ):
        file = pack_ssp(tmp_path / "a.ssp", described(system(element)), {"resources/unit.fmu": b"x"})
        wording.check(refusal(file))


def test_a_structure_given_by_itself_is_named_once(tmp_path: Path):
    for content in (SOUND.replace('name="whole"', ""), SOUND.replace('"1.0" name', '"2.0" name'), "<html>"):
        (tmp_path / "own.ssd").write_text(content)
        assert not refusal(tmp_path / "own.ssd").startswith("own.ssd")


def test_what_is_wrong_with_an_unpacked_fmu_names_ssp_and_member(tmp_path: Path):
    member = tmp_path / "scratch" / "resources" / "unit.fmu"
    with named_by_archive(tmp_path / "scratch", tmp_path / "a.ssp"):
        assert str(InvalidFmu(member, "no library")) == f"{tmp_path / 'a.ssp'}: resources/unit.fmu: no library"
    assert str(InvalidFmu(member, "no library")).startswith(str(member))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_a_description_holds_it_is_refused_or_read(tmp_path: Path, data: st.DataObject):
    content = bytearray(SOUND.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(InvalidSsp):
        SspFile(pack_ssp(tmp_path / "a.ssp", None, {"SystemStructure.ssd": bytes(content)}))


def test_a_step_that_is_none_is_refused_with_its_place(tmp_path: Path, wording: Wording):
    whole = system(component("a"))
    for step in ("NaN", "1e-300", "0", "-0.1", "1e999", "soon", ""):
        oms = annotation("org.openmodelica", f'<o:Master xmlns:o="urn:o" stepSize="{step}"/>')
        osp = f'<p:Algorithm xmlns:p="urn:p"><p:Fixed baseStepSize="{step}"/></p:Algorithm>'
        osp = annotation("com.opensimulationplatform", osp)
        for description in (
            described(whole.replace("</ssd:System>", f"{oms}</ssd:System>")),
            described(whole, f"<ssd:DefaultExperiment>{osp}</ssd:DefaultExperiment>"),
            described(whole, f'<ssd:DefaultExperiment stepSize="{step}"/>', version="2.0"),
        ):
            wording.check(refusal(pack_ssp(tmp_path / "a.ssp", description, {"resources/unit.fmu": b"x"})))


def annotation(kind: str, inside: str) -> str:
    return f'<ssd:Annotations><ssc:Annotation type="{kind}">{inside}</ssc:Annotation></ssd:Annotations>'
