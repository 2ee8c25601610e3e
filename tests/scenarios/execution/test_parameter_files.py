"""Files that parameters name: a run and a campaign know them by their content."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.in_process_pool import InProcessPool
from support.killed_run import killed_run

from handover.scenarios.campaign import local_cluster
from handover.scenarios.cli.command import main

ROWS = "0.30,0.0,0.10", "0.32,0.0,0.12"
OTHER = "0.30,0.0,0.10", "0.34,0.0,0.10"
CUSTOM = ("-p", "path=custom", "-p", "waypoints=way.csv")
SHORT = ("--stop", "0.3", "--no-report")


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def write(path: Path, rows: tuple[str, ...]) -> Path:
    path.write_text("\n".join(["x,y,z", *rows, ""]))
    return path.absolute()


@pytest.fixture
def way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a file of way points in the working directory, which is the test's own."""
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "way.csv", ROWS)


def files_of(run: str) -> dict[str, dict[str, str]]:
    return json.loads(Path(run, "run.json").read_text()).get("parameter_files", {})


def test_a_repeated_run_says_that_a_file_is_another(way: Path):
    assert call("run", "vsl_model_based", *CUSTOM, *SHORT, "--out", "first").exit_code == 1  # it was ended
    kept = files_of("first")
    assert list(kept) == ["waypoints"]
    assert kept["waypoints"]["file"] == str(way)
    again = call("run", "--config", "first/run.json", *SHORT, "--out", "second")
    assert files_of("second") == kept
    assert "not the file that the run had" not in again.output
    write(way, OTHER)
    changed = call("run", "--config", "first/run.json", *SHORT, "--out", "third")
    assert f"first/run.json: {way} is not the file that the run had" in changed.output
    assert files_of("third") != kept


def test_files_that_units_values_name_are_known_too_and_there_may_be_none(way: Path):
    given = ("-p", "planner.path=CUSTOM", "-p", f"planner.waypoints={way}")
    call("run", "vsl_model_based", *given, *SHORT, "--out", "run")
    assert list(files_of("run")) == ["planner.waypoints"]
    call("run", "vsl_model_based", *SHORT, "--out", "without")
    assert files_of("without") == {}


@pytest.mark.slow
def test_a_campaign_is_another_with_another_file(way: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(local_cluster, "local_cluster", InProcessPool.opened)
    sweep = (
        "sweep",
        "vsl_model_based",
        "--out",
        "campaign",
        "load=0",
        "-p",
        "arm.cap=0.02",
        *CUSTOM,
        "--stop",
        "0.1",
        "--no-report",
    )
    first = call(*sweep)
    assert first.exit_code == 0, first.output
    assert call(*sweep).exit_code == 0
    write(way, OTHER)
    refused = call(*sweep)
    assert refused.exit_code == 2
    assert "content of way.csv is way.csv (sha256 " in refused.output


def test_a_run_goes_on_with_its_own_file_alone(way: Path):
    run = killed_run(Path("killed"), 0.2, "run", "vsl_model_based", *CUSTOM, *SHORT, "--checkpoint", "0.1")
    write(way, OTHER)
    refused = call("resume", run)
    assert refused.exit_code == 2
    assert f"{way}, which its parameter waypoints names, is not the file that the run began with" in refused.output
    way.unlink()
    assert f"{way}, which its parameter waypoints names, is not there any more" in call("resume", run).output
    write(way, ROWS)
    assert call("resume", run, "--no-report").exit_code == 1  # ended as asked
