"""Hosts in C for other platforms than this machine's, and what they must find in a unit there."""

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy

from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.build import build
from handover.fmus.catalog import Entry
from handover.fmus.compile import RUNTIME, TARGETS, library, zig_cc

HEADERS = Path(fmpy.__file__).parent / "c-code"
PROTOTYPE = r"typedef\s+([\w*\s]+?)\s+(fmi{fmi}\w+)TYPE\s*\(([^)]*)\);"


def functions(fmi: int) -> list[str]:
    """Return the names of a standard's functions, from its official header."""
    text = (HEADERS / f"fmi{fmi}Functions.h").read_text()
    return re.findall(rf"FMI{fmi}_Export\s+\w+TYPE\s+(\w+);", text)


@dataclass(frozen=True)
class Unpacked:
    """An FMU of a platform in a folder of its own."""

    folder: Path
    fmi: int
    target: str
    entry: Entry

    @property
    def library(self) -> Path:
        folder = FMI2_FOLDERS[self.target] if self.fmi == 2 else self.target
        return self.folder / "binaries" / folder / f"{self.entry.name}{library(self.target, self.fmi).suffix}"

    @property
    def token(self) -> str:
        root = ET.parse(self.folder / "modelDescription.xml").getroot()
        return root.attrib["guid" if self.fmi == 2 else "instantiationToken"]


def unpack(entry: Entry, fmi: int, target: str, folder: Path) -> Unpacked:
    """Build a unit for one platform and unpack it."""
    unpacked = folder / "an unpacked FMU"
    with zipfile.ZipFile(build(entry, fmi, folder, platforms=[target])) as archive:
        archive.extractall(unpacked)
    return Unpacked(unpacked, fmi, target, entry)


def compiled_host(fmi: int, target: str, folder: Path) -> Path:
    """Compile foreign_host.c for a platform."""
    (folder / "calls.h").write_text("\n".join(calls(fmi)) + "\n")
    made = folder / ("host.exe" if target.endswith("windows") else "host")
    source = Path(__file__).with_name("foreign_host.c")
    compile_program(source, made, target, f"-DFMI={fmi}", "-I", str(RUNTIME), "-I", str(folder))
    return made


def compile_program(source: Path, made: Path, target: str, *flags: str) -> None:
    arguments = ["-O1", "-s", "-std=gnu99", "-target", TARGETS[target][0], *flags, str(source), "-o", str(made)]
    done = zig_cc(arguments if target.endswith("windows") else [*arguments, "-ldl"])
    assert done.returncode == 0, done.stdout


def calls(fmi: int) -> list[str]:
    """Return a line of C for each function that takes an instance: called with none, and with zeros besides."""
    text = (HEADERS / f"fmi{fmi}FunctionTypes.h").read_text()
    made: list[str] = []
    for returned, name, arguments in re.findall(PROTOTYPE.replace("{fmi}", str(fmi)), text):
        kinds = [a.split()[0] for a in arguments.split(",")]
        if kinds[0] in ("fmi2Component", "fmi3Instance"):
            macro = "CALL" if returned == f"fmi{fmi}Status" else "CALL_VOID"
            made.append(f"{macro}({', '.join([name] + ['0'] * len(kinds))})")
    return made


def expect_clear_answers(output: str, fmi: int) -> None:
    """Check what the host printed where there is no Python."""
    made = {2: "fmi2Instantiate", 3: "fmi3InstantiateCoSimulation"}[fmi]
    assert output.count(f"{made}: no usable Python; tried in this order:") == 2
    assert output.count("instance: none") == 2
    assert "Cure: set the environment variable FMU_LIBPYTHON" in output
    assert re.findall(rf"(fmi{fmi}\w+) returned", output) == [f"fmi{fmi}FreeInstance"]
    answers = dict(re.findall(rf"(fmi{fmi}\w+) = (-?\d+)", output))
    constructors = [n for n in functions(fmi) if "Instantiate" in n or n.endswith(("GetVersion", "GetTypesPlatform"))]
    assert sorted([*answers, *constructors, f"fmi{fmi}FreeInstance"]) == sorted(functions(fmi))
    assert {name: status for name, status in answers.items() if status != "3"} == {}
    assert output.rstrip().endswith("closed: 0")
