"""Files that are no SSPs, or cannot be read, are rejected with one clear line."""

import contextlib
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.cosim.ssp_of import component, described, pack_ssp, system

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


def test_what_is_no_archive_is_reported(tmp_path: Path):
    (tmp_path / "a.ssp").write_text("<ssd/>")
    (tmp_path / "b.ssp").write_bytes(b"")
    (tmp_path / "c.ssp").write_bytes(b"PK\x03\x04 and no more")
    assert refusal(tmp_path / "a.ssp") == "not an SSP: an SSP is a zip archive, and this file is not one"
    assert refusal(tmp_path / "b.ssp") == "not an SSP: the file is empty"
    assert "its end is missing" in refusal(tmp_path / "c.ssp")
    assert refusal(tmp_path / "missing.ssp") == "there is no such file"
    assert "SystemStructure.ssd at the top" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["../x", "/etc/x", "C:/x", "..\\x", "a/../../x"])
def test_a_path_that_leads_out_is_refused(tmp_path: Path, name: str):
    assert "paths that lead out of it" in refusal(pack_ssp(tmp_path / "a.ssp", SOUND, {name: b"x"}))


def test_links_are_refused(tmp_path: Path):
    link = zipfile.ZipInfo("resources/unit.fmu")
    link.create_system, link.external_attr = 3, 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "a.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", SOUND)
        archive.writestr(link, "/etc/passwd")
    assert "symbolic links" in refusal(tmp_path / "a.ssp")


def test_a_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("handover.cosim.fmu.file.archive._SUSPECT_BYTES", 16 << 20)
    file = pack_ssp(tmp_path / "a.ssp", SOUND, {})
    with zipfile.ZipFile(file, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("resources/zeros", bytes(17 << 20))
    assert "looks like a zip bomb" in refusal(file)


@pytest.mark.parametrize(
    ("files", "text"),
    [
        ({"structure.ssd": SOUND}, "no SystemStructure.ssd at the top of the archive: the archive holds structure.ssd"),
        ({"deep/SystemStructure.ssd": SOUND}, "it is at deep/SystemStructure.ssd; zip what is in that folder"),
        ({"systemstructure.SSD": SOUND}, "upper and lower case count"),
    ],
)
def test_a_missing_description_is_reported_with_what_is_there(tmp_path: Path, files: dict[str, str], text: str):
    assert text in refusal(pack_ssp(tmp_path / "a.ssp", None, files))


@pytest.mark.parametrize(
    ("edits", "text"),
    [
        ({"</ssd:System>": ""}, "SystemStructure.ssd cannot be read: it is not well-formed"),
        ({"?>": '?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>'}, "document type"),
        ({"?>": '?><!DOCTYPE a [<!ENTITY b "c">]>', "whole": "&b;"}, "document type"),
        ({'version="1.0" name': 'version="3.0" name'}, "is 3.0; 1.0 and 2.0 can be read"),
        ({'version="1.0" name': "name"}, "is none; 1.0 and 2.0 can be read"),
        ({SOUND: "<html/>"}, "line 1: <html> where <ssd:SystemStructureDescription> is right"),
        ({"SSP1": "SSP7"}, "where <ssd:SystemStructureDescription> is right"),
        ({'name="whole"': ""}, "Element 'ssd:System': The attribute 'name' is required but missing"),
        ({"ssd:Elements": "ssd:Parts"}, "SystemStructure.ssd, line 3: "),
        ({'"1.0" name': '"2.0" name', 'name="whole"': ""}, "line 3: <ssd:System> has no attribute 'name'"),
        ({'"1.0" name': '"2.0" name', "ssd:System ": "ssd:S ", "ssd:System>": "ssd:S>"}, "0 outermost systems"),
    ],
)
def test_a_malformed_description_is_refused(tmp_path: Path, edits: Mapping[str, str], text: str):
    changed = SOUND
    for old, new in edits.items():
        assert old in changed
        changed = changed.replace(old, new)
    assert text in refusal(pack_ssp(tmp_path / "a.ssp", changed, {"resources/unit.fmu": b"x"}))


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("resources/unti.fmu", "there is no 'resources/unti.fmu' in the SSP; did you mean resources/unit.fmu?"),
        ("../unit.fmu", "'../unit.fmu' leads out of the SSP"),
        ("resources/%2e%2e/%2e%2e/unit.fmu", "leads out of the SSP"),
        ("file:///tmp/unit.fmu", "lies outside of the SSP; a relative URI"),
        ("http://127.0.0.1:9/unit.fmu", "lies outside of the SSP"),
        ("//host/unit.fmu", "lies outside of the SSP"),
        ("/tmp/unit.fmu", "lies outside of the SSP"),
        ("", "names no file of the SSP"),
        ("#other", "names no file of the SSP"),
    ],
)
def test_a_component_s_source_is_a_file_in_the_archive(tmp_path: Path, source: str, text: str):
    description = described(system(component("a", source=source)))
    assert text in refusal(pack_ssp(tmp_path / "a.ssp", description, {"resources/unit.fmu": b"x"}))


def test_a_structure_given_by_itself_is_named_once(tmp_path: Path):
    for content in (SOUND.replace('name="whole"', ""), SOUND.replace('"1.0" name', '"2.0" name'), "<html>"):
        (tmp_path / "own.ssd").write_text(content)
        assert not refusal(tmp_path / "own.ssd").startswith("own.ssd")


def test_what_is_wrong_with_an_unpacked_fmu_names_ssp_and_member(tmp_path: Path):
    member = tmp_path / "scratch" / "resources" / "unit.fmu"
    with named_by_archive(tmp_path / "scratch", tmp_path / "a.ssp"):
        assert str(InvalidFmu(member, "no library")) == f"{tmp_path / 'a.ssp'}: resources/unit.fmu: no library"
    assert str(InvalidFmu(member, "no library")).startswith(str(member))


def test_what_is_wrong_with_an_fmu_is_reported_with_its_place_in_the_ssp(tmp_path: Path):
    file = pack_ssp(tmp_path / "a.ssp", SOUND, {"resources/unit.fmu": b"no zip"})
    assert refusal(file) == "resources/unit.fmu: not an FMU: an FMU is a zip archive, and this file is not one"


@pytest.mark.parametrize(
    ("element", "text"),
    [
        (component("a", more='type="application/x-ssp-package"'), "only FMUs (application/x-fmu-sharedlibrary)"),
        (component("a", more='implementation="ModelExchange"'), "only co-simulation is supported"),
        (
            '<ssd:SignalDictionaryReference name="a" dictionary="b"/>',
            "<ssd:SignalDictionaryReference> is not supported",
        ),
        (component("a") * 2, "two elements are called 'a'"),
        (component("a" * 5000), "line 3: a name of 5000 characters, 'aaaaaaaaaaaaaaaaaaaa'...; at most 255 are taken"),
        ('<ssd:System name="inner"/>', "there is no component"),
        (
            '<ssd:Component name="a"/>',
            "line 3: Element 'ssd:Component': The attribute 'source' is required but missing",
        ),
    ],
)
def test_what_is_not_supported_is_named(tmp_path: Path, element: str, text: str):
    assert text in refusal(pack_ssp(tmp_path / "a.ssp", described(system(element)), {"resources/unit.fmu": b"x"}))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_a_description_holds_it_is_refused_or_read(tmp_path: Path, data: st.DataObject):
    content = bytearray(SOUND.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(InvalidSsp):
        SspFile(pack_ssp(tmp_path / "a.ssp", None, {"SystemStructure.ssd": bytes(content)}))


@pytest.mark.parametrize("given", ["NaN", "1e-300", "0", "-0.1", "INF", "1e999", "soon", ""])
@pytest.mark.parametrize("name", ["stepSize", "baseStepSize", "attribute"])
def test_a_step_that_is_none_is_refused_with_its_place(tmp_path: Path, name: str, given: str):
    oms = f'<o:Master xmlns:o="urn:o" stepSize="{given}"/>'
    osp = f'<p:Algorithm xmlns:p="urn:p"><p:Fixed baseStepSize="{given}"/></p:Algorithm>'
    annotated = f"<ssd:Annotations>{annotation('org.openmodelica', oms)}</ssd:Annotations>"
    more = f"<ssd:Annotations>{annotation('com.opensimulationplatform', osp)}</ssd:Annotations>"
    whole = system(component("a"))
    description = {
        "stepSize": described(whole.replace("</ssd:System>", f"{annotated}</ssd:System>")),
        "baseStepSize": described(whole, f"<ssd:DefaultExperiment>{more}</ssd:DefaultExperiment>"),
        "attribute": described(whole, f'<ssd:DefaultExperiment stepSize="{given}"/>', version="2.0"),
    }[name]
    told = refusal(pack_ssp(tmp_path / "a.ssp", description, {"resources/unit.fmu": b"x"}))
    assert told.startswith(f"SystemStructure.ssd, line {4 if name != 'stepSize' else 3}: ")
    which = "stepSize" if name == "attribute" else name
    assert f"{which}={given!r} is " in told
    assert told.endswith(("is not a finite number", "is no communication step; a number from 1e-12 s on is right"))


def annotation(kind: str, inside: str) -> str:
    return f'<ssc:Annotation type="{kind}">{inside}</ssc:Annotation>'
