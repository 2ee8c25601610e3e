"""The compiled libraries against the standards' own headers, which FMPy brings along."""

import re
from pathlib import Path

import fmpy

from handover.fmus.compile import RUNTIME, zig_cc

HEADERS = Path(fmpy.__file__).parent / "c-code"

TYPES = {
    2: "Component ComponentEnvironment FMUstate ValueReference Real Integer Boolean Char String Byte Status Type "
    "StatusKind CallbackFunctions EventInfo",
    3: "Instance InstanceEnvironment FMUState ValueReference Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 "
    "Int64 UInt64 Boolean Char String Byte Binary Clock Status DependencyKind IntervalQualifier",
}
ENUMERATORS = {
    2: "OK Warning Discard Error Fatal Pending ModelExchange CoSimulation DoStepStatus PendingStatus "
    "LastSuccessfulTime Terminated",
    3: "OK Warning Discard Error Fatal Independent Constant Fixed Tunable Discrete Dependent IntervalNotYetKnown "
    "IntervalUnchanged IntervalChanged",
}


def compiles(source: str, folder: Path) -> None:
    file = folder / "check.c"
    file.write_text(source)
    done = zig_cc(["-c", "-std=c11", "-I", str(RUNTIME), "-I", str(HEADERS), str(file), "-o", str(folder / "check.o")])
    assert done.returncode == 0, done.stdout


def test_declarations_agree_with_the_official_headers(tmp_path: Path):
    official = '#include "fmi2Functions.h"\n#include "fmi3Functions.h"\n'
    compiles(f'{official}#define FMI_TYPES_GIVEN\n#include "fmi.h"\n', tmp_path)


def test_types_agree_with_the_official_headers(tmp_path: Path):
    names = [f"fmi{fmi}{name}" for fmi in (2, 3) for name in (TYPES[fmi] + " " + ENUMERATORS[fmi]).split()]
    lines = [f"#define {name} official_{name}" for name in names]
    lines += ['#include "fmi2FunctionTypes.h"', '#include "fmi3FunctionTypes.h"']
    callbacks = set(
        re.findall(r"\(\*(fmi[23]\w+)\)", "".join(p.read_text() for p in HEADERS.glob("fmi?FunctionTypes.h")))
    )
    lines = [f"#define {name} official_{name}" for name in sorted(callbacks)] + lines
    lines += [f"#undef {name}" for name in [*names, *sorted(callbacks)]]
    lines += ['#include "fmi.h"']
    for fmi in (2, 3):
        for name in (f"fmi{fmi}{t}" for t in TYPES[fmi].split()):
            lines.append(f'_Static_assert(sizeof(official_{name}) == sizeof({name}), "{name}");')
            lines.append(f'_Static_assert(_Alignof(official_{name}) == _Alignof({name}), "{name}");')
        for name in (f"fmi{fmi}{e}" for e in ENUMERATORS[fmi].split()):
            lines.append(f'_Static_assert((int)official_{name} == (int){name}, "{name}");')
    compiles("\n".join(lines) + "\n", tmp_path)
