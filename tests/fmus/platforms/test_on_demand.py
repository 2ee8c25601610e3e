"""Which platforms are compiled, when, and where their libraries go."""

import importlib.util
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.fmus.libraries import expect_no_folder
from support.wording import Wording

import handover.fmus.compile
from handover.fmus.binaries import NotCompiled, binaries
from handover.fmus.compile import (
    RUNTIME,
    TARGETS,
    CompilationError,
    UnknownPlatform,
    cache_folder,
    compile_runtime,
    host_platform,
    is_current,
    library,
    named_platforms,
    wanted_platforms,
)
from handover.scenarios.cli.command import main

COMPILE = r"""
from pathlib import Path
import sys
sys.path.insert(0, sys.argv[1])
from fmus import compile
compile.RUNTIME = Path(sys.argv[2])
compile.compile_runtime()
print(compile.library(compile.host_platform(), 3))
"""


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of the runtime's sources that nothing is compiled of, and that is compiled from."""
    copy = tmp_path / "runtime"
    shutil.copytree(RUNTIME, copy, ignore=shutil.ignore_patterns("bin"))
    (copy / "unused.h").write_text(f"/* {copy} */")  # so that no cache has libraries of these sources
    monkeypatch.setattr(handover.fmus.compile, "RUNTIME", copy)
    return copy


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Let a compiler that writes only for which target take zig's place; return what it was given."""
    calls: list[list[str]] = []

    def compile_nothing(arguments: list[str]) -> "subprocess.CompletedProcess[str]":
        calls.append(arguments)
        Path(arguments[arguments.index("-o") + 1]).write_text(
            f"library for {arguments[arguments.index('-target') + 1]}"
        )
        return subprocess.CompletedProcess(arguments, 0, "")

    monkeypatch.setattr(handover.fmus.compile, "zig_cc", compile_nothing)
    return calls


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    find: Callable[..., object] = importlib.util.find_spec

    def find_all_but_zig(name: str, package: str | None = None) -> object:
        return None if name == "ziglang" else find(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", find_all_but_zig)


def test_platforms_are_named_singly_in_lists_and_together(monkeypatch: pytest.MonkeyPatch):
    assert named_platforms(["x86_64-windows, x86_64-linux", "x86_64-linux"]) == ("x86_64-linux", "x86_64-windows")
    assert named_platforms(["host"]) == (host_platform(),)
    assert named_platforms(["all", "host"]) == tuple(TARGETS)
    monkeypatch.delenv("HANDOVER_FMI_PLATFORMS", raising=False)
    assert wanted_platforms() == (host_platform(),)
    monkeypatch.setenv("HANDOVER_FMI_PLATFORMS", "all")
    assert wanted_platforms() == tuple(TARGETS)


@pytest.mark.parametrize("names", [["win64"], ["all,win64"], [""], [",", " "]])
def test_unknown_names_are_refused_with_the_valid_ones(
    monkeypatch: pytest.MonkeyPatch, names: list[str], wording: Wording
):
    with pytest.raises(UnknownPlatform) as refused:
        named_platforms(names)
    wording.check(refused.value)
    monkeypatch.setenv("HANDOVER_FMI_PLATFORMS", "linux")
    with pytest.raises(UnknownPlatform, match="'linux'"):
        compile_runtime()


def test_compiling_by_hand_refuses_unknown_names_in_one_line(wording: Wording):
    call = [sys.executable, str(RUNTIME.with_name("compile.py")), "win64"]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    wording.check(done.stderr)


def test_a_library_is_compiled_once_and_again_after_a_change_or_damage(
    sources: Path, compiled: list[list[str]], caplog: pytest.LogCaptureFixture
):
    def compile_once_more(calls: int) -> None:
        assert is_current("aarch64-linux") is (calls == 0)
        before = len(compiled)
        for _ in range(2):
            compile_runtime(["aarch64-linux"])
            assert is_current("aarch64-linux")
            assert len(compiled) == before + calls

    compile_once_more(2)
    assert [call[call.index("-target") + 1] for call in compiled] == ["aarch64-linux-gnu.2.17"] * 2  # FMI 2, FMI 3
    assert library("aarch64-linux", 2).is_relative_to(sources)
    (sources / "text.h").write_text("/* other */")
    compile_once_more(2)
    damaged = library("aarch64-linux", 3)
    damaged.write_bytes(damaged.read_bytes()[:-1])
    compile_once_more(2)
    assert damaged.read_bytes() == b"library for aarch64-linux-gnu.2.17"
    (line,) = [r.getMessage() for r in caplog.records]
    assert line == f"a library of the FMI runtime in {damaged.parent} is damaged; it is compiled again"


@pytest.mark.usefixtures("compiled")
def test_a_place_that_cannot_be_written_is_left_for_the_cache(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    (sources / "bin").write_text("in the way, for root as well, whom no permission stops")
    compile_runtime(["x86_64-windows"])
    assert is_current("x86_64-windows")
    assert library("x86_64-windows", 3).is_relative_to(cache_folder() / "runtime")
    assert binaries("Unit", 2, ["x86_64-windows"]).keys() == {"binaries/win64/Unit.dll"}
    first = library("x86_64-windows", 3)
    (sources / "text.h").write_text("/* other */")
    compile_runtime(["x86_64-windows"])
    assert library("x86_64-windows", 3).parent != first.parent  # another version of the package keeps its own


def test_no_place_at_all_is_reported(sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "cache").write_text("in the way")
    (sources / "bin").write_text("in the way")
    monkeypatch.setenv("HANDOVER_CACHE", str(tmp_path / "cache"))
    with pytest.raises(CompilationError, match="HANDOVER_CACHE must be a writable folder"):
        compile_runtime(["x86_64-windows"])


@pytest.mark.usefixtures("sources", "compiled")
def test_each_platform_has_a_folder_and_fmi_2s_for_linux_holds_x86_64s_library_if_there_is_one():
    both = binaries("Unit", 2, ["x86_64-linux", "aarch64-linux"])
    alone = binaries("Unit", 2, ["aarch64-linux"])
    arm, linux = "binaries/aarch64-linux/Unit.so", "binaries/linux64/Unit.so"
    assert both.keys() == alone.keys() == {arm, linux}
    assert both[linux] != both[arm] == alone[arm] == alone[linux] == b"library for aarch64-linux-gnu.2.17"
    made = {path.split("/")[1]: content.decode() for path, content in binaries("Unit", 3, ["all"]).items()}
    assert made == {target: f"library for {TARGETS[target][0]}" for target in TARGETS}


@pytest.mark.slow
def test_a_compiler_that_fails_leaves_nothing(sources: Path):
    (sources / "text.c").write_text("no C")
    with pytest.raises(CompilationError, match=r"text\.c:1"):
        compile_runtime()
    assert [file for file in sources.rglob("bin/**/*") if file.is_file()] == []


@pytest.mark.slow
def test_two_processes_compile_at_once_to_the_bytes_that_any_folder_gives(sources: Path):
    root = str(RUNTIME.parents[1])
    call = [sys.executable, "-c", COMPILE, root, str(sources)]
    both = [subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) for _ in range(2)]
    line = {process.communicate(timeout=150)[0].strip() for process in both}
    assert [process.returncode for process in both] == [0, 0]
    assert line == {str(library(host_platform(), 3))}
    assert is_current(host_platform())
    made = [library(host_platform(), fmi) for fmi in (2, 3)]
    assert made[1].read_bytes() == (RUNTIME / made[1].relative_to(sources)).read_bytes()  # though it lies elsewhere
    expect_no_folder(made[1].read_bytes(), sources)
    names = {file.name for file in made[0].parent.iterdir()}
    assert names == {made[0].name, made[1].name, "sources.sha256", "libraries.sha256"}


@pytest.mark.usefixtures("sources", "no_compiler")
def test_without_a_compiler_the_extra_is_named_and_nothing_is_written(tmp_path: Path, wording: Wording):
    for platforms in (["aarch64-linux"], None):
        with pytest.raises(NotCompiled, match=r"pip install \"handover-cosim\[cross\]\""):
            binaries("Unit", 3, platforms)
    for platforms in ("all", "host,win64"):
        done = CliRunner().invoke(main, ["build", "Push", "--platform", platforms, "--out", str(tmp_path / "out")])
        assert done.exit_code == 2
        wording.check(done.output.splitlines()[-1])
        assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("sources", "compiled")
def test_the_command_compiles_what_it_is_asked_to_and_packs_that(tmp_path: Path):
    for asked, reported in (("x86_64-windows,aarch64-darwin,host", True), ("host", False)):
        done = CliRunner().invoke(main, ["build", "Push", "--fmi", "3", "--platform", asked, "--out", str(tmp_path)])
        assert done.exit_code == 0, done.output
        assert ("compiling the FMI runtime for x86_64-windows\n" in done.output) is reported
        assert ("compiling" in done.output) is reported
        with zipfile.ZipFile(tmp_path / "Push.fmi3.fmu") as archive:
            folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        assert folders == {host_platform() if name == "host" else name for name in asked.split(",")}
