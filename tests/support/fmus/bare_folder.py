"""A folder that is entered as the root: the C library, a host in C, unpacked units, and nothing else."""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.compile import host_platform
from support.c_programs import compiled

HOST = Path(__file__).with_name("bare_host.c")
LIBRARIES = ("libc", "libm", "libdl", "libpthread", "librt", "libutil")
"""Of the C library, by the names before `.so`."""
KINDS = {"Float64": "f", "Real": "f", "Int64": "i", "Integer": "i", "Enumeration": "i", "Boolean": "b", "Binary": "p"}
"""The host's letters for types of FMI 2 and FMI 3."""


def can_be_entered() -> bool:
    """Return whether this process may change its root: it is the superuser's, on Linux, with glibc."""
    return os.name == "posix" and hasattr(os, "geteuid") and os.geteuid() == 0 and bool(_c_libraries())


def _c_libraries() -> list[Path]:
    """Return the files of the C library and the dynamic linker."""
    listed = subprocess.run(["ldconfig", "-p"], capture_output=True, text=True, check=False).stdout
    paths = [Path(p) for p in re.findall(r"libc6[^\n]* => (\S+)", listed)]
    wanted = {f"{name}.so" for name in LIBRARIES}
    chosen = {p.name: p for p in reversed(paths) if p.name.partition(".so")[0] + ".so" in wanted}
    return [*chosen.values(), *(p for p in Path("/lib64").glob("ld-linux*") if chosen)]


@dataclass(frozen=True)
class Stepped:
    """What a host printed: the outputs' bytes, a line a step, and its messages."""

    outputs: list[str]
    messages: str

    def figure(self, pattern: str) -> float:
        """Return the number in a message."""
        found = re.search(pattern, self.messages)
        assert found, self.messages
        return float(found[1])


class BareFolder:
    """The root folder.

    Args:
        path: a new folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        for library in _c_libraries():
            place = path / str(library).lstrip("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(library.resolve(), place)
        (path / "tmp").mkdir()
        shutil.copy(compiled(HOST), path / "host")

    def unpack(self, fmu: Path) -> Path:
        """Return the folder of an unpacked FMU."""
        folder = self.path / fmu.stem
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        return folder

    def step(
        self,
        unit: Path,
        dt: float,
        steps: int,
        instances: int = 1,
        *,
        inside: bool,
        environment: Mapping[str, str] | None = None,
    ) -> Stepped:
        """Step an unpacked unit in the host, in this folder as the root or outside of it."""
        root = ET.parse(unit / "modelDescription.xml").getroot()
        fmi = int(float(root.attrib["fmiVersion"]))
        name = root.find("CoSimulation").attrib["modelIdentifier"]  # type: ignore
        place = Path("/", unit.relative_to(self.path)) if inside else unit
        library = place / "binaries" / (FMI2_FOLDERS[host_platform()] if fmi == 2 else host_platform()) / f"{name}.so"
        resources = (place / "resources").as_uri() if fmi == 2 else str(place / "resources")
        token = root.attrib["guid" if fmi == 2 else "instantiationToken"]
        given = [str(fmi), str(library), resources, token, repr(dt), str(steps), str(instances), *_outputs(root)]
        command = self.entered("/host") if inside else [str(self.path / "host")]
        done = subprocess.run(
            [*command, *given], capture_output=True, text=True, check=False, env=environment or {}, timeout=300
        )
        assert done.returncode == 0, done.stderr
        return Stepped(done.stdout.splitlines(), done.stderr)

    def entered(self, program: str) -> list[str]:
        """Return the beginning of a command that runs one of the folder's programs with this folder as the root."""
        return [shutil.which("chroot") or "chroot", str(self.path), program]

    def add(self, file: Path, place: str) -> None:
        """Copy a program or a library of another host's to a place in the folder, with the libraries that it needs."""
        inside = self.path / place.lstrip("/")
        inside.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, inside)
        inside.chmod(0o755)
        folder = str(Path(sys.prefix) / "lib")  # Ecos' library is in a wheel of its own
        listed = subprocess.run(
            ["ldd", str(file)], capture_output=True, text=True, check=True, env={"LD_LIBRARY_PATH": folder}
        )
        for library in map(Path, re.findall(r"=> (/\S+)", listed.stdout)):
            if not list(self.path.glob(f"**/{library.name}")):
                (self.path / "lib").mkdir(exist_ok=True)
                shutil.copy(library.resolve(), self.path / "lib" / library.name)


def _outputs(root: ET.Element) -> list[str]:
    listed: list[str] = []
    for variable in root.iterfind("ModelVariables/*"):
        if variable.get("causality") == "output":
            kind = KINDS.get(variable.tag) or next(KINDS[child.tag] for child in variable if child.tag in KINDS)
            count = 1
            for dimension in variable.findall("Dimension"):
                count *= int(dimension.attrib["start"])
            listed.append(f"{kind}:{variable.attrib['valueReference']}:{count}")
    return listed
