"""A unit in a host that is not Python finds an interpreter by itself, or says what is missing."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from ctypes_host import CtypesHost
from workshop import Workshop

from handover.fmus import interpreter
from handover.fmus.compile import RUNTIME, zig_cc

pytestmark = pytest.mark.skipif(os.name == "nt", reason="host.c loads libraries with dlopen")

LIBRARY = interpreter.library()
NEEDS_LIBRARY = pytest.mark.skipif(
    not LIBRARY, reason="this Python has no shared library (Debian: libpython3.13, by its version)"
)
EITHER_PLACE = [pytest.param("0", marks=NEEDS_LIBRARY), "1"]
"""Values of FMU_PYTHON_PROCESS: Python in the host's process, and in one of its own."""
VALUE = f"b = {2.0 * 99 + 25.0:.17g}"


def compiled(source: str, folder: Path, *flags: str) -> Path:
    made = folder / source.partition(".")[0]
    file = Path(__file__).with_name(source)
    done = zig_cc(["-O1", "-std=gnu11", "-I", str(RUNTIME), str(file), "-o", str(made), "-ldl", *flags])
    assert done.returncode == 0, done.stdout
    return made


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled("host.c", tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="module")
def threaded_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled("threaded_host.c", tmp_path_factory.mktemp("threaded_host"), "-pthread")


@pytest.fixture(scope="module")
def fragment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a library that has only the first functions of Python's."""
    folder = tmp_path_factory.mktemp("fragment")
    source, made = folder / "fragment.c", folder / "libfragment.so"
    source.write_text(
        "int Py_IsInitialized(void) { return 0; }\nvoid Py_InitializeEx(int signals) { (void)signals; }\n"
    )
    done = zig_cc(["-shared", "-fPIC", str(source), "-o", str(made)])
    assert done.returncode == 0, done.stdout
    return made


@pytest.fixture
def unpacked(workshop: Workshop) -> CtypesHost:
    """Return an FMU, unpacked; only its folder is used."""
    return workshop.host("every_kind:EveryKind", 2)


def run(program: Path, unit: CtypesHost, **environment: str) -> "subprocess.CompletedProcess[str]":
    resources = unit.folder / "resources"
    references = [str(unit.references[name]) for name in ("a", "b")]
    return call([program, unit.library._name, unit.token, resources.as_uri(), *references], environment)


def call(command: "list[str | Path]", environment: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "FMU_", "VIRTUAL_ENV"))}
    return subprocess.run(
        command,
        env={**kept, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def expect_values(done: "subprocess.CompletedProcess[str]") -> None:
    """Fail unless the unit ran, wherever its Python did: without a shared library that is a process of its own."""
    assert done.stdout.splitlines() == [VALUE] * 2
    assert done.returncode == 0


def expect_separate_process(done: "subprocess.CompletedProcess[str]") -> None:
    assert "[unit 1] fmi2Instantiate: no usable Python" in done.stdout
    assert "So the unit runs in a Python process of its own, " in done.stdout
    named = {sys.executable, interpreter.executable()}  # that of the note, which tests also write
    assert any(f"process of its own, {name}" in done.stdout for name in named)
    assert done.stdout.splitlines().count(VALUE) == 2
    assert done.returncode == 0


def test_by_the_note_of_the_environment_that_built_the_unit(program: Path, unpacked: CtypesHost):
    expect_values(run(program, unpacked, PATH="/nonexistent"))


def test_by_the_environment_variable(program: Path, unpacked: CtypesHost):
    note = unpacked.folder / "resources" / "python.txt"
    text = note.read_text()
    note.write_text(text.replace(f"library = {LIBRARY}", "library = "))
    expect_values(run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON=LIBRARY))


def test_by_the_interpreter_on_the_path(program: Path, unpacked: CtypesHost, tmp_path: Path):
    (unpacked.folder / "resources" / "python.txt").unlink()
    wrapper = tmp_path / "python3"
    wrapper.write_text(f'#!/bin/sh\nexec "{interpreter.sys.executable}" "$@"\n')
    wrapper.chmod(0o755)
    expect_values(run(program, unpacked, PATH=f"{tmp_path}:/bin:/usr/bin"))


def test_all_that_was_tried_is_logged_with_a_cure(program: Path, unpacked: CtypesHost):
    (unpacked.folder / "resources" / "python.txt").write_text("executable = /opt/static/bin/python3\nlibrary = \n")
    done = run(program, unpacked, PATH="/nonexistent")
    assert done.returncode == 1
    for part in (
        "[unit 3] fmi2Instantiate: no usable Python",
        "this process: no Python is loaded",
        "FMU_LIBPYTHON: not set",
        "/opt/static/bin/python3 is built without a shared library of Python",
        "python3 on the PATH: cannot be read",
        "Cure: set the environment variable FMU_LIBPYTHON",
        "--enable-shared",
    ):
        assert part in done.stdout


def test_a_chosen_library_is_the_only_python_that_is_tried(program: Path, unpacked: CtypesHost):
    done = run(program, unpacked, PATH=os.environ["PATH"], FMU_LIBPYTHON="/no/libpython.so")
    assert done.returncode == 1
    for part in (
        "[unit 3] fmi2Instantiate: no usable Python",
        "FMU_LIBPYTHON: /no/libpython.so",
        "While FMU_LIBPYTHON is set no other Python is tried",
        "Cure: unset it, or set it to the shared library of a Python 3.10 or later",
        "Nor is a process of its own tried while FMU_LIBPYTHON is set, unless FMU_PYTHON is set or FMU_PYTHON_PROCESS",
    ):
        assert part in done.stdout
    assert not re.search(r"python\.txt|on the PATH", done.stdout)


@pytest.mark.parametrize("wish", ["FMU_PYTHON", "FMU_PYTHON_PROCESS"])
def test_a_process_of_its_own_that_was_asked_for_needs_no_library(program: Path, unpacked: CtypesHost, wish: str):
    value = {"FMU_PYTHON": sys.executable, "FMU_PYTHON_PROCESS": "1"}[wish]
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON="/no/libpython.so", **{wish: value})
    expect_values(done)


@pytest.mark.parametrize("text", ["", "library = \n", "executable = \nlibrary = \n"])
def test_a_note_that_says_nothing_names_no_interpreter(program: Path, unpacked: CtypesHost, text: str):
    (unpacked.folder / "resources" / "python.txt").write_text(text)
    done = run(program, unpacked, PATH="/nonexistent")
    assert "resources/python.txt: names no interpreter" in done.stdout
    assert "is built without" not in done.stdout
    assert done.returncode == 1


@pytest.mark.parametrize("place", ["0", "1"])
@pytest.mark.parametrize("command", ["/bin/true", "/bin/cat"])
def test_a_program_that_is_no_interpreter_is_reported_with_one_cure(
    program: Path, unpacked: CtypesHost, place: str, command: str
):
    done = run(program, unpacked, PATH="/bin:/usr/bin", FMU_PYTHON=command, FMU_PYTHON_PROCESS=place)
    facts = {"0": "cannot be run, or is no Python", "1": "before the unit had started; is it a Python 3.10 or later?"}
    assert command in done.stdout
    assert facts[place] in done.stdout
    assert done.stdout.count("Cure: ") == 1
    assert "saved state" not in done.stdout
    assert done.returncode == 1


@pytest.mark.parametrize("place", EITHER_PLACE)
def test_a_unit_without_its_sources_says_what_may_be_wrong(program: Path, unpacked: CtypesHost, place: str):
    shutil.rmtree(unpacked.folder / "resources" / "sources" / "handover" / "fmus")
    done = run(program, unpacked, PATH="/nonexistent", FMU_PYTHON_PROCESS=place)
    for part in ("cannot be read: the resources folder lacks it", "Either the resource location is wrong, or the FMU"):
        assert part in done.stdout
    assert done.returncode == 1


@pytest.mark.parametrize("place", EITHER_PLACE)
@pytest.mark.parametrize("locale", ["C", "POSIX", "C.UTF-8"])
def test_a_folder_of_any_name_serves_in_any_locale(
    program: Path, unpacked: CtypesHost, tmp_path: Path, place: str, locale: str
):
    resources = shutil.copytree(unpacked.folder / "resources", tmp_path / "größe 100% #a" / "resources")
    references = [str(unpacked.references[name]) for name in ("a", "b")]
    command: list[str | Path] = [program, unpacked.library._name, unpacked.token, resources.as_uri(), *references]
    bare = {"PATH": "/nonexistent", "LC_ALL": locale, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = call(command, {**bare, "FMU_PYTHON_PROCESS": place})
    assert done.stdout.splitlines() == [VALUE] * 2


@pytest.mark.parametrize("place", EITHER_PLACE)
def test_names_in_a_blocks_modules_may_be_of_any_script(program: Path, unpacked: CtypesHost, place: str):
    module = unpacked.folder / "resources" / "sources" / "sample_units" / "every_kind.py"
    with module.open("a", encoding="utf-8") as file:
        file.write("\nω = 3\n\nclass Ünit:\n    größe = ω\n")
    done = run(program, unpacked, PATH="/nonexistent", FMU_PYTHON_PROCESS=place)
    assert done.stdout.splitlines() == [VALUE] * 2


def test_a_library_that_is_no_python_is_named(program: Path, unpacked: CtypesHost):
    (unpacked.folder / "resources" / "python.txt").unlink()
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON=unpacked.library._name)
    assert "has no function Py_IsInitialized; it is not a usable Python" in done.stdout


def test_a_fragment_of_a_python_is_refused_and_the_host_lives(program: Path, unpacked: CtypesHost, fragment: Path):
    (unpacked.folder / "resources" / "python.txt").unlink()
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON=str(fragment))
    assert "has no function Py_GetVersion; it is not a usable Python" in done.stdout
    assert done.returncode == 1


def test_no_second_python_is_loaded_beside_an_unfit_one(program: Path, unpacked: CtypesHost, fragment: Path):
    done = run(program, unpacked, PATH="/nonexistent", HOST_LOADS_BEFORE=str(fragment), HOST_LOGS="1")
    assert "the Python in this process: has no function Py_GetVersion" in done.stdout
    assert "Cure: there cannot be a second Python beside it" in done.stdout
    assert "FMU_LIBPYTHON" not in done.stdout
    expect_separate_process(done)


def test_a_python_without_shared_library_runs_in_a_process_of_its_own_with_a_warning(
    program: Path, unpacked: CtypesHost
):
    note = unpacked.folder / "resources" / "python.txt"
    note.write_text(f"executable = {sys.executable}\nlibrary = \n")
    done = run(program, unpacked, PATH="/nonexistent", HOST_LOGS="1")
    assert f"resources/python.txt: {sys.executable} is built without a shared library of Python" in done.stdout
    assert "--enable-shared" in done.stdout
    expect_separate_process(done)


def test_a_process_of_its_own_can_be_asked_for_and_be_forbidden(program: Path, unpacked: CtypesHost):
    done = run(program, unpacked, PATH="/nonexistent", FMU_PYTHON_PROCESS="1")
    assert done.stdout.splitlines() == [VALUE] * 2
    note = unpacked.folder / "resources" / "python.txt"
    note.write_text(f"executable = {sys.executable}\nlibrary = \n")
    done = run(program, unpacked, PATH="/nonexistent", FMU_PYTHON_PROCESS="0")
    assert "process of its own" not in done.stdout
    assert done.returncode == 1


def test_the_chosen_interpreter_is_the_only_one_that_is_tried(program: Path, unpacked: CtypesHost, tmp_path: Path):
    expect_values(run(program, unpacked, PATH="/nonexistent", FMU_PYTHON=sys.executable))
    done = run(program, unpacked, PATH="/nonexistent", FMU_PYTHON="/no/python3")
    assert done.returncode == 1
    for part in ("FMU_PYTHON: /no/python3 cannot be run", "FMU_PYTHON: /no/python3: No such file or directory"):
        assert part in done.stdout
    assert "python.txt" not in done.stdout
    old = tmp_path / "python3"
    old.write_text("#!/bin/sh\nexit 86\n")
    old.chmod(0o755)
    done = run(program, unpacked, PATH="/bin:/usr/bin", FMU_PYTHON=str(old))
    assert f"FMU_PYTHON: {old}: it is older than Python 3.10" in done.stdout
    assert "Cure: set the environment variable FMU_PYTHON to the interpreter of a Python 3.10 or later" in done.stdout


def python_like(folder: Path, version: str) -> Path:
    """Return a library with all of Python's functions that the runtime wants, none of which does anything."""
    declared = (RUNTIME / "python_api.h").read_text()
    names = set(re.findall(r"F\(.*?, (\w+), \(", declared)) - {"Py_GetVersion"}
    functions = "".join(f"void *{name}(void) {{ return 0; }}\n" for name in sorted(names))
    made, standard_library = folder / "libalike.so", folder / "lib" / "python3.11" / "os.py"
    standard_library.parent.mkdir(parents=True)
    standard_library.touch()
    (folder / "alike.c").write_text(f'{functions}const char *Py_GetVersion(void) {{ return "{version}"; }}\n')
    done = zig_cc(["-shared", "-fPIC", str(folder / "alike.c"), "-o", str(made)])
    assert done.returncode == 0, done.stdout
    return made


@pytest.mark.parametrize(
    ("version", "fault"),
    [("3.9.1 (main)", "Python 3.9.1 is too old, 3.10 or later is needed"), ("3.11.2 ", "PYTHONHOME is set, to /x; it")],
)
def test_a_library_that_cannot_serve_says_why(
    program: Path, unpacked: CtypesHost, tmp_path: Path, version: str, fault: str
):
    (unpacked.folder / "resources" / "python.txt").unlink()
    library = python_like(tmp_path, version)
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON=str(library), PYTHONHOME="/x")
    assert fault in done.stdout
    assert done.returncode == 1


@pytest.mark.skipif(not LIBRARY, reason="there is no Python in the host's process that could end")
def test_calls_after_the_hosts_python_has_ended_are_errors(
    tmp_path_factory: pytest.TempPathFactory, unpacked: CtypesHost
):
    program = compiled("finalising_host.c", tmp_path_factory.mktemp("finalising_host"))
    done = run(program, unpacked, PATH="/nonexistent")
    assert done.returncode == 0, done.stdout
    statuses = [line for line in done.stdout.splitlines() if " = " in line]
    assert statuses == ["step = 0", "step = 3", "state = 3", "string = 3", "reset = 3", "freed = 1"]
    assert done.stdout.count("the host has ended its Python while this instance lives. Cure: ") == 2


@pytest.mark.parametrize("setting", ["PYTHONHOME=/nonexistent", "PYTHONMALLOC=nonsense"])
def test_the_environment_of_another_python_does_no_harm(program: Path, unpacked: CtypesHost, setting: str):
    name, _, value = setting.partition("=")
    expect_values(run(program, unpacked, PATH="/nonexistent", **{name: value}))


@pytest.mark.skipif(not LIBRARY, reason="there is no library to start without its standard library")
def test_a_library_without_its_standard_library_is_refused(program: Path, unpacked: CtypesHost, tmp_path: Path):
    (unpacked.folder / "resources" / "python.txt").unlink()
    alone = tmp_path / "a" / "b" / "c" / "d" / "e" / Path(LIBRARY).name
    alone.parent.mkdir(parents=True)
    shutil.copy(LIBRARY, alone)
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON=str(alone))
    assert f"the standard library of {alone} is not beside or above it" in done.stdout
    assert done.returncode == 1


def test_units_may_be_instantiated_from_several_threads_at_once(
    threaded_program: Path, workshop: Workshop, tmp_path: Path
):
    units = [workshop.host(block, 2) for block in ("every_kind:EveryKind", "scalars:Scalars")]
    command: list[str | Path] = [threaded_program]
    for unit in units:
        command += [unit.library._name, unit.token, (unit.folder / "resources").as_uri()]
    for _ in range(6):
        done = call(command, {"PATH": "/nonexistent", "TMPDIR": str(tmp_path)})
        assert (done.stdout, done.returncode) == ("all done\n", 0)
    assert list(tmp_path.iterdir()) == []


def test_a_python_without_the_packages_names_them(program: Path, unpacked: CtypesHost):
    note = unpacked.folder / "resources" / "python.txt"
    lines = [line for line in note.read_text().splitlines() if not line.startswith(("site", "executable"))]
    note.write_text("\n".join(lines) + "\n")
    unit = unpacked.folder / "resources" / "unit.json"
    unit.write_text(unit.read_text().replace('"module": "numpy"', '"module": "no_such_module"'))
    done = run(program, unpacked, PATH="/nonexistent")
    if LIBRARY:
        assert "needs packages that this Python does not have" in done.stdout
        assert "pip install" in done.stdout
    assert done.returncode == 1
