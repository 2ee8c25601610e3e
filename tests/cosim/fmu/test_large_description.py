from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from native_units import native_fmu

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


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("unit", ["mass", "gain"])
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


def test_a_large_description_that_is_not_well_formed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(large_description, "LARGE", 10)
    with pytest.raises(InvalidFmu, match="not well-formed"):
        describe_fmu(write_archive(tmp_path / "cut.fmu", {"modelDescription.xml": b"<fmiModelDescription>" * 9}))


def test_an_array_beyond_all_memory_is_refused(tmp_path: Path):
    archive = FmuArchive(native_fmu("gain", 3))
    size = b'<Dimension start="18446744073709551615"/>'
    array = b'<Float64 name="wide" valueReference="77" causality="output">' + size + b"</Float64>"
    text = archive.description().replace(b"</ModelVariables>", array + b"</ModelVariables>")
    fmu = write_archive(tmp_path / "wide.fmu", {"modelDescription.xml": text})
    with pytest.raises(InvalidFmu, match=r"wide \[18446744073709551615\]"):
        describe_fmu(fmu)
