"""A foreign FMU in plain C, see decay.c, as a whole or with one thing spoilt."""

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy

from handover.fmus.compile import TARGETS, host_platform, zig_cc

MODES: tuple[str, ...] = (
    "sound",
    "aborts",
    "segmentation_fault",
    "not_a_number",
    "answers_error",
    "discards",
    "forgets_in_state",
    "hangs",
    "exits",
    "shares_memory",
    "does_not_reset",
    "out_of_range",
)
HEADERS = Path(fmpy.__file__).parent / "c-code"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Decay" guid="decay" variableNamingConvention="structured">
  <CoSimulation modelIdentifier="Decay" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    canSerializeFMUstate="true"/>
  <UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/></Unit>
  </UnitDefinitions>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.1"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="local" variability="continuous"><Real unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input" variability="continuous"><Real start="0" unit="m"/>
    </ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output" variability="continuous"><Real unit="m" max="100"/>
    </ScalarVariable>
    <ScalarVariable name="mode" valueReference="0" causality="parameter" variability="fixed">
      <Integer start="0" min="0" max="11"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="3" dependencies=""/></Outputs>
    <InitialUnknowns><Unknown index="3" dependencies=""/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
LIBRARY = f"binaries/{fmpy.platform}/Decay{fmpy.sharedLibraryExtension}"


def compiled(folder: Path, *flags: str) -> bytes:
    """Compile decay.c."""
    made = folder / "Decay.so"
    source = Path(__file__).with_name("decay.c")
    compile_c(["-shared", "-fPIC", "-O1", "-w", "-I", str(HEADERS), str(source), "-lm", "-o", str(made), *flags])
    return made.read_bytes()


def compile_c(arguments: Sequence[str]) -> None:
    """Compile for the platform that the runtime is compiled for, so that the compiler makes one C library ready."""
    done = zig_cc(["-target", TARGETS[host_platform()][0], *arguments])
    assert done.returncode == 0, done.stdout


def pack(file: Path, library: bytes, description: str = DESCRIPTION, others: Mapping[str, bytes] | None = None) -> Path:
    """Write an FMU."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(LIBRARY, library)
        for name, content in (others or {}).items():
            archive.writestr(name, content)
    return file


def spoilt(mode: str) -> str:
    """Return the description of a unit that spoils one thing."""
    return edited(('<Integer start="0"', f'<Integer start="{MODES.index(mode)}"'))


def edited(*edits: Sequence[str]) -> str:
    """Return the description with texts replaced, each of which must be there."""
    description = DESCRIPTION
    for old, new in edits:
        assert old in description, old
        description = description.replace(old, new)
    return description
