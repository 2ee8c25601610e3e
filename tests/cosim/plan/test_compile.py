"""The plan's library is compiled where it is missing or out of date, and for every platform that the package is for."""

import shutil
from pathlib import Path

import pytest

from handover.cosim.native_libraries import TARGETS, CompilationError, NativeLibraries, host_platform, zig_cc
from handover.cosim.plan import compile as plan_compile
from handover.cosim.plan.compile import FOLDER, SOURCES, plan_library


def libraries(folder: Path) -> NativeLibraries:
    """Return the libraries of a copy of the sources, of which nothing is compiled."""
    shutil.copytree(FOLDER, folder, ignore=shutil.ignore_patterns("bin", "*.py", "__pycache__"))
    (folder / "unused.h").write_text(f"/* {folder} */")  # so that no cache has libraries of these sources
    return NativeLibraries("master's plan", "plan", folder, {"plan": SOURCES}, zig_cc)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_it_compiles_for_every_platform(target: str, tmp_path: Path):
    made = libraries(tmp_path / "plan")
    assert not made.is_current(target)
    made.compile(target)
    assert made.is_current(target)
    content = made.library(target, "plan").read_bytes()
    assert all(name in content for name in (b"plan_arrive", b"plan_depart", b"plan_run", b"plan_time"))
    (made.folder / "plan.h").write_text("/* other */")
    assert not made.is_current(target)


def test_what_the_compiler_says_is_reported_and_nothing_is_left(tmp_path: Path):
    made = libraries(tmp_path / "plan")
    (made.folder / "exact_time.c").write_text("double exact_time(int ticks { }")
    with pytest.raises(CompilationError, match=r"(?s)the master's plan does not compile for .*exact_time\.c:1"):
        made.compile(host_platform())
    assert list((made.folder / "bin" / host_platform()).iterdir()) == []


def test_without_a_compiler_there_is_what_was_compiled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    assert plan_library() is not None
    made = libraries(tmp_path / "plan")
    monkeypatch.setattr(plan_compile, "FOLDER", made.folder)
    monkeypatch.setattr(plan_compile, "has_compiler", lambda: False)
    assert plan_library() is None
