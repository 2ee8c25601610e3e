import json
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

import pytest

from handover.cosim.imported_elsewhere import ImportedElsewhere
from handover.cosim.python_process import code_command, is_installed, module_command

IMPORTED = "import json, sys; import handover.cosim; print(json.dumps([handover.cosim.__file__, *sys.argv[1:]]))"


def output_of(command: Sequence[str], where: Path) -> list[str]:
    return json.loads(subprocess.run(command, cwd=where, check=True, capture_output=True, text=True).stdout)


def test_code_and_modules_import_what_this_process_does_wherever_they_are_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Beside another package of the project's name, as a clone beside an installed one."""
    import handover.cosim

    for folder in ("handover", "handover/cosim"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("", encoding="utf-8")
    (tmp_path / "reported.py").write_text(IMPORTED, encoding="utf-8")
    assert output_of(code_command(IMPORTED, "a", "b c"), tmp_path) == [handover.cosim.__file__, "a", "b c"]
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])  # where it lies itself
    assert output_of(module_command("reported", "a", "{b}"), tmp_path) == [handover.cosim.__file__, "a", "{b}"]


PLANTED = ("json", "importlib", "secrets", "typing", "jinja2", "pandas", "starlette", "rich", "tomli", "numpy")


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with files that are named like modules of libraries and say so when they are run."""
    for name in PLANTED:
        code = f"open({str(tmp_path / 'run.txt')!r}, 'a').write({name!r})\nraise SystemExit({name!r})\n"
        (tmp_path / f"{name}.py").write_text(code, encoding="utf-8")
    (tmp_path / "own_module.py").write_text("", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("first", [[""], []], ids=["as of a notebook", "as of a command"])
def test_no_file_of_the_working_directory_is_taken_for_a_librarys(
    planted: Path, monkeypatch: pytest.MonkeyPatch, first: list[str]
):
    monkeypatch.setattr(sys, "path", [*first, *(p for p in sys.path if p)])
    own = "import own_module; " if first else ""  # a notebook's own modules are found all the same
    code = f"import json, importlib, secrets, typing, jinja2, numpy; {own}print(json.dumps(len(sys.argv)))"
    done = subprocess.run(code_command(code), capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("1\n", "")
    assert not (planted / "run.txt").exists()


def test_the_command_runs_none_of_them(planted: Path):
    begin = "import handover, importlib, typing; import sys; sys.path.insert(0, ''); "  # as `python -m` and notebooks
    call = [*code_command(begin + "from handover.scenarios.cli.entry import main; main()"), "list", "--json"]
    done = subprocess.run(call, capture_output=True, text=True)
    assert json.loads(done.stdout)["scenarios"], done.stderr
    assert not (planted / "run.txt").exists()


def test_folders_of_own_modules_come_last_and_only_where_one_is_named(planted: Path, monkeypatch: pytest.MonkeyPatch):
    from handover.scenarios.runs.execution.errors import UsageError
    from handover.scenarios.runs.execution.selection import find_scenario

    before = [p for p in sys.path if p]
    monkeypatch.setattr(sys, "path", [*before])
    find_scenario("ir_grasp")
    assert sys.path == before
    with pytest.raises(UsageError, match="has no class 'Scene'"):
        find_scenario("own_module:Scene")
    assert sys.path == [*before, str(planted)]
    with pytest.raises(UsageError, match="rename that"):
        find_scenario("json:Scene")
    assert not (planted / "run.txt").exists()


def test_no_configuration_of_the_working_directory_is_read_by_a_library(tmp_path: Path):
    for name in ("matplotlibrc", ".numba_config.yaml"):
        (tmp_path / name).write_bytes(b"\xff: [")  # which fails where it is read
    code = "import json, matplotlib, numba, os; numba.core.config.reload_config(); print(json.dumps([os.getcwd()]))"
    done = subprocess.run(code_command(code), cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert json.loads(done.stdout or "[]") == [str(tmp_path.resolve())], done.stderr


def test_installed_is_what_lies_in_folders_of_this_interpreter_and_that_ends_with_its_context(tmp_path: Path):
    assert is_installed(Path(sysconfig.get_path("purelib"), "numpy", "__init__.py"))
    assert not is_installed(tmp_path / "lib" / "python3.11" / "site-packages" / "numpy.py")
    before = list(sys.meta_path)
    with ImportedElsewhere.installed():
        assert ImportedElsewhere in sys.meta_path
    assert sys.meta_path == before
