"""Freezes the interpreter and the packages that a block imports, so that its FMU runs where there is no Python.

PyInstaller follows the imports and copies interpreter, packages and the libraries that they are linked to into a
folder, for the platform on which it runs. The runtime starts the program in it as the unit's process
(`runtime/bundled.c`); the block's own sources are in the FMU as in any other.
"""

import hashlib
import importlib.metadata
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from handover.cosim.files import scratch_folder
from handover.cosim.python_process import import_path, module_command
from handover.fmus.compile import cache_folder, host_platform, named_platforms
from handover.fmus.sources import Carried, distributions_by_module

PROGRAM = "unit.exe" if os.name == "nt" else "unit"
"""Name of the frozen program, in `resources/standalone/PLATFORM`; also in `runtime/bundled.c`."""

_UNWANTED = ("tkinter", "turtle", "idlelib", "lib2to3", "unittest", "pydoc", "readline", "curses", "ensurepip", "venv")
"""Of the standard library: for the console, for windows, for developers."""

_STANDARD = (
    *("base64", "bisect", "cmath", "csv", "datetime", "decimal", "fractions", "hashlib", "heapq", "json", "logging"),
    *("mmap", "random", "runpy", "secrets", "signal", "socket", "statistics", "string", "tempfile", "threading"),
    "traceback",
)
"""Of the standard library, whether a unit imports it or not: so units with the same packages share what is frozen."""

_FOLLOWED = "modules_of_a_unit"
"""Name of a module that imports what is to be frozen, for PyInstaller to follow; nothing imports it itself."""

_MAIN = Path(__file__).with_name("program.py")
_IMPORTED = Path(__file__).with_name("imported_modules.py")


class CannotFreeze(RuntimeError):
    """A unit cannot be given its interpreter; the message says why, and what would be right."""


def check_standalone(platforms: Sequence[str] | None) -> None:
    """Check that standalone units can be built here, for platforms by the names that `named_platforms` takes.

    Raises:
        CannotFreeze: a platform is another one than this machine's, or PyInstaller is not installed.
        UnknownPlatform: there is no such platform.
    """
    own = host_platform()
    others = [name for name in named_platforms(platforms or ("host",)) if name != own]
    if others:
        reason = "since PyInstaller copies the interpreter and the libraries of the machine on which it runs"
        raise CannotFreeze(
            f"an interpreter can be frozen for this machine's platform only, {own}, {reason}; "
            f"build the unit for {', '.join(others)} on such a machine"
        )
    _freezer_versions()


def frozen(block: str, carried: Carried) -> Mapping[str, bytes]:
    """Return the files of the frozen interpreter with a block's packages, by their paths below `resources`.

    They are kept in the cache, by the names and versions of what is frozen: many units share them.

    Raises:
        CannotFreeze: PyInstaller is not installed, or it fails.
    """
    names = _imported(block, carried)
    folder = cache_folder().absolute() / "frozen" / _key(names, carried)
    if not folder.is_dir():
        _freeze(names, carried, folder)
    top = f"standalone/{host_platform()}"
    return {f"{top}/{path}": content for path, content in _contents(folder).items()}


def _key(names: Sequence[str], carried: Carried) -> str:
    """Return a hash of what is frozen: names of modules, and versions of the packages that they are of and require."""
    found = _distributions(names) | _with_requirements(package.distribution for package in carried.packages())
    versions = sorted(f"{name}=={importlib.metadata.version(name)}" for name in found)
    parts = [names, versions, sys.version, host_platform(), _freezer_versions(), _MAIN.read_text(encoding="utf-8")]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]


def _contents(folder: Path) -> dict[str, bytes]:
    """Return the files in a frozen folder by their paths in it.

    Tools that unpack FMUs make no symbolic links: what a link leads to stands in its place. A library in a folder such
    as `numpy.libs`, which only the dynamic linker reads, then stands there alone: the linker looks there, too.

    Raises:
        CannotFreeze: a link leads nowhere, or to a folder that contains it.
    """
    files: dict[Path, Path] = {}
    moved: set[Path] = set()
    for place, folders, names in os.walk(folder, followlinks=True):
        for path in (Path(place, name) for name in (*folders, *names)):
            target = path.resolve()
            if path.is_symlink() and (not target.exists() or path.is_relative_to(target)):
                leads = f"the symbolic link {path.relative_to(folder)} to {os.readlink(path)}"
                raise CannotFreeze(f"PyInstaller has made {leads}, which is not a file that an FMU can contain")
            if path.is_symlink() and target.name == path.name and target.parent.name.endswith((".libs", ".dylibs")):
                moved.add(target)
            if target.is_file():
                files[path] = target
    kept = ((path, target) for path, target in files.items() if path.is_symlink() or path.resolve() not in moved)
    return {path.relative_to(folder).as_posix(): target.read_bytes() for path, target in kept}


def _imported(block: str, carried: Carried) -> list[str]:
    """Return the names of the modules that a block imports, but for those that its FMU contains as sources.

    Those count, too, that a function imports as it is called: its sources name them.
    """
    with scratch_folder("imports") as scratch:
        result = Path(scratch, "modules.json")
        command = [sys.executable, str(_IMPORTED), block, json.dumps(import_path()), str(result)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode != 0 or not result.is_file():
            why = done.stderr.strip() or f"the interpreter ends with exit status {done.returncode}"
            raise CannotFreeze(f"{block} cannot be imported: {why}")
        modules: list[str] = json.loads(result.read_text(encoding="utf-8"))
    tops = {path.partition("/")[0].removesuffix(".py") for path in carried.files}
    own = {*tops, "__main__"}
    modules += [name for name in carried.imported if _findable(name)]
    names = {*_STANDARD, *(name for name in modules if name.partition(".")[0] not in own)}
    return sorted(name for name in names if not (name.startswith("_") and name in sys.stdlib_module_names))


def _findable(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError, AttributeError):
        return False


def _freezer_versions() -> list[str]:
    """Return the versions of PyInstaller and of its hooks, which decide what goes along with a package."""
    try:
        return [importlib.metadata.version(name) for name in ("pyinstaller", "pyinstaller-hooks-contrib")]
    except importlib.metadata.PackageNotFoundError:
        raise CannotFreeze('PyInstaller is not installed. Cure: pip install "handover-cosim[standalone]"') from None


def _freeze(names: Sequence[str], carried: Carried, folder: Path) -> None:
    """Make the folder of the frozen program, whole or not at all."""
    with scratch_folder("freezing") as scratch:
        main = str(shutil.copy(_MAIN, Path(scratch, "unit.py")))
        imports = "\n".join(f"import {name}" for name in names if _findable(name))
        Path(scratch, f"{_FOLLOWED}.py").write_text(imports, encoding="utf-8")
        options = ["--noconfirm", "--onedir", "--log-level", "ERROR", "--name", "unit"]
        options += ["--distpath", f"{scratch}/made", "--workpath", f"{scratch}/work", "--specpath", str(scratch)]
        options += ["--paths", str(scratch), "--hidden-import", _FOLLOWED]
        for package in carried.packages():
            options += ["--copy-metadata", package.distribution]
        for unwanted in _unwanted(names):
            options += ["--exclude-module", unwanted]
        command = module_command("PyInstaller", *options, main)
        environment = {**os.environ, "PYINSTALLER_CONFIG_DIR": f"{scratch}/config", "PYTHONHASHSEED": "1"}
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, env=environment)
        made = Path(scratch, "made", "unit")
        if done.returncode != 0 or not (made / PROGRAM).is_file():
            last = "\n".join(done.stderr.strip().splitlines()[-3:])
            raise CannotFreeze(f"PyInstaller has failed: {last}")
        try:
            _place(made, folder)
        except OSError as e:
            why = e.args[0][0][-1] if isinstance(e, shutil.Error) else e  # it lists all files
            cure = "make room there, or name another folder by HANDOVER_CACHE"
            raise CannotFreeze(f"what PyInstaller has made cannot be kept in {folder.parent}: {why}; {cure}") from e


def _place(made: Path, folder: Path) -> None:
    """Copy the folder of the frozen program into the cache, whole or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        shutil.copytree(made, part / "unit", symlinks=True)
        os.rename(part / "unit", folder)
    except OSError:
        if not folder.is_dir():  # else another process has made it meanwhile
            raise
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _unwanted(names: Sequence[str]) -> list[str]:
    """Return the environment's top-level modules that the block has no use for, and what no unit needs.

    What a package requires is kept: it may import that as late as in some step.
    """
    wanted = {name.partition(".")[0] for name in names}
    kept = _distributions(names)
    tops: set[str] = set(_UNWANTED)
    for distribution in importlib.metadata.distributions():
        modules = {
            file.parts[0].partition(".")[0] if len(file.parts) == 1 else file.parts[0]
            for file in distribution.files or ()
        }
        (wanted if _normalised(distribution.metadata["Name"]) in kept else tops).update(modules)
    return sorted(top for top in tops if top.isidentifier() and top not in wanted)


def _distributions(names: Sequence[str]) -> set[str]:
    """Return the distributions that modules are of, and those that these require."""
    by_module = distributions_by_module()
    return _with_requirements(name for module in names for name in by_module.get(module.partition(".")[0], ()))


def _with_requirements(distributions: Iterable[str]) -> set[str]:
    """Return names of distributions and of those that they require without extras, where these are installed."""
    found: set[str] = set()
    left = [_normalised(name) for name in distributions]
    while left:
        name = left.pop()
        if name in found:
            continue
        try:
            requirements = importlib.metadata.requires(name) or ()
        except importlib.metadata.PackageNotFoundError:  # of another platform or version of Python
            continue
        found.add(name)
        asked = (re.match(r"[\w.-]+", text) for text in requirements if not re.search(r";.*\bextra\b", text))
        left += [_normalised(match[0]) for match in asked if match]
    return found


def _normalised(name: str) -> str:
    """Return a distribution's name in the form in which names are compared."""
    return re.sub(r"[-_.]+", "-", name).lower()
