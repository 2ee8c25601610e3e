"""Loading and running a foreign unit with one fault: the fault is reported, and the check survives."""

import os
import subprocess
from pathlib import Path

import fmpy
import pytest
from support.cosim import decay
from support.forked_probes import ForkedProbes
from support.wording import Wording

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.load_probe import load_fault
from handover.cosim.check.report import CheckReport
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.probe import isolated_process
from handover.cosim.probe.finding import Level
from handover.fmus.compile import host_platform

pytestmark = pytest.mark.skipif(not host_platform().endswith("linux"), reason="signals and messages of Linux")


def checked(folder: Path, library: bytes, description: str = decay.DESCRIPTION) -> CheckReport:
    return check_fmu(decay.pack(folder / "Decay.fmu", library, description), 60.0)


def reported(report: CheckReport, section: str) -> tuple[Level, str]:
    found = next(s for s in report.sections if s.name == section)
    assert found.reached
    return found.level, "\n".join(line for f in found.findings for line in (f.line, *f.log))


def test_a_sound_unit_passes(decay_library: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """In processes that Python starts, as users have them."""
    monkeypatch.setattr(isolated_process, "subprocess", subprocess)
    report = checked(tmp_path, decay_library)
    assert report.passed
    assert all(s.reached and s.level is Level.OK for s in report.sections)
    assert report.sections[-1].summary == "10 steps of 0.1 s, state restored, second instance, reset"


@pytest.mark.parametrize(
    ("mode", "level"),
    [
        ("aborts", Level.FAULT),
        ("segmentation_fault", Level.FAULT),
        ("not_a_number", Level.FAULT),
        ("answers_error", Level.FAULT),
        ("discards", Level.FAULT),
        ("forgets_in_state", Level.FAULT),
        ("exits", Level.FAULT),
        ("shares_memory", Level.FAULT),
        ("does_not_reset", Level.WARNING),
        ("out_of_range", Level.WARNING),
    ],
)
def test_a_spoilt_run_is_reported(decay_library: bytes, tmp_path: Path, mode: str, level: Level, wording: Wording):
    found, lines = reported(checked(tmp_path, decay_library, decay.spoilt(mode)), "run")
    assert found is level
    wording.check(lines)


def test_a_run_that_hangs_is_ended(decay_library: bytes, tmp_path: Path, probes: ForkedProbes):
    probes.hangs_after = '"call": "fmi2DoStep", "t": 0.2'
    found, lines = reported(checked(tmp_path, decay_library, decay.spoilt("hangs")), "run")
    assert found is Level.FAULT
    assert "fmi2DoStep at t = 0.2 s was not done after 60 s; if it only needs longer: --timeout" in lines


def test_a_refused_instantiation_is_reported_with_the_log(decay_library: bytes, tmp_path: Path):
    found, lines = reported(checked(tmp_path, decay_library, decay.edited(('guid="decay"', 'guid="x"'))), "run")
    assert found is Level.FAULT
    assert "instantiation: wrong guid x" in lines.replace("[Error] ", "")


@pytest.mark.parametrize("part", [0.3, 0.9, 0.999])
def test_a_library_that_is_cut_off_is_not_loaded(decay_library: bytes, tmp_path: Path, part: float):
    report = checked(tmp_path, decay_library[: int(part * len(decay_library))])
    found, lines = reported(report, "binaries")
    assert found is Level.FAULT
    assert f"{decay.LIBRARY}: the library is shorter than its headers say (it has " in lines
    assert not report.sections[-1].reached
    with pytest.raises(InvalidFmu, match="shorter than its headers say"):
        unpack(report.path, tmp_path / "unpacked", 2, "Decay")
    assert not (tmp_path / "unpacked").exists()


def test_one_instance_is_enough_where_there_may_be_only_one(decay_library: bytes, tmp_path: Path):
    once = decay.spoilt("shares_memory").replace(
        "<CoSimulation ", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="1" '
    )
    once = once.replace('canGetAndSetFMUstate="true"', "").replace('canSerializeFMUstate="true"', "")
    report = checked(tmp_path, decay_library, once)
    assert report.passed
    assert report.sections[-1].summary == "10 steps of 0.1 s, reset"


@pytest.mark.parametrize(
    ("wish", "wanted"),
    [
        ("abort", "crashed with SIGABRT in loading the library: it gave up: abort(), a failed assertion or a C++ "
         "exception that nothing caught\nno licence for Decay"),
        ("crash", "crashed with SIGSEGV in loading the library"),
        ("hang", "loading the library was not done after 60 s"),
    ],
)  # fmt: skip
def test_a_crash_on_loading_is_reported(
    decay_library: bytes, tmp_path: Path, probes: ForkedProbes, monkeypatch: pytest.MonkeyPatch, wish: str, wanted: str
):
    monkeypatch.setenv("DECAY_ON_LOAD", wish)
    probes.hangs_after = '"call": "loading the library"' if wish == "hang" else ""
    report = checked(tmp_path, decay_library)
    found, lines = reported(report, "loading")
    assert found is Level.FAULT
    assert wanted in lines
    assert not report.sections[-1].reached


def test_all_missing_functions_are_reported(tmp_path: Path):
    found, lines = reported(checked(tmp_path, decay.compiled(tmp_path, "-DWITHOUT_STATE")), "loading")
    assert found is Level.FAULT
    assert "lacks 3 of 34 functions: fmi2FreeFMUstate, fmi2GetFMUstate, fmi2SetFMUstate" in lines


def test_a_library_with_functions_of_other_names_is_reported(decay_library: bytes, tmp_path: Path):
    _, lines = reported(checked(tmp_path, decay_library.replace(b"\0fmi2", b"\0abc_")), "loading")
    assert "exports none of the 34 functions of fmi2" in lines


def test_a_missing_library_is_named(tmp_path: Path):
    other = tmp_path / "libother.so"
    (tmp_path / "other.c").write_text("int other(void) { return 1; }\n")
    flags = ["-shared", "-fPIC", f"-Wl,-soname,{other.name}", "-o", str(other)]
    decay.compile_c([str(tmp_path / "other.c"), *flags])
    library = decay.compiled(tmp_path, "-DNEEDS_OTHER", str(other))
    _, lines = reported(checked(tmp_path, library), "loading")
    assert "it needs the shared library libother.so, which is not on this machine" in lines


def test_a_function_that_no_library_has_is_named(tmp_path: Path):
    library = decay.compiled(tmp_path, "-DNEEDS_OTHER", "-Wl,-z,undefs", "-Wl,--allow-shlib-undefined")
    _, lines = reported(checked(tmp_path, library), "loading")
    assert "it uses the function other, which is neither in it nor in a library that it names" in lines


def test_the_linker_is_translated(wording: Wording):
    for message in (
        "/lib/libm.so.6: version `GLIBC_2.99' not found (required by /tmp/x.so)",
        "/tmp/x.so: wrong ELF class: ELFCLASS32",
        "libgomp.so.3: cannot open shared object file: No such file or directory",
        "dlopen(x.dylib, 6): Library not loaded: @rpath/libz.dylib\n Referenced from: x",
        "[WinError 126] The specified module could not be found",
        "[WinError 193] %1 is not a valid Win32 application",
        "something else",
    ):
        finding = load_fault(message, "x.so")
        assert finding.log == (message,)
        wording.check(finding.line)


def test_a_library_for_another_machine_is_reported(decay_library: bytes, tmp_path: Path):
    other, machine = ("aarch64-linux", 183) if host_platform() == "x86_64-linux" else ("x86_64-linux", 62)
    report = checked(tmp_path, decay_library[:18] + machine.to_bytes(2, "little") + decay_library[20:])
    found, lines = reported(report, "binaries")
    assert found is Level.FAULT
    assert f"made for {other}, not for {fmpy.platform}" in lines


@pytest.mark.parametrize(
    ("moved", "wanted"),
    [
        (decay.LIBRARY.replace("Decay.", "decay_fmi2."), "no library is named like the modelIdentifier 'Decay'"),
        ("binaries/win64/Decay.dll", "there are libraries for win64; export it for this platform too"),
        (f"binaries/{fmpy.platform_tuple}/Decay.so", "in the folder of FMI 3.0"),
        ("sources/decay.c", "there are libraries for none; it carries C sources"),
    ],
)  # fmt: skip
def test_a_library_that_is_not_where_it_should_be_is_reported(
    decay_library: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: str, wanted: str
):
    monkeypatch.setattr(decay, "LIBRARY", moved)
    report = checked(tmp_path, decay_library)
    found, lines = reported(report, "binaries")
    assert found is Level.FAULT
    assert wanted in lines
    assert not report.sections[-1].reached
    with pytest.raises(InvalidFmu) as refused:  # as a run does
        unpack(report.path, tmp_path / "unpacked", 2, "Decay")
    assert refused.value.fault in lines.splitlines()


def test_nothing_is_left_behind(decay_library: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    checked(tmp_path, decay_library, decay.spoilt("aborts"))
    assert os.listdir(scratch) == []
