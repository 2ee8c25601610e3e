"""A unit in a host that is not Python finds an interpreter by itself, or says what is missing."""

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest
from ctypes_host import CtypesHost
from workshop import Workshop

from fmus import interpreter
from fmus.compile import RUNTIME, zig_cc

pytestmark = pytest.mark.skipif(os.name == "nt", reason="host.c loads libraries with dlopen")

LIBRARY = interpreter.library()


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
    if LIBRARY:
        values = [line for line in done.stdout.splitlines() if ": built with " not in line]
        assert values == [f"b = {2.0 * 99 + 25.0:.17g}"] * 2
        assert done.returncode == 0
    else:
        assert "is built without a shared library of Python" in done.stdout
        assert done.returncode == 1


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
    done = run(program, unpacked, PATH="/nonexistent", FMU_LIBPYTHON="/no/libpython.so")
    assert done.returncode == 1
    for part in (
        "[unit 3] fmi2Instantiate: no usable Python",
        "this process: no Python is loaded",
        "FMU_LIBPYTHON: /no/libpython.so",
        "/opt/static/bin/python3 is built without a shared library of Python",
        "python3 on the PATH: cannot be read",
        "Cure: set the environment variable FMU_LIBPYTHON",
        "--enable-shared",
    ):
        assert part in done.stdout


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
    done = run(program, unpacked, PATH="/nonexistent", HOST_LOADS_BEFORE=str(fragment))
    assert "the Python in this process: has no function Py_GetVersion" in done.stdout
    assert "Cure: there cannot be a second Python beside it" in done.stdout
    assert "FMU_LIBPYTHON" not in done.stdout
    assert done.returncode == 1


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
        if LIBRARY:
            assert (done.stdout, done.returncode) == ("all done\n", 0)
        else:
            assert done.stdout.count("is built without a shared library of Python") == len(units)
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
