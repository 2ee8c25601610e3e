"""Native test units: FMUs of both standards from small C sources, see `native/frame/unit.h`.

Those that do as they should are in `native/`, those with faults of other people's units in `tests/faults/units/`.

All sources are compiled into one library, which knows by the instantiation token what unit it is to be; each FMU holds
a copy of it. What is compiled and packed is kept in the cache folder, by the contents of the sources.
"""

import functools
import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy

from handover.cosim.fmu.file.fmpy_edge import library_path
from handover.fmus.compile import TARGETS, cache_folder, host_platform, zig_cc
from support.cosim.native_declaration import Declaration, read_declarations
from support.cosim.native_description import description

SOURCES = Path(__file__).parents[2] / "cosim" / "native"
FAULTS = Path(__file__).parents[2] / "faults" / "units"
HEADERS = Path(fmpy.__file__).parent / "c-code"
Edited = Callable[..., Path]
"""Takes a unit's name, the version of FMI, and pairs of texts of its description and what is to be there instead."""


def native_fmu(name: str, fmi: int = 3, *, step: float | None = None, dependencies: bool = True, **flags: bool) -> Path:
    """Return a native unit's FMU.

    `step` is the communication step that it proposes, if not the declared one; without `dependencies` its description
    leaves out what outputs depend on; `flags` are attributes of its co-simulation interface that are to be otherwise,
    such as `canGetAndSetFMUstate=False`.
    """
    declaration = declarations()[name]
    options = repr((name, fmi, step, dependencies, sorted(flags.items())))
    file = _folder() / f"{name}-{fmi}-{hashlib.sha256(options.encode()).hexdigest()[:12]}.fmu"
    if not file.is_file():
        text = description(declaration, fmi, step or declaration.step, dependencies, flags)
        _write_once(file, lambda part: _pack(part, fmi, name, text))
    return file


@functools.cache
def declarations() -> dict[str, Declaration]:
    """Return, by name, what the sources declare."""
    return {d.name: d for d in read_declarations(_library())}


@functools.cache
def _folder() -> Path:
    digest = hashlib.sha256(fmpy.__version__.encode())
    for source in [
        *sorted(SOURCES.rglob("*.[ch]")),
        *sorted(FAULTS.glob("*.c")),
        *sorted(Path(__file__).parent.glob("native_*.py")),
    ]:
        digest.update(source.name.encode() + source.read_bytes())
    folder = cache_folder() / "native-units" / digest.hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _library() -> Path:
    file = _folder() / f"units{TARGETS[host_platform()][1]}"
    if not file.is_file():
        _write_once(file, _compile)
    return file


def _compile(made: Path) -> None:
    sources = sorted(map(str, (*SOURCES.rglob("*.c"), *FAULTS.glob("*.c"))))
    target = TARGETS[host_platform()][0]
    flags = ["-target", target, "-shared", "-fPIC", "-O2", "-std=c11", "-Wall", "-Wextra", "-Werror"]
    lenient = ["-Wno-unused-parameter", "-Wno-missing-field-initializers"]
    done = zig_cc([*flags, *lenient, "-I", str(HEADERS), "-I", str(SOURCES), *sources, "-lm", "-o", str(made)])
    assert done.returncode == 0, done.stdout


def _write_once(file: Path, write: Callable[[Path], None]) -> None:
    """Let a file appear whole; another session may be making it too."""
    with tempfile.TemporaryDirectory(dir=file.parent) as scratch:
        part = Path(scratch) / file.name
        write(part)
        os.replace(part, file)


def _pack(file: Path, fmi: int, name: str, description: str) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(_library(), library_path(fmi, name))
