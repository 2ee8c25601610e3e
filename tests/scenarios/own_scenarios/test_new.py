"""`handover new`: what it writes works, and passes the tests that come with it."""

import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import call
from support.scenarios.tutorial import succeeded
from support.wording import Wording


def files_in(folder: Path) -> set[str]:
    return {file.name for file in folder.iterdir() if file.suffix == ".py"}


@pytest.mark.slow
def test_a_scenario_and_a_controller_for_a_place_pass_their_tests(tmp_path: Path):
    here = tmp_path / "mine"
    succeeded(tmp_path, "new", "scenario", "CartReach", "--out", "mine")
    modules = {"cart_reach.py", "cart_reach_plant.py", "cart_reach_controller.py"}
    assert files_in(here) == modules | {f"test_{name}" for name in modules}
    assert "gentle.py" in succeeded(here, "new", "controller", "Gentle", "--for", "helix_handover:servo")
    tests = subprocess.run([sys.executable, "-m", "pytest", "-q", "."], cwd=here, capture_output=True, text=True)
    assert tests.returncode == 0, tests.stdout
    assert "8 passed" in tests.stdout


def test_a_unit_and_a_controller_are_written_and_listed(tmp_path: Path):
    succeeded(tmp_path, "new", "unit", "spring_mass")
    succeeded(tmp_path, "new", "controller", "Gentle")
    assert files_in(tmp_path) == {"spring_mass.py", "test_spring_mass.py", "gentle.py", "test_gentle.py"}
    assert "SpringMass: m dv/dt = f - k x - d v" in succeeded(tmp_path, "list", "spring_mass:SpringMass")
    assert "sampled every 10 ms" in succeeded(tmp_path, "list", "gentle:Gentle")


def test_a_module_that_python_has_is_not_hidden(tmp_path: Path, wording: Wording):
    for name in ("Random", "Handover", "numpy"):
        done = call("new", "unit", name, "--out", tmp_path)
        assert done.exit_code == 2
        wording.check(done.stderr)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("there", [True, False])
def test_how_to_run_its_test_is_reported_also_without_pytest(
    there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def find_spec(name: str) -> bool | None:
        return there if name == "pytest" else None

    monkeypatch.setattr("handover.scenarios.cli.units.new.find_spec", find_spec)
    reported = call("new", "controller", "Quick", "--out", tmp_path).stderr
    assert ("its test: python -m pytest test_quick.py" in reported) is there
    assert ("its test: python -m pip install pytest, then python -m pytest test_quick.py" in reported) is not there
