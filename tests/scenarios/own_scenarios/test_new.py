"""`handover new`: what it writes works, and passes the tests that come with it."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from tutorial import refused, succeeded

from handover.scenarios.cli.command import main


def files_in(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir() if file.suffix == ".py"}


@pytest.mark.slow
def test_a_scenario_comes_with_plant_and_controller_that_pass_their_tests(tmp_path: Path):
    succeeded(tmp_path, "new", "scenario", "CartReach", "--out", "mine")
    here = tmp_path / "mine"
    modules = {"cart_reach.py", "cart_reach_plant.py", "cart_reach_controller.py"}
    assert files_in(here) == modules | {f"test_{name}" for name in modules}
    tests = subprocess.run([sys.executable, "-m", "pytest", "-q", "."], cwd=here, capture_output=True, text=True)
    assert tests.returncode == 0, tests.stdout
    assert "7 passed" in tests.stdout


def test_a_unit_and_a_controller_are_written_and_listed(tmp_path: Path):
    succeeded(tmp_path, "new", "unit", "spring_mass")
    succeeded(tmp_path, "new", "controller", "Gentle")
    assert files_in(tmp_path) == {"spring_mass.py", "test_spring_mass.py", "gentle.py", "test_gentle.py"}
    assert "SpringMass: m dv/dt = f - k x - d v" in succeeded(tmp_path, "list", "spring_mass:SpringMass")
    assert "sampled every 10 ms" in succeeded(tmp_path, "list", "gentle:Gentle")


def test_nothing_is_overwritten_and_names_are_checked(tmp_path: Path):
    (tmp_path / "test_reach.py").write_text("mine")
    assert "test_reach.py is there already" in refused(tmp_path, "new", "unit", "Reach")
    assert "is in the catalog already" in refused(tmp_path, "new", "unit", "TendonArm")
    assert "letters, digits and underscores are right" in refused(tmp_path, "new", "unit", "my-arm")
    assert "is a keyword of Python" in refused(tmp_path, "new", "controller", "class")


@pytest.mark.parametrize("name", ["Random", "Handover", "numpy"])
def test_a_module_that_python_has_is_not_hidden(name: str, tmp_path: Path):
    done = CliRunner().invoke(main, ["new", "unit", name, "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert f"{name.lower()}.py would hide a module that Python or a package has; give another name" in done.output
    assert not list(tmp_path.iterdir())
