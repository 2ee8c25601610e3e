"""Runs and other folders that commands write, made once for all tests and kept as long as what they depend on.

That is the product's code, the packages of this environment, and the command's arguments. They are kept in the virtual
environment that made them: a unit's bytes name its interpreter, so that those of another environment differ.
"""

import contextlib
import hashlib
import shutil
import sys
import time
from collections.abc import Generator
from functools import cache, partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import handover
from handover.cosim.files import FileLocked, lock_file
from support.commands import Command

_ROOT = Path(handover.__file__).resolve().parent.parent
_PRODUCT = ("controllers", "cosim", "fmus", "plants", "scenarios")
_KEPT = Path(sys.prefix) / "test-runs"
_MOST = 1800.0
"""Seconds that a run may take on a machine with much else to do; a handover takes half a minute alone."""

_KEPT_FOR = 86_400.0
"""Seconds for which runs of other code are kept, as of another branch."""


def kept_run(*arguments: str, before: tuple[Any, ...] = ()) -> Path:
    """Return the folder that `handover ARGUMENTS --out FOLDER` writes; it must not be changed.

    `kept_run("run", "ir_grasp")` has the record, figures and page, `kept_run("run", "ir_grasp", "--no-report")` neither
    figures nor page, at a third of the time. A run that is judged to have failed is one, too. `before`, if given, is a
    module's function with its arguments, which is called in the command's process first.
    """
    of_code = _KEPT / code_key()
    folder = of_code / hashlib.sha256(repr((arguments, *before[1:])).encode()).hexdigest()[:16]
    wanted = folder / arguments[1].rpartition("/")[2]
    of_code.mkdir(parents=True, exist_ok=True)
    with _locked(folder.with_suffix(".lock")):
        if not (folder / "whole").exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            first = partial(*before) if before else None
            done = Command(*arguments, "--out", wanted, cwd=folder, before=first).wait(_MOST)
            assert done.status in (0, 1), done.output + done.errors  # 1: the robot failed
            assert arguments[0] != "run" or (wanted / "summary.json").is_file(), done.output + done.errors
            (folder / "whole").touch()
    return wanted


def copied_run(target: Path, *arguments: str) -> Path:
    """Return a copy of `kept_run`, which may be changed."""
    return shutil.copytree(kept_run(*arguments), target)


@cache
def code_key() -> str:
    """Return what identifies product and environment; remove what has not been used for long."""
    digest = hashlib.sha256(sys.version.encode())
    digest.update(repr(sorted((d.name, d.version) for d in distributions())).encode())
    for room in _PRODUCT:
        for file in sorted((_ROOT / room).rglob("*")):
            if file.is_file() and not {"bin", "__pycache__"} & set(file.parts):
                digest.update(f"\0{file.relative_to(_ROOT)}\0".encode() + file.read_bytes())
    key = digest.hexdigest()[:16]
    (_KEPT / key).mkdir(parents=True, exist_ok=True)
    (_KEPT / key / "used").touch()
    for other in _KEPT.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - (other / "used").stat().st_mtime > _KEPT_FOR:
                shutil.rmtree(other, ignore_errors=True)
    return key


@contextlib.contextmanager
def _locked(path: Path) -> Generator[None, None, None]:
    """Wait until no other process makes the same run."""
    with path.open("ab") as file:
        while True:
            try:
                lock_file(file)
                break
            except FileLocked:
                time.sleep(0.1)
        yield
