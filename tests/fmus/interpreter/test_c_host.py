"""A unit in a host that is not Python finds an interpreter by itself, or says what is missing."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from support.c_programs import compiled
from support.fmus.ctypes_host import CtypesHost
from support.fmus.workshop import Workshop

from handover.fmus import interpreter
from handover.fmus.compile import RUNTIME

pytestmark = pytest.mark.skipif(os.name == "nt", reason="host.c loads libraries with dlopen")

LIBRARY = interpreter.library()
NEEDS_LIBRARY = pytest.mark.skipif(
    not LIBRARY, reason="this Python has no shared library (Debian: libpython3.13, by its version)"
)
EITHER_PLACE = [pytest.param("0", marks=NEEDS_LIBRARY), "1"]
"""Values of FMU_PYTHON_PROCESS: Python in the host's process, and in one of its own."""
VALUE = f"b = {2.0 * 99 + 25.0:.17g}"
HERE = Path(__file__).parent
NOWHERE = {"PATH": "/nonexistent"}
WITHOUT_LIBRARY = f"executable = {sys.executable}\nlibrary = \n"


@pytest.fixture
def unpacked(workshop: Workshop) -> CtypesHost:
    """Return an FMU, unpacked; only its folder is used."""
    return workshop.own("every_kind:EveryKind", 2)


def note_of(unit: CtypesHost) -> Path:
    """Return the file that notes the Python of the environment in which the unit was built."""
    return unit.folder / "resources" / "python.txt"


def run(
    unit: CtypesHost, *, program: str = "host.c", resources: Path | None = None, **environment: str
) -> "subprocess.CompletedProcess[str]":
    references = [str(unit.references[name]) for name in ("a", "b")]
    place = (resources or unit.folder / "resources").as_uri()
    command = [compiled(HERE / program), unit.library._name, unit.token, place, *references]
    return call(command, {**NOWHERE, **environment})


def call(command: "list[str | Path]", environment: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "FMU_", "VIRTUAL_ENV"))}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return subprocess.run(command, env={**kept, **environment}, text=True, check=False, **streams)


def expect_values(done: "subprocess.CompletedProcess[str]") -> None:
    """Fail unless the unit ran, wherever its Python did: without a shared library that is a process of its own."""
    assert (done.stdout.splitlines(), done.returncode) == ([VALUE] * 2, 0)


def expect_refusal(done: "subprocess.CompletedProcess[str]", *reported: str) -> None:
    assert done.returncode == 1
    assert [part for part in reported if part not in done.stdout] == []


def expect_separate_process(done: "subprocess.CompletedProcess[str]") -> None:
    assert "[unit 1] fmi2Instantiate: no usable Python" in done.stdout
    named = {sys.executable, interpreter.executable()}  # that of the note, which tests also write
    assert any(f"So the unit runs in a Python process of its own, {name}" in done.stdout for name in named)
    assert done.stdout.splitlines().count(VALUE) == 2
    assert done.returncode == 0


def test_by_the_environment_variable(unpacked: CtypesHost):
    note = note_of(unpacked)
    note.write_text(note.read_text().replace(f"library = {LIBRARY}", "library = "))
    expect_values(run(unpacked, FMU_LIBPYTHON=LIBRARY))


@pytest.mark.machine
def test_by_the_interpreter_on_the_path(unpacked: CtypesHost, tmp_path: Path):
    note_of(unpacked).unlink()
    wrapper = tmp_path / "python3"
    wrapper.write_text(f'#!/bin/sh\nexec "{interpreter.sys.executable}" "$@"\n')
    wrapper.chmod(0o755)
    expect_values(run(unpacked, PATH=f"{tmp_path}:/bin:/usr/bin"))


@pytest.mark.machine
def test_a_python_without_shared_library_runs_in_a_process_of_its_own_with_a_warning(unpacked: CtypesHost):
    note_of(unpacked).write_text(WITHOUT_LIBRARY)
    done = run(unpacked, HOST_LOGS="1")
    assert f"resources/python.txt: {sys.executable} is built without a shared library of Python" in done.stdout
    assert "--enable-shared" in done.stdout
    expect_separate_process(done)


@pytest.mark.machine
@pytest.mark.parametrize("place", EITHER_PLACE)
def test_a_folder_and_a_module_in_any_script_serve_in_any_locale(unpacked: CtypesHost, tmp_path: Path, place: str):
    """Here by the note of the environment that built the unit, whatever there is of another Python's, or apart."""
    resources = shutil.copytree(unpacked.folder / "resources", tmp_path / "größe 100% #a" / "resources")
    with (resources / "sources" / "support" / "sample_units" / "every_kind.py").open("a", encoding="utf-8") as file:
        file.write("\nω = 3\n\nclass Ünit:\n    größe = ω\n")
    bare: dict[str, Any] = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    if place == "1":  # asked for by its interpreter, so that no library is needed
        bare |= {"FMU_LIBPYTHON": "/no/libpython.so", "FMU_PYTHON": sys.executable}
    else:
        bare |= {"FMU_PYTHON_PROCESS": "0", "PYTHONHOME": "/nonexistent", "PYTHONMALLOC": "nonsense"}
    expect_values(run(unpacked, resources=resources, **bare))


LISTED: dict[str, tuple[str | None, dict[str, str], str]] = {
    "nothing": (
        "executable = /opt/static/bin/python3\nlibrary = \n",
        {},
        "this process: no Python is loaded|FMU_LIBPYTHON: not set|/opt/static/bin/python3 is built without a|"
        "python3 on the PATH: cannot be read|Cure: set the environment variable FMU_LIBPYTHON|--enable-shared",
    ),
    "a note that says nothing": ("executable = \nlibrary = \n", {}, "resources/python.txt: names no interpreter"),
    "an empty note": ("", {}, "resources/python.txt: names no interpreter"),
    "a forbidden process": (WITHOUT_LIBRARY, {"FMU_PYTHON_PROCESS": "0"}, "is built without a shared library"),
    "a chosen library": (
        None,
        {"PATH": os.environ["PATH"], "FMU_LIBPYTHON": "/no/libpython.so"},
        "FMU_LIBPYTHON: /no/libpython.so|While FMU_LIBPYTHON is set no other Python is tried|"
        "Cure: unset it, or set it to the shared library of a Python 3.10 or later|"
        "Nor is a process of its own tried while FMU_LIBPYTHON is set, unless FMU_PYTHON is set",
    ),
    "a chosen interpreter": (None, {"FMU_PYTHON": "/no/python3"}, "FMU_PYTHON: /no/python3: No such file or directory"),
    "no interpreter": (
        None,
        {"PATH": "/bin:/usr/bin", "FMU_PYTHON": "/bin/true", "FMU_PYTHON_PROCESS": "0"},
        "/bin/true cannot be run, or is no Python",
    ),
    "no interpreter, apart": (
        None,
        {"PATH": "/bin:/usr/bin", "FMU_PYTHON": "/bin/cat", "FMU_PYTHON_PROCESS": "1"},
        "/bin/cat|before the unit had started; is it a Python 3.10 or later?",
    ),
    "an old interpreter": (
        None,
        {"PATH": "/bin:/usr/bin", "FMU_PYTHON": "TMP/python3"},
        "it is older than Python 3.10|FMU_PYTHON to the interpreter of a Python 3.10 or later",
    ),
    "no Python": ("", {"FMU_LIBPYTHON": "UNIT"}, "has no function Py_IsInitialized; it is not a usable Python"),
    "a fragment": ("", {"FMU_LIBPYTHON": "TMP/fragment"}, "has no function Py_GetVersion"),
    "an old library": ("", {"FMU_LIBPYTHON": "TMP/3.9.1"}, "Python 3.9.1 is too old, 3.10 or later is needed"),
    "another home": ("", {"FMU_LIBPYTHON": "TMP/3.11.2", "PYTHONHOME": "/x"}, "PYTHONHOME is set, to /x; it"),
}
"""By what is wrong: the note (None: the right one), the environment, and what is reported."""


@pytest.mark.parametrize("case", LISTED)
def test_all_that_was_tried_is_reported_with_a_cure(unpacked: CtypesHost, tmp_path: Path, case: str):
    note, environment, reported = LISTED[case]
    if note is not None:
        note_of(unpacked).write_text(note)
    (tmp_path / "python3").write_text("#!/bin/sh\nexit 86\n")
    (tmp_path / "python3").chmod(0o755)
    for name in ("fragment", "3.9.1", "3.11.2"):
        if environment.get("FMU_LIBPYTHON") == f"TMP/{name}":
            alike(tmp_path, name)
    places = {"UNIT": str(unpacked.library._name), "TMP": str(tmp_path)}
    filled: dict[str, Any] = {k: re.sub("^(UNIT|TMP)", lambda m: places[m[1]], v) for k, v in environment.items()}
    done = run(unpacked, **filled)
    expect_refusal(done, "fmi2Instantiate: ", *reported.split("|"))
    assert done.stdout.count("Cure: ") in ((1,) if case.startswith("no interpreter") else (1, 2))
    assert "saved state" not in done.stdout
    assert ("python.txt" in done.stdout) is (note is not None and "FMU_LIBPYTHON" not in environment)


def alike(folder: Path, version: str) -> str:
    """Return a library that has Python's functions, or only the first ones; none of them does anything."""
    names = set(re.findall(r"F\(.*?, (\w+), \(", (RUNTIME / "python_api.h").read_text())) - {"Py_GetVersion"}
    code = "".join(f"void *{name}(void) {{ return 0; }}\n" for name in sorted(names))
    code += f'const char *Py_GetVersion(void) {{ return "{version} (main)"; }}\n'
    if version == "fragment":
        code = "int Py_IsInitialized(void) { return 0; }\nvoid Py_InitializeEx(int signals) { (void)signals; }\n"
    (folder / "alike.c").write_text(code)
    (folder / "lib" / "python3.11").mkdir(parents=True)
    (folder / "lib" / "python3.11" / "os.py").touch()
    return str(shutil.copy(compiled(folder / "alike.c", flags=("-shared", "-fPIC")), folder / version))


@pytest.mark.parametrize("place", EITHER_PLACE)
def test_a_unit_without_its_sources_says_what_may_be_wrong(unpacked: CtypesHost, place: str):
    shutil.rmtree(unpacked.folder / "resources" / "sources" / "handover" / "fmus")
    reported = ("cannot be read: the resources folder lacks it", "Either the resource location is wrong, or the FMU")
    expect_refusal(run(unpacked, FMU_PYTHON_PROCESS=place), *reported)


def test_no_second_python_is_loaded_beside_an_unfit_one(unpacked: CtypesHost, tmp_path: Path):
    done = run(unpacked, HOST_LOADS_BEFORE=alike(tmp_path, "fragment"), HOST_LOGS="1")
    assert "the Python in this process: has no function Py_GetVersion" in done.stdout
    assert "Cure: there cannot be a second Python beside it" in done.stdout
    assert "FMU_LIBPYTHON" not in done.stdout
    expect_separate_process(done)


@NEEDS_LIBRARY
def test_a_library_without_its_standard_library_is_refused(unpacked: CtypesHost, tmp_path: Path):
    note_of(unpacked).unlink()
    alone = tmp_path / "a" / "b" / "c" / "d" / "e" / Path(LIBRARY).name
    alone.parent.mkdir(parents=True)
    shutil.copy(LIBRARY, alone)
    reported = f"the standard library of {alone} is not beside or above it"
    expect_refusal(run(unpacked, FMU_LIBPYTHON=str(alone)), reported)


@NEEDS_LIBRARY
def test_calls_after_the_hosts_python_has_ended_are_errors(unpacked: CtypesHost):
    done = run(unpacked, program="finalising_host.c")
    assert done.returncode == 0, done.stdout
    statuses = [line for line in done.stdout.splitlines() if " = " in line]
    assert statuses == ["step = 0", "step = 3", "state = 3", "string = 3", "reset = 3", "freed = 1"]
    assert done.stdout.count("the host has ended its Python while this instance lives. Cure: ") == 2


def test_units_may_be_instantiated_from_several_threads_at_once(workshop: Workshop, tmp_path: Path):
    units = [workshop.own(block, 2) for block in ("every_kind:EveryKind", "scalars:Scalars")]
    command: list[str | Path] = [compiled(HERE / "threaded_host.c", flags=("-pthread",))]
    for unit in units:
        command += [unit.library._name, unit.token, (unit.folder / "resources").as_uri()]
    done = call(command, NOWHERE | {"TMPDIR": str(tmp_path)})
    assert (done.stdout, done.returncode) == ("all done\n", 0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.machine
def test_a_python_without_the_packages_names_them(unpacked: CtypesHost):
    note = note_of(unpacked)
    lines = [line for line in note.read_text().splitlines() if not line.startswith(("site", "executable"))]
    note.write_text("\n".join(lines) + "\n")
    unit = unpacked.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace('"module": "numpy"', '"module": "no_such_module"'))
    reported = ("needs packages that this Python does not have", "pip install") if LIBRARY else ()
    expect_refusal(run(unpacked), *reported)
