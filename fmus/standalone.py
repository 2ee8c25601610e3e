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
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from handover.fmus.compile import cache_folder, host_platform
from handover.fmus.sources import Carried

PROGRAM = "unit.exe" if os.name == "nt" else "unit"
"""Name of the frozen program, in `resources/standalone/PLATFORM`; also in `runtime/bundled.c`."""

_UNWANTED = ("tkinter", "turtle", "idlelib", "lib2to3", "unittest", "pydoc", "readline", "curses", "ensurepip", "venv")
"""Of the standard library: for the console, for windows, for developers."""

_STANDARD = (
    *("base64", "bisect", "cmath", "csv", "datetime", "decimal", "fractions", "hashlib", "heapq", "json", "logging"),
    *(
        "mmap",
        "random",
        "runpy",
        "secrets",
        "signal",
        "socket",
        "statistics",
        "string",
        "tempfile",
        "threading",
        "traceback",
    ),
)
"""Of the standard library, whether a unit imports it or not: so units with the same packages share what is frozen."""

_IMPORTED = """
import importlib, json, sys
block, sys.path = sys.argv[1], json.loads(sys.argv[2])
module, _, name = block.partition(":")
for deferred in getattr(getattr(importlib.import_module(module), name), "deferred", ()):
    importlib.import_module(deferred)
print(json.dumps(sorted(n for n in sys.modules if all(part.isidentifier() for part in n.split(".")))))
"""
"""Prints the names of all modules that a block imports."""

_MAIN = '''"""Runs the script that it is given, or tries a unit: with --try RESOURCES TOKEN STEP."""

import sys


def _needed():
    """Never called: what the freezer follows."""
{imports}


def _try(resources, token, step):
    import json, os, runpy

    opened = set()
    scratch = os.path.dirname(resources)
    own = tuple(os.path.realpath(folder) + os.sep for folder in (scratch, sys.prefix, sys._MEIPASS))
    systems = ("/proc/", "/sys/", "/dev/", "/etc/", "/usr/share/", "/System/", "/Library/")

    def note(event, arguments):
        if event == "open" and isinstance(arguments[0], str) and not arguments[2] & (os.O_WRONLY | os.O_RDWR):
            path = os.path.realpath(arguments[0])
            if os.path.isfile(path) and not path.startswith(own + systems):
                opened.add(path)

    loader = runpy.run_path(os.path.join(resources, "sources", "handover", "fmus", "loader.py"), run_name="fmu_loader")
    sys.addaudithook(note)
    fault, slave = {{}}, None
    try:
        slave = loader["start"](resources, token)
        slave.initialise()
        slave._clock[:] = 0.0, float(step)
        slave.step()
    except BaseException as e:
        rejects_start_values = slave is not None and getattr(e, "is_refusal", False)
        cause = e.__cause__ or e
        package = (getattr(cause, "name", None) or "").partition(".")[0] if isinstance(cause, ImportError) else ""
        lacks = cause.filename if isinstance(cause, FileNotFoundError) else None
        if package or lacks or not rejects_start_values:
            fault = dict(package=package, lacks=lacks, error=loader["explain"](e))
    print(json.dumps(dict(fault=fault, opened=sorted(opened))))


if sys.argv[1] == "--try":
    _try(*sys.argv[2:])
else:
    import runpy

    runpy.run_path(sys.argv[1], run_name="__main__")
'''


class CannotFreeze(RuntimeError):
    """A unit cannot be given its interpreter; the message says why, and what would be right."""


def frozen(block: str, carried: Carried) -> Mapping[str, bytes]:
    """Return the files of the frozen interpreter with a block's packages, by their paths below `resources`.

    They are kept in the cache, by the names and versions of what is frozen: many units share them.

    Raises:
        CannotFreeze: PyInstaller is not installed, or it fails.
    """
    names = _imported(block, carried)
    versions = sorted({f"{p.distribution}=={p.version}" for p in carried.packages()})
    key = json.dumps([names, versions, sys.version, host_platform(), _freezer_version(), _MAIN])
    folder = cache_folder().absolute() / "frozen" / hashlib.sha256(key.encode()).hexdigest()[:32]
    if not folder.is_dir():
        _freeze(names, carried, folder)
    top = f"standalone/{host_platform()}"
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {f"{top}/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in files}


def try_unit(name: str, files: Mapping[str, bytes], token: str, step: float) -> None:
    """Start a unit in its frozen interpreter and let it step once, with its start values.

    Args:
        name: of the unit.
        files: of its FMU, by their paths.
        token: of its model description.
        step: communication step, s.

    Raises:
        CannotFreeze: a package or a data file is missing, or it opens files that only this machine has.
    """
    with tempfile.TemporaryDirectory(prefix="handover-frozen-") as scratch:
        for path, content in files.items():
            if path.startswith("resources/"):
                file = Path(scratch, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
        resources = Path(scratch, "resources")
        program = resources / "standalone" / host_platform() / PROGRAM
        program.chmod(0o755)
        given = ["--try", str(resources), token, repr(step)]
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "LD_", "DYLD_"))}
        kept |= dict.fromkeys(("HOME", "XDG_CACHE_HOME", "MPLCONFIGDIR", "HANDOVER_CACHE"), scratch)
        done = subprocess.run([program, *given], capture_output=True, text=True, check=False, env=kept, cwd=scratch)
        if done.returncode != 0:
            raise CannotFreeze(f"{name}: its frozen interpreter does not run: {done.stderr.strip()}")
        _judge(name, json.loads(done.stdout.splitlines()[-1]), resources)


def _judge(name: str, found: Mapping[str, Any], resources: Path) -> None:
    fault = found["fault"]
    if fault and fault["package"]:
        raise CannotFreeze(f"{name}: package {fault['package']} cannot be frozen: {fault['error']}")
    if fault and fault["lacks"]:
        place = Path(fault["lacks"])
        sources = resources / "sources"
        lacks = place.relative_to(sources) if place.is_relative_to(sources) else place
        raise CannotFreeze(f"{name}: it opens {lacks}, which the FMU does not have; list it with --include")
    if fault:
        raise CannotFreeze(f"{name}: it fails in its frozen interpreter: {fault['error']}")
    if found["opened"]:
        listed = ", ".join(found["opened"][:5])
        remedy = "open them beside the module, by its __file__, and list them with --include"
        raise CannotFreeze(f"{name}: it opens files that only this machine has: {listed}; {remedy}")


def _imported(block: str, carried: Carried) -> list[str]:
    """Return the names of the modules that a block imports, but for those that its FMU contains as sources.

    Those count, too, that a function imports as it is called: its sources name them.
    """
    command = [sys.executable, "-c", _IMPORTED, block, json.dumps(sys.path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CannotFreeze(f"{block} cannot be imported: {done.stderr.strip()}")
    tops = {path.partition("/")[0].removesuffix(".py") for path in carried.files}
    modules: list[str] = json.loads(done.stdout.splitlines()[-1])
    own = {*tops, "__main__"}
    modules += [name for name in carried.imported if _findable(name)]
    names = {*_STANDARD, *(name for name in modules if name.partition(".")[0] not in own)}
    return sorted(name for name in names if not (name.startswith("_") and name in sys.stdlib_module_names))


def _findable(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError, AttributeError):
        return False


def _freezer_version() -> str:
    try:
        return importlib.metadata.version("pyinstaller")
    except importlib.metadata.PackageNotFoundError:
        raise CannotFreeze('PyInstaller is not installed. Cure: pip install "handover-cosim[standalone]"') from None


def _freeze(names: Sequence[str], carried: Carried, folder: Path) -> None:
    """Make the folder of the frozen program, whole or not at all."""
    with tempfile.TemporaryDirectory(prefix="handover-freezing-") as scratch:
        main = Path(scratch, "unit.py")
        imports = "\n".join(f"    import {name}" for name in names if _findable(name))
        main.write_text(_MAIN.format(imports=imports), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "PyInstaller",
            "--noconfirm",
            "--log-level",
            "ERROR",
            "--onedir",
            "--name",
            "unit",
        ]
        command += ["--distpath", f"{scratch}/made", "--workpath", f"{scratch}/work", "--specpath", scratch]
        for package in carried.packages():
            command += ["--copy-metadata", package.distribution]
        for unwanted in _unwanted(names):
            command += ["--exclude-module", unwanted]
        environment = {**os.environ, "PYINSTALLER_CONFIG_DIR": f"{scratch}/config", "PYTHONHASHSEED": "1"}
        done = subprocess.run([*command, str(main)], capture_output=True, text=True, check=False, env=environment)
        made = Path(scratch, "made", "unit")
        if done.returncode != 0 or not (made / PROGRAM).is_file():
            last = "\n".join(done.stderr.strip().splitlines()[-3:])
            raise CannotFreeze(f"PyInstaller has failed: {last}")
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        shutil.copytree(made, part / "unit", symlinks=True)
        try:
            os.rename(part / "unit", folder)
        except OSError:
            if not folder.is_dir():  # else another process has made it meanwhile
                raise
        finally:
            shutil.rmtree(part, ignore_errors=True)


def _unwanted(names: Sequence[str]) -> list[str]:
    """Return the environment's top-level modules that the block does not import, and what no unit needs."""
    wanted = {name.partition(".")[0] for name in names}
    tops: set[str] = set()
    for distribution in importlib.metadata.distributions():
        for file in distribution.files or ():
            top = file.parts[0].partition(".")[0] if len(file.parts) == 1 else file.parts[0]
            tops.add(top)
    return sorted(top for top in {*tops, *_UNWANTED} if top.isidentifier() and top not in wanted)
