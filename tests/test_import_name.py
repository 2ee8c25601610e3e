"""All is imported under one name, beside whatever folders a user's own repository has."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDERS = ("cosim", "plants", "controllers", "fmus", "scenarios")

PROGRAM = """
import importlib
from handover.cosim.system.system import System
from handover.plants.hand_motion import HandTremor
from handover.scenarios.catalog import SCENARIOS
from handover.fmus.catalog import UNITS
assert System.__module__.startswith("handover.")
for folder in {folders!r}:
    assert importlib.import_module(folder).OWNER == "user", folder
    assert importlib.import_module(folder + ".arm").OWNER == "user", folder
print(len(SCENARIOS), len(UNITS))
"""


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A user's repository that has folders, and packages, of the names that ours have, and a script."""
    for folder in FOLDERS:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text('OWNER = "user"\n')
        (tmp_path / folder / "arm.py").write_text('OWNER = "user"\n')
    (tmp_path / "script.py").write_text(PROGRAM.format(folders=FOLDERS))
    return tmp_path


@pytest.mark.parametrize(
    ("call", "added"), [(["script.py"], "."), (["-c", "import script"], "")], ids=["script", "code"]
)
def test_a_repository_with_folders_of_the_same_names_keeps_them(repository: Path, added: str, call: list[str]):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (added, os.environ.get("PYTHONPATH"))))}
    command = [sys.executable, *call]
    done = subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    scenarios, units = map(int, done.stdout.split())
    assert scenarios >= 9
    assert units >= 17
