"""What the compiled runtime exports, needs and betrays, on each platform."""

import re
import shutil
from pathlib import Path

import pytest
from support.fmus.foreign import functions
from support.fmus.libraries import Facts, expect_no_folder, facts, is_signed, slices

import handover.fmus.compile
from handover.fmus.binaries import binaries
from handover.fmus.compile import RUNTIME, TARGETS, compile_runtime, host_platform, library

ANOTHER = "aarch64-linux"
"""That of the other platforms which is compiled for in the slow tier."""
OTHERS = [target for target in TARGETS if target not in (host_platform(), ANOTHER)]
EVERY = [
    host_platform(),
    pytest.param(ANOTHER, marks=pytest.mark.slow),
    *(pytest.param(target, marks=pytest.mark.platforms) for target in OTHERS),
]

SYSTEM_LIBRARIES = {
    "linux": r"lib(c|dl|m|pthread)\.so\.\d",
    "windows": r"KERNEL32\.dll|api-ms-win-crt-[a-z]+-l1-1-0\.dll",
    "darwin": r"/usr/lib/libSystem\.B\.dylib",
}
OLDEST = {"linux": (2, 17), "windows": (), "darwin": (11, 0, 0)}


def expect_fit(found: Facts, target: str, fmi: int) -> None:
    system = target.partition("-")[2]
    assert found.platform == target
    assert found.exported == set(functions(fmi))
    assert [name for name in found.needed if not re.fullmatch(SYSTEM_LIBRARIES[system], name)] == []
    assert found.oldest <= OLDEST[system]


@pytest.mark.parametrize("target", EVERY)
def test_exports_the_standard_alone_and_needs_the_system_alone(target: str):
    compile_runtime([target])
    assert [len(functions(fmi)) for fmi in (2, 3)] == [44, 75]
    for fmi in (2, 3):
        expect_fit(facts(library(target, fmi).read_bytes()), target, fmi)


@pytest.mark.platforms
@pytest.mark.parametrize("target", [t for t in TARGETS if t != host_platform()])  # that: test_on_demand.py
def test_the_same_sources_give_the_same_bytes_anywhere_and_tell_of_no_folder(
    target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    compile_runtime([target])
    first = [library(target, fmi).read_bytes() for fmi in (2, 3)]
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(RUNTIME, elsewhere, ignore=shutil.ignore_patterns("bin"))
    (elsewhere / "unused.h").write_text(f"/* {elsewhere} */")  # so that no cache has libraries of these sources
    monkeypatch.setattr(handover.fmus.compile, "RUNTIME", elsewhere)
    compile_runtime([target])
    again = [library(target, fmi) for fmi in (2, 3)]
    assert all(file.is_relative_to(elsewhere) for file in again)
    assert [file.read_bytes() for file in again] == first
    for content in first:
        expect_no_folder(content, elsewhere)


@pytest.mark.platforms
def test_macs_of_both_kinds_find_a_library_that_is_signed_where_it_must_be():
    made = binaries("Unit", 2, ["x86_64-darwin", "aarch64-darwin"])
    assert sorted(made) == ["binaries/aarch64-darwin/Unit.dylib", "binaries/darwin64/Unit.dylib"]
    intel, arm = slices(made["binaries/darwin64/Unit.dylib"])
    assert arm == made["binaries/aarch64-darwin/Unit.dylib"]
    expect_fit(facts(intel), "x86_64-darwin", 2)
    expect_fit(facts(arm), "aarch64-darwin", 2)
    assert is_signed(arm)
    assert not is_signed(arm.replace(b"no usable Python", b"no edible Python"))
