"""What goes into a frozen folder and into the FMU, without freezing anything."""

import errno
import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from handover.fmus.compile import host_platform
from handover.fmus.sources import Carried
from handover.fmus.standalone import freezer, program, smoke_test
from handover.fmus.standalone.freezer import (
    PROGRAM,
    CannotFreeze,
    _contents,  # type: ignore
    _freeze,  # type: ignore
    _imported,  # type: ignore
    _key,  # type: ignore
    _unwanted,  # type: ignore
)

NOTHING = Carried({}, ())
PRINTS = """import atexit, ctypes, os
atexit.register(print, "at exit")
ctypes.CDLL(None).printf(b"printed in C, which is flushed at the end\\n")
os.write(1, b"\\xff is not UTF-8\\n"), os.write(2, b"\\xff\\n")
"""
"""A package that prints."""
LOADER = """
class Missing(Exception):
    missing = ("typing_extensions",)

class Refusal(Exception):
    is_refusal = True

class Slave:
    _clock = [0.0, 0.0]

    def initialise(self): ...

    def step(self):
        {step}

def start(resources, token):
    return Slave()

def explain(error):
    return str(error)
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links and scripts")


_installed = functools.cache(freezer.distributions_by_module)
"""Which takes seconds."""


@pytest.fixture(autouse=True)
def of_all_installed_asked_once(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(freezer, "distributions_by_module", _installed)


@pytest.fixture
def frozen(tmp_path: Path) -> Path:
    """Return a frozen folder: a package's libraries, and one in the package's own folder."""
    folder = tmp_path / "frozen"
    for name in ("unit", "_internal/numpy.libs/libblas.so", "_internal/llvm/libllvm.so"):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    return folder


def test_what_links_lead_to_stands_in_their_places(frozen: Path):
    (frozen / "_internal/libblas.so").symlink_to("numpy.libs/libblas.so")
    (frozen / "_internal/libllvm.so").symlink_to("llvm/libllvm.so")
    (frozen / "_internal/Current").symlink_to("llvm")
    blas, llvm = b"_internal/numpy.libs/libblas.so", b"_internal/llvm/libllvm.so"
    assert _contents(frozen) == {
        "unit": b"unit",
        "_internal/libblas.so": blas,
        "_internal/llvm/libllvm.so": llvm,
        "_internal/libllvm.so": llvm,
        "_internal/Current/libllvm.so": llvm,
    }


@pytest.mark.parametrize("target", ["nothing", "..", "../.."])
def test_a_link_that_leads_nowhere_or_to_where_it_lies_is_refused(frozen: Path, target: str):
    (frozen / "_internal/link").symlink_to(target)
    with pytest.raises(CannotFreeze, match=f"the symbolic link _internal/link to {target},"):
        _contents(frozen)


def test_another_version_of_a_package_that_another_one_imports_is_frozen_anew(monkeypatch: pytest.MonkeyPatch):
    versions = {"direct": "1.0", "indirect": "1.0", "required": "1.0", "not imported": "1.0"}
    monkeypatch.setattr(freezer, "distributions_by_module", lambda: {name: [name] for name in versions})
    monkeypatch.setattr(
        freezer.importlib.metadata,
        "requires",
        lambda name: {"direct": ["Required>=1", "not_imported; extra == 'all'"]}.get(name),  # type: ignore
    )
    monkeypatch.setattr(freezer.importlib.metadata, "version", lambda name: versions.get(name, "6"))  # type: ignore

    def key() -> str:
        return _key(["direct", "indirect.part"], NOTHING)

    before = key()
    versions["not imported"] = "2.0"
    assert key() == before
    for name in ("indirect", "required"):
        versions[name] = "1.1"
        assert key() != before
        before = key()


def test_what_a_package_requires_is_not_left_out_of_what_is_frozen():
    left_out = _unwanted(["matplotlib"])
    assert "pytest" in left_out
    assert not {"matplotlib", "cycler", "dateutil", "numpy", "six"} & set(left_out)


def test_what_is_imported_is_found_whatever_a_package_prints_but_for_how_this_machine_finds_its_installations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "__editable___own_1_0_finder.py").touch()
    (tmp_path / "needed.py").touch()
    imports = "import _distutils_hack, __editable___own_1_0_finder, needed\n"
    (tmp_path / "own.py").write_text(f"{imports}{PRINTS}\nclass Own: ...\n")
    (tmp_path / "_distutils_hack").mkdir()
    (tmp_path / "_distutils_hack" / "__init__.py").touch()
    (tmp_path / "ending.py").write_text("import os\nos._exit(0)\n")
    monkeypatch.syspath_prepend(tmp_path)  # type: ignore
    names = _imported("own:Own", NOTHING)
    assert {"needed", "atexit"} <= {*names}
    assert not [name for name in names if name.startswith(("__editable__", "_distutils_hack"))]
    with pytest.raises(CannotFreeze, match="ending:Own cannot be imported: the interpreter ends with exit status 0"):
        _imported("ending:Own", NOTHING)


def test_a_full_disk_leaves_nothing_in_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def run(command: Sequence[str], **_options: Any) -> subprocess.CompletedProcess[str]:
        made = Path(command[command.index("--distpath") + 1], "unit")
        made.mkdir(parents=True)
        (made / PROGRAM).write_text("program")
        return subprocess.CompletedProcess(command, 0, "", "")

    def copy(*_files: object, **_options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    copytree = shutil.copytree
    monkeypatch.setattr(freezer.subprocess, "run", run)
    monkeypatch.setattr(freezer.shutil, "copytree", lambda *a, **k: copytree(*a, **k, copy_function=copy))  # type: ignore
    with pytest.raises(CannotFreeze, match=f"cannot be kept in {tmp_path}: .*No space left.*HANDOVER_CACHE"):
        _freeze([], NOTHING, tmp_path / "key")
    assert not list(tmp_path.iterdir())


def test_a_unit_that_does_not_come_to_its_end_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(smoke_test, "LIMIT", 0.2)
    program = {f"resources/standalone/{host_platform()}/unit": b"#!/bin/sh\nexec sleep 60\n"}
    with pytest.raises(CannotFreeze, match=r"Push: it has not started and stepped once in 0\.2 s"):
        smoke_test.try_unit("Push", program, "{token}", 0.01)


STEPS = {
    "pass": "",
    "open(__file__.replace('loader.py', 'table.csv'))": r"it opens handover/fmus/table\.csv, which the FMU does",
    "open({elsewhere!r})": r"it opens files that only this machine has: .*table\.csv",
    "raise Missing('typing_extensions')": "package typing_extensions cannot be frozen: PyInstaller has left it out",
    "import no_such_module.part": "package no_such_module cannot be frozen: No module named",
    "raise ValueError('why')": "it fails in its frozen interpreter: why",
    "raise Refusal": "",
}
"""By what a unit does in its step: how it is refused."""


@pytest.mark.parametrize("step", STEPS)
def test_what_a_unit_does_as_it_steps_is_judged_whatever_its_packages_print(tmp_path: Path, step: str):
    (tmp_path / "table.csv").touch()
    script = f'#!/bin/sh\nexec "{sys.executable}" "{program.__file__}" "$@"\n'
    loader = PRINTS + LOADER.replace("{step}", step.format(elsewhere=str(tmp_path / "table.csv")))
    contents = {
        f"resources/standalone/{host_platform()}/unit": script.encode(),
        "resources/sources/handover/fmus/loader.py": loader.encode(),
    }
    if STEPS[step]:
        with pytest.raises(CannotFreeze, match=f"Push: {STEPS[step]}"):
            smoke_test.try_unit("Push", contents, "{token}", 0.01)
    else:
        smoke_test.try_unit("Push", contents, "{token}", 0.01)
