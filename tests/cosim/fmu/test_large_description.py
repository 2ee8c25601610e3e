from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file import large_description
from handover.cosim.fmu.file.archive import FmuArchive, write_archive
from handover.cosim.fmu.file.description import describe_fmu


def with_locals(fmu: Path, made: Path, n: int = 30) -> Path:
    """Write an FMU that has local variables, too, half of them before those that it had, and return its path."""
    archive = FmuArchive(fmu)
    root = ElementTree.fromstring(archive.description())
    variables = root.find("ModelVariables")
    assert variables is not None
    is_fmi2 = root.get("fmiVersion", "").startswith("2")
    for k in range(n):
        given = {"name": f"inner{k}", "valueReference": str(5000 + k), "causality": "local"}
        local = ElementTree.Element("ScalarVariable" if is_fmi2 else "Float64", given, variability="continuous")
        if is_fmi2:
            ElementTree.SubElement(local, "Real")
        variables.insert(0 if k % 2 else len(variables), local)
    for unknown in root.iterfind("ModelStructure//*[@index]"):  # FMI 2 counts variables
        unknown.set("index", str(int(unknown.get("index", "")) + n // 2))
        if given := unknown.get("dependencies"):
            unknown.set("dependencies", " ".join(str(int(i) + n // 2) for i in given.split()))
    files = {name: archive.read(name) for name in archive.names if not name.endswith("/")}
    return write_archive(made, {**files, "modelDescription.xml": ElementTree.tostring(root)})


@pytest.fixture
def little_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(large_description, "LARGE", 10)


@pytest.mark.parametrize(("unit", "fmi"), [("mass", 2), ("mass", 3), ("gain", 2), ("gain", 3)])
def test_a_large_description_says_the_same_of_what_is_set_and_got(
    unit: str, fmi: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    fmu = native_fmu(unit, fmi)
    many = with_locals(fmu, tmp_path / "many.fmu")
    whole = describe_fmu(many)
    monkeypatch.setattr(large_description, "LARGE", 100)
    assert b"inner" not in large_description.description_of(FmuArchive(many))
    assert describe_fmu(many) == whole
    assert replace(describe_fmu(fmu), path=many) == whole


_VARIABLES = b"""<fmiModelDescription fmiVersion="3.0"><ModelVariables>
<Float64 name="a" valueReference="1" causality="local" initial="exact" start="2"/>
<!-- <Float64 name="remark" valueReference="2"/> -->
<Float64 name="b" valueReference="3" description="&lt;/Float64>"><Annotations><Annotation type="x">
<Float64 name="noted" start="1" causality="output"/></Annotation></Annotations></Float64>
<UInt64 name="n" valueReference="4" causality="local" variability="constant" start="3"/>
<String name="s" valueReference="5" initial="exact"><Start value="1"/><Alias name="t" start="x"/></String>
<Float64 name="c" valueReference="6" start="1"/>
<Float64 name="y" valueReference="7" causality="output"><Dimension valueReference="4"/></Float64>
</ModelVariables><ModelStructure><Output valueReference="7" dependencies="3 4"/><ContinuousStateDerivative
valueReference="6"/></ModelStructure></fmiModelDescription>"""


def reduced(folder: Path, text: bytes) -> ElementTree.Element:
    fmu = write_archive(folder / "u.fmu", {"modelDescription.xml": text})
    return ElementTree.fromstring(large_description.description_of(FmuArchive(fmu)))


@pytest.mark.usefixtures("little_is_large")
def test_variables_are_kept_that_can_be_set_or_size_an_array(tmp_path: Path):
    """In any encoding, with prefixes that are not declared, and anew where the file has changed."""
    texts = [_VARIABLES.decode().encode(encoding) for encoding in ("utf-8", "utf-8-sig", "utf-16")]
    prefixed = _VARIABLES.replace(b"<Annotations>", b"<Annotations><tool:mark/>")
    for text in (*texts, prefixed.replace(b'type="x"', b'type="x" tool:k="1"')):
        root = reduced(tmp_path, text)
        assert [v.get("name") for v in root.iterfind("ModelVariables/*")] == ["a", "n", "s", "y"]
        assert [(u.tag, u.attrib) for u in root.iterfind("ModelStructure/*")] == [
            ("Output", {"valueReference": "7", "dependencies": "4"})
        ]
    root = reduced(tmp_path, _VARIABLES.replace(b'"y"', b'"other"'))
    assert [v.get("name") for v in root.iterfind("ModelVariables/*")] == ["a", "n", "s", "other"]


@pytest.mark.usefixtures("little_is_large")
def test_a_large_description_that_is_not_well_formed_is_refused(tmp_path: Path):
    with pytest.raises(InvalidFmu, match="not well-formed"):
        describe_fmu(write_archive(tmp_path / "cut.fmu", {"modelDescription.xml": b"<fmiModelDescription>" * 9}))


@pytest.mark.parametrize("subscript", ["9" * 5000, ",".join("1" * 100)])
def test_a_name_with_a_subscript_beyond_all_arrays_is_a_scalars(subscript: str, tmp_path: Path):
    archive, name = FmuArchive(native_fmu("gain", 3)), f"y[{subscript}]"
    entry = f'<Float64 name="{name}" valueReference="77" causality="output"/></ModelVariables>'
    text = archive.description().replace(b"</ModelVariables>", entry.encode())
    text = text.replace(b"<ModelStructure>", b'<ModelStructure><Output valueReference="77"/>')
    outputs = describe_fmu(write_archive(tmp_path / "u.fmu", {"modelDescription.xml": text})).outputs
    assert outputs[name].shape == ()


def test_an_array_beyond_all_memory_is_refused(tmp_path: Path):
    archive = FmuArchive(native_fmu("gain", 3))
    size = b'<Dimension start="18446744073709551615"/>'
    array = b'<Float64 name="wide" valueReference="77" causality="output">' + size + b"</Float64>"
    text = archive.description().replace(b"</ModelVariables>", array + b"</ModelVariables>")
    fmu = write_archive(tmp_path / "wide.fmu", {"modelDescription.xml": text})
    with pytest.raises(InvalidFmu, match=r"wide \[18446744073709551615\]"):
        describe_fmu(fmu)


def test_scalars_whose_index_is_beyond_all_memory_are_no_array(tmp_path: Path):
    archive = FmuArchive(native_fmu("spring", 3))
    text = archive.description().replace(b'name="f1"', b'name="f[1,99999999999]"')
    outputs = describe_fmu(write_archive(tmp_path / "far.fmu", {"modelDescription.xml": text})).outputs
    assert list(outputs) == ["f[1,99999999999]", "f2"]
