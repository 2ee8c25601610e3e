"""Starts Python processes of ours: how their commands are made, so that they import the same code as this one.

`python -m` and `python -c` look for modules in the working directory before all else. A file there that is named like
a library's module, such as `json.py`, would be run in its place; and in a clone of a project of which another copy is
installed, a process would take the clone's modules, and the one that started it the installed ones. So the folders from
which this process imports are handed over, and nothing is imported before they are set.
"""

import contextlib
import functools
import os
import site
import sys
import sysconfig
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

_MODULE = "import runpy; runpy.run_module(sys.argv.pop(1), None, '__main__', True)"
_CODE = (
    "import sys; sys.path[:] = {path!r}; import handover; handover.__path__[1:] = {beside!r}; from"
    " handover.cosim.imported_elsewhere import ImportedElsewhere; ImportedElsewhere.install(); {code}"
)

SAFE_PATH = {"PYTHONSAFEPATH": "handover"}
"""Environment of Python processes that a library starts by `python -c`, which then leave the working directory out.

Python 3.10 does not know it. `without_safe_path` takes it away from the processes that these start."""


def module_command(name: str, *arguments: str) -> Sequence[str]:
    """Return the command that runs a module as `python -m NAME ARGUMENTS` does, from this process's modules."""
    return code_command(_MODULE, name, *arguments)


def code_command(code: str, *arguments: str) -> Sequence[str]:
    """Return the command that runs code as `python -c CODE ARGUMENTS` does, from this process's modules."""
    beside = list(sys.modules["handover"].__path__)[1:]  # of a clone that is not installed: setup.py's
    return [sys.executable, "-c", _CODE.format(path=import_path(), beside=beside, code=code), *arguments]


def import_path() -> list[str]:
    """Return this process's `sys.path`, with the working directory last where Python has put it first by itself.

    It stays where it is if this package lies in it, as in a clone that is not installed.
    """
    if "" not in sys.path:
        return list(sys.path)
    here, package = os.getcwd(), os.path.realpath(str(sys.modules["handover"].__file__))
    if os.path.dirname(os.path.dirname(package)) == os.path.realpath(here):
        return list(sys.path)
    return [*(p for p in sys.path if p), here]


def without_safe_path() -> dict[str, str]:
    """Return the environment of a process that runs other people's code, without `SAFE_PATH` where we have set it."""
    return {name: value for name, value in os.environ.items() if (name, value) not in SAFE_PATH.items()}


@contextlib.contextmanager
def environment_changed(changes: Mapping[str, str]) -> Generator[None, None, None]:
    """Set variables of this process's environment, for processes that a library starts meanwhile."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def is_installed(path: Path) -> bool:
    """Return whether a file or folder lies where installers of this interpreter put packages.

    Another folder named `site-packages`, as in an archive of somebody else, is no such place.
    """
    return any(path.absolute().is_relative_to(folder) for folder in _installed_folders())


@functools.cache
def _installed_folders() -> frozenset[Path]:
    folders = {sysconfig.get_path(name) for name in ("purelib", "platlib")} | {*site.getsitepackages()}
    folders |= {site.getusersitepackages()} if site.ENABLE_USER_SITE else set()
    return frozenset(Path(folder) for folder in folders)
