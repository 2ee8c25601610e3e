import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from handover.scenarios.execution.python_process import code_command, module_command

IMPORTED = "import json, sys; import handover.cosim; print(json.dumps([handover.cosim.__file__, *sys.argv[1:]]))"


@pytest.fixture
def other_copy(tmp_path: Path) -> Path:
    """A folder with another package of the project's name, as a clone beside an installed one."""
    for folder in ("handover", "handover/cosim"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("", encoding="utf-8")
    (tmp_path / "told.py").write_text(IMPORTED, encoding="utf-8")
    return tmp_path


def output_of(command: Sequence[str], where: Path) -> list[str]:
    return json.loads(subprocess.run(command, cwd=where, check=True, capture_output=True, text=True).stdout)


def test_code_imports_what_this_process_does_wherever_it_is_called(other_copy: Path):
    import handover.cosim

    plainly = output_of([sys.executable, "-c", IMPORTED], other_copy)
    assert plainly == [str(other_copy / "handover" / "cosim" / "__init__.py")], "what is guarded against"
    assert output_of(code_command(IMPORTED, "a", "b c"), other_copy) == [handover.cosim.__file__, "a", "b c"]


def test_so_does_a_module(other_copy: Path, monkeypatch: pytest.MonkeyPatch):
    import handover.cosim

    monkeypatch.setattr(sys, "path", [*sys.path, str(other_copy)])  # where it lies itself
    assert output_of(module_command("told", "a", "{b}"), other_copy) == [handover.cosim.__file__, "a", "{b}"]
