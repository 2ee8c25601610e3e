import json
import os
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import pytest
from support.fmus.workshop import Workshop
from support.fmus.written_blocks import write_block
from support.wording import Wording

from handover.cosim.experiments import manifest as manifest_format
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.binaries import universal
from handover.fmus.build import InvalidName, InvalidStep, UnknownVersion, build_block, cached
from handover.fmus.catalog import UNITS, Entry, UnknownBlock, UnknownUnit, find_unit
from handover.fmus.compile import UnknownPlatform, host_platform
from handover.fmus.sources import closure

EVERY_KIND = "support.sample_units.every_kind:EveryKind"


def test_the_catalog_knows_its_units_without_loading_them():
    assert find_unit("StereoCamera").step == Fraction(1, 30)
    assert all(name == entry.name and name.isidentifier() and entry.summary for name, entry in UNITS.items())
    with pytest.raises(UnknownUnit) as refused:
        find_unit("TendonArn")
    assert "did you mean TendonArm" in str(refused.value)


REFUSED: list[tuple[str, type[Exception], dict[str, Any]]] = [
    ("nowhere.at_all:Block", UnknownBlock, {}),
    ("support.sample_units.every_kind", UnknownBlock, {}),
    ("support.sample_units.every_kind:Nothing", UnknownBlock, {}),
    ("ends_itself:Block", UnknownBlock, {}),
    (EVERY_KIND, InvalidName, {"name": "two words"}),
    (EVERY_KIND, UnknownVersion, {"fmi": 1}),
    (EVERY_KIND, UnknownPlatform, {"platforms": ["amiga"]}),
    *(
        (EVERY_KIND, InvalidStep, {"step": step})
        for step in (Fraction(0), Fraction(-1), 0, 0.1, "soon", Fraction("1e400"), Fraction("1e-400"))
    ),
]


def test_what_cannot_be_built_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    (tmp_path / "ends_itself.py").write_text("import sys\n\nsys.exit(5)\n")
    monkeypatch.syspath_prepend(tmp_path)
    for block, error, given in REFUSED:
        call: dict[str, Any] = {"fmi": 3, "out_dir": tmp_path / "out", **given}
        with pytest.raises(error) as refused:
            build_block(block, **call)
        wording.check(refused.value)
        assert not (tmp_path / "out").exists()


def test_a_block_is_built_for_the_platforms_that_are_named(tmp_path: Path):
    made = build_block(EVERY_KIND, 3, tmp_path, platforms=["host"])
    with zipfile.ZipFile(made) as archive:
        folders = {n.split("/")[1] for n in archive.namelist() if n.startswith("binaries/")}
    assert folders == {host_platform()}


def test_the_same_sources_give_the_same_bytes(workshop: Workshop, tmp_path: Path):
    first = workshop.fmu("every_kind:EveryKind", 3)
    assert build_block(EVERY_KIND, 3, tmp_path).read_bytes() == first.read_bytes()


_BUILD = "import sys; from handover.fmus.build import cached; print(cached('Push', 3), sys.prefix)"


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there an environment has one name of its interpreter")
def test_a_unit_is_the_same_by_whatever_name_the_interpreter_is_called(tmp_path: Path):
    names = [name for n in ("python", "python3") if (name := Path(sys.prefix, "bin", n)).exists()]
    environment = {**os.environ, "HANDOVER_CACHE": str(tmp_path)}
    built = {subprocess.check_output([name, "-c", _BUILD], env=environment, text=True) for name in names}
    (printed,) = built
    fmu, prefix = printed.split()
    with zipfile.ZipFile(fmu) as archive:
        (line,) = [w for w in archive.read("resources/python.txt").decode().splitlines() if w.startswith("executable")]
    assert line.removeprefix("executable = ").startswith(prefix)  # not where the environment's links lead to


def test_an_fmu_carries_its_sources_and_lists_its_packages(workshop: Workshop):
    with zipfile.ZipFile(workshop.fmu("every_kind:EveryKind", 3)) as archive:
        names = set(archive.namelist())
        unit = json.loads(archive.read("resources/unit.json"))
        page = archive.read("documentation/index.html").decode()
    assert {
        "resources/sources/support/sample_units/every_kind.py",
        "resources/sources/handover/cosim/blocks/description.py",
    } <= names
    assert not any("build" in name or "catalog" in name for name in names)
    assert [p["module"] for p in unit["packages"]] == ["numpy", "typing_extensions"]
    assert all(p["version"] for p in unit["packages"])
    assert "a&lt;b&amp;" in page
    assert "0 … 10" in page


def test_imports_are_followed_but_those_for_type_checkers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(tmp_path)
    block = write_block(tmp_path, "followed", "1.0", helper="followed_helper")
    carried = closure(block)
    assert {"followed.py", "followed_helper.py", "handover/cosim/blocks/ports.py"} <= carried.files.keys()
    assert "cv2" not in carried.modules


def test_imports_within_a_function_are_followed_too():
    carried = closure(UNITS["Thrusters"].block)
    assert "scipy.optimize" in carried.imported
    assert {"numpy", "scipy"} <= set(carried.modules)


@pytest.mark.parametrize("by_path", [False, True])
def test_the_cache_builds_once_and_again_when_a_source_or_the_manifest_changes(
    by_path: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    module = f"kept_{by_path}".lower()
    block = write_block(tmp_path, module, "1.0", helper=f"{module}_helper")
    monkeypatch.setitem(cast("dict[str, Entry]", UNITS), "Kept", Entry("Kept", block, Fraction(1), "for a test"))
    name = block if by_path else "Kept"
    first = cached(name, 3)
    assert first.is_relative_to(tmp_path / "cache")
    made = first.stat().st_ino
    assert cached(name, 3).stat().st_ino == made
    write_block(tmp_path, module, "2.0", helper=f"{module}_helper")
    second = cached(name, 3)
    assert second != first
    assert describe_fmu(second).token != describe_fmu(first).token
    changed = tmp_path / "manifest.py"
    changed.write_bytes(Path(manifest_format.__file__).read_bytes().replace(manifest_format.VERSION.encode(), b"2.0"))
    monkeypatch.setattr(manifest_format, "__file__", str(changed))
    assert cached(name, 3) not in (first, second)


@pytest.mark.parametrize("damage", ["cut off", "a bit"])
def test_a_damaged_file_in_the_cache_is_built_again_once_with_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, damage: str
):
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    unit = cached("Push", 3)
    sound = unit.read_bytes()
    half = len(sound) // 2
    spoilt = {
        "cut off": sound[:half],
        "a bit": sound[:half] + bytes([sound[half] ^ 1]) + sound[half + 1 :],
    }
    unit.write_bytes(spoilt[damage])
    for _ in range(2):
        assert cached("Push", 3).read_bytes() == sound
    (line,) = [r.getMessage() for r in caplog.records]
    assert line.startswith(f"{unit} is built again: ")


def test_a_universal_binary_holds_both_files_at_page_boundaries():
    intel = bytes.fromhex("cffaedfe0700000103000000") + b"intel"
    arm = bytes.fromhex("cffaedfe0c00000100000000") + b"arm"
    joined = universal([intel, arm])
    assert joined[:8] == bytes.fromhex("cafebabe00000002")
    assert joined[8:28] == bytes.fromhex("01000007 00000003 00004000 00000011 0000000e")
    assert joined[0x4000:].startswith(intel)
    assert joined[0x8000:].startswith(arm)
