"""Files that parameters name: a run and a campaign know them by their content."""

import json
import signal
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from killed_run import end_between

from handover.scenarios.cli.command import main

ROWS = "0.30,0.0,0.10", "0.32,0.0,0.12"
OTHER = "0.30,0.0,0.10", "0.34,0.0,0.10"
SHORT = ("-p", "path=custom", "-p", "settle=2", "-p", "points=3")


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def write(path: Path, rows: tuple[str, ...]) -> Path:
    path.write_text("\n".join(["x,y,z", *rows, ""]))
    return path


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_repeated_run_says_that_a_file_is_another():
    way = write(Path("way.csv"), ROWS)
    assert call("run", "vsl_model_based", "-p", f"waypoints={way}", *SHORT, "--out", "first").exit_code == 0
    kept = json.loads(Path("first/run.json").read_text())["parameter_files"]
    assert list(kept) == ["waypoints"]
    assert kept["waypoints"]["file"] == str(way.absolute())
    again = call("run", "--config", "first/run.json", "--out", "second")
    assert again.exit_code == 0
    assert "not the file that the run had" not in again.output
    write(way, OTHER)
    changed = call("run", "--config", "first/run.json", "--out", "third")
    assert f"first/run.json: {way.absolute()} is not the file that the run had" in changed.output


def test_a_run_that_names_no_file_keeps_none():
    assert call("run", "vsl_model_based", "-p", "settle=1", "--out", "run").exit_code == 0
    assert "parameter_files" not in json.loads(Path("run/run.json").read_text())


def test_a_campaign_is_another_with_another_file():
    way = write(Path("way.csv"), ROWS)
    given = ("-p", "arm.cap=0.02", "-p", f"waypoints={way}", *SHORT)
    sweep = ("sweep", "vsl_model_based", "load=0,0.05", *given, "--out", "campaign")
    first = call(*sweep)
    assert first.exit_code == 0, first.output
    assert call(*sweep).exit_code == 0
    write(way, OTHER)
    refused = call(*sweep)
    assert refused.exit_code == 2
    assert f"content of {way} is {way} (sha256 " in refused.output


def test_files_that_units_values_name_are_known_too():
    way = write(Path("way.csv"), ROWS).absolute()
    given = ("-p", "planner.path=CUSTOM", "-p", f"planner.waypoints={way}", "-p", "settle=1", "--stop", "1")
    call("run", "vsl_model_based", *given, "--out", "run")
    assert list(json.loads(Path("run/run.json").read_text())["parameter_files"]) == ["planner.waypoints"]


@pytest.mark.slow
def test_a_run_goes_on_with_its_own_file_alone():
    way = write(Path("way.csv"), ROWS)
    arguments = ("run", "vsl_model_based", "-p", f"waypoints={way}", "-p", "path=custom", "-p", "settle=600")
    end_between(20.0, 500.0, signal.SIGKILL, *arguments, "--out", Path("killed"), "--checkpoint", "5")
    write(way, OTHER)
    refused = call("resume", "killed")
    assert refused.exit_code == 2
    fault = f"{way.absolute()}, which its parameter waypoints names, is not the file that the run began with"
    assert fault in refused.output
    way.unlink()
    assert (
        f"{way.absolute()}, which its parameter waypoints names, is not there any more"
        in call("resume", "killed").output
    )
    write(way, ROWS)
    assert call("resume", "killed").exit_code == 0
