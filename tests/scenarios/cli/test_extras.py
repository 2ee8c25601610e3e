"""What the base installation does, and what it says of the extras that it lacks."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from support.commands import refusal
from support.installed import distributions, link_distributions

from handover.scenarios.runs.execution.errors import UsageError

ROOT = Path(__file__).parents[3]


def test_a_folder_that_is_none_is_reported_before_an_extra_that_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def lacking(*_: str) -> None:
        raise UsageError("matplotlib missing")

    monkeypatch.setattr("handover.scenarios.cli.resume.require_extra", lacking)
    empty = tmp_path / "empty"
    empty.mkdir()
    for folder, reported in ((tmp_path / "nosuch", "is not a folder"), (empty, "it has no run.json")):
        assert reported in refusal("resume", folder)


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder like site-packages that has what the package requires without extras, and nothing else."""
    folder = tmp_path_factory.mktemp("base") / "site-packages"
    folder.mkdir()
    link_distributions(distributions("handover-cosim"), folder)
    return folder


COMMANDS = """
import json
from click.testing import CliRunner
from handover.scenarios.cli.command import main

for call in json.loads(sys.argv[1]):
    done = CliRunner().invoke(main, call)
    print(json.dumps([done.exit_code, done.output]))
"""


def python(base: Path, folder: Path, program: str, *arguments: str) -> str:
    """Run a program in a folder on the base installation, and return what it prints."""
    begin = f"import sys; sys.path += {[str(ROOT), str(base)]}\nimport handover; handover.__path__ += {[str(ROOT)]}\n"
    done = subprocess.run(
        [sys.executable, "-S", "-c", f"{begin}{program}", *arguments],
        cwd=folder,
        env={**os.environ, "HANDOVER_CACHE": str(base.parent / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def handover(base: Path, folder: Path, calls: "Sequence[Sequence[str]]") -> "list[tuple[int, str]]":
    """Call commands one after another in one process; return their statuses and what they print."""
    return [tuple(json.loads(line)) for line in python(base, folder, COMMANDS, json.dumps(calls)).splitlines()]


@pytest.mark.slow
def test_the_base_installation_builds_checks_and_runs_units(base: Path, tmp_path: Path):
    assert not (base / "scipy").exists()
    calls = (
        ["list"],
        ["list", "helix_handover"],
        ["list", "FreeFlyer"],
        ["build", "FreeFlyer", "--out", "."],
        ["check", "FreeFlyer.fmi3.fmu"],
        ["run", "FreeFlyer.fmi2.fmu", "--stop", "0.2", "--no-report", "--out", "one"],
        ["run", "vsl_model_based", "-p", "points=3", "-p", "settle=0.2", "--no-report", "--out", "two"],
        ["export", "vsl_hybrid", "--ssp", "vsl.ssp"],
    )
    for call, (status, output) in zip(calls, handover(base, tmp_path, calls), strict=True):
        assert status == 0 or (call[-1] == "two" and status == 1), output
    assert (tmp_path / "two" / "signals.parquet").is_file()


IN_PYTHON = """
import inspect
import handover
inspect.getmembers(handover)
system = handover.System()
system.add("one", handover.unit("Push"))
run = handover.run(system, stop=0.1, out="one")
assert run.success and handover.load("one").signals["one.f_G"].any() == 0
assert "results: one" in run._repr_html_()
with handover.open("vsl_model_based") as session:
    session.step(0.1)
for call in (
    lambda: run.plot("one.f_G"),
    lambda: run.replay(),
    lambda: run.report(),
    lambda: handover.run(system, stop=0.1, out="two", report=True),
    lambda: handover.sweep("vsl_model_based", load=[0.0, 0.025], out="three"),
    lambda: handover.Campaign("four"),
    lambda: handover.environment("vsl_model_based", "kinematics"),
):
    try:
        call()
    except (handover.InvalidInput, ImportError) as e:
        print(type(e).__name__, e)
"""


@pytest.mark.slow
def test_python_runs_and_steps_on_the_base_installation_and_names_the_extra_of_all_else(base: Path, tmp_path: Path):
    lines = python(base, tmp_path, IN_PYTHON).splitlines()
    reported = [
        ("reports", "matplotlib"),
        *3 * [("reports", "plotly")],
        *2 * [("campaigns", "scipy")],
        ("gym", "gymnasium"),
    ]
    for line, (extra, names) in zip(lines, reported, strict=True):
        assert line.startswith("ImportError" if extra == "gym" else "InvalidInput")
        assert f"handover-cosim[{extra}]" in line
        assert names in line
    assert {p.name for p in tmp_path.iterdir()} == {"one"}


LACKING = (
    (("run", "helix_handover", "--out", "r"), "reports", "plotly"),
    (("run", "helix_handover", "--no-report", "--out", "r"), "robots", "cv2"),
    (("run", "ir_grasp", "--no-report", "--out", "r"), "robots", "pymunk"),
    (("run", "flyer_impedance", "--no-report", "--out", "r"), "robots", "control"),
    (("sweep", "ir_grasp", "strategy=reflex,blind", "--out", "r"), "campaigns", "distributed"),
    (("paper", "ir-table", "--out", "r"), "campaigns", "distributed"),
    (("run", "flyer_impedance", "--no-report", "--live", "--out", "r"), "reports", "plotly"),
    (("report", "."), "reports", "matplotlib"),
    (("compare", ".", "."), "reports", "plotly"),
    (("film", "."), "film", "playwright"),
)


@pytest.mark.slow
def test_what_needs_an_extra_names_it_in_one_line_and_writes_nothing(base: Path, tmp_path: Path):
    done = handover(base, tmp_path, [call for call, *_ in LACKING])
    for (status, output), (call, extra, names) in zip(done, LACKING, strict=True):
        assert status in (2, 3), call
        assert f'"handover-cosim[{extra}]"' in output
        assert names in output
        assert len(output.splitlines()) == 1
    assert not list(tmp_path.iterdir())
