"""Units that do one thing wrong: FMUs of both standards from `units/by_name`, by the names of fault and call."""

import functools
import hashlib
import os
import tempfile
import zipfile
from pathlib import Path

import fmpy

from handover.cosim.fmu.file.fmpy_edge import library_path
from handover.fmus.compile import TARGETS, cache_folder, host_platform, zig_cc
from support.cosim.native_declaration import Declaration, read_declarations
from support.cosim.native_description import description
from support.cosim.native_units import HEADERS, SOURCES

_SOURCE = Path(__file__).parents[2] / "faults" / "units" / "by_name" / "faults.c"
_FRAME = [SOURCES / "frame" / name for name in ("unit.c", "fmi3_refused.c", "unit.h", "fmi2.c", "fmi3.c")]


def faulty_fmu(name: str, fmi: int, folder: Path, *, blob: bool = False) -> Path:
    """Write the FMU of a unit whose library has a name, `FAULT_in_CALL`, or another if it is sound; return its file."""
    declared = _declarations()["with_blob" if blob else "integrator"]
    sound = description(declared, fmi, declared.step, True, {})
    described = sound.replace(f'modelIdentifier="{declared.name}"', f'modelIdentifier="{name}"')
    assert described != sound
    file = folder / f"{name}.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", described)
        archive.write(_library(), library_path(fmi, name))
    return file


@functools.cache
def _declarations() -> dict[str, Declaration]:
    return {d.name: d for d in read_declarations(_library())}


@functools.cache
def _library() -> Path:
    digest = hashlib.sha256(fmpy.__version__.encode())
    for source in (_SOURCE, *_FRAME):
        digest.update(source.read_bytes())
    file = cache_folder() / "native-units" / f"faults-{digest.hexdigest()[:16]}{TARGETS[host_platform()][1]}"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent) as scratch:
            made = Path(scratch) / file.name
            flags = ["-target", TARGETS[host_platform()][0], "-shared", "-fPIC", "-O1", "-std=c11", "-Wall", "-Werror"]
            sources = [str(s) for s in (_SOURCE, *_FRAME[:2])]
            places = ["-I", str(HEADERS), "-I", str(SOURCES), "-I", str(SOURCES / "frame")]
            done = zig_cc([*flags, "-Wno-infinite-recursion", *places, *sources, "-lm", "-ldl", "-o", str(made)])
            assert done.returncode == 0, done.stdout
            os.replace(made, file)
    return file
