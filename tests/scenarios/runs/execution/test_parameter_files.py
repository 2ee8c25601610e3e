"""Files that parameters name: a run and a campaign know them by their content."""

from pathlib import Path

import pytest
from support.commands import call, data_in, refusal
from support.in_process_pool import InProcessPool
from support.killed_run import killed_run

from handover.scenarios.runs.campaign import pools

ROWS = "0.30,0.0,0.10", "0.32,0.0,0.12"
OTHER = "0.30,0.0,0.10", "0.34,0.0,0.10"
CUSTOM = ("-p", "path=custom", "-p", "waypoints=way.csv")
SHORT = ("--stop", "0.1", "--no-report")


def write(path: Path, rows: tuple[str, ...]) -> Path:
    path.write_text("\n".join(["x,y,z", *rows, ""]))
    return path.absolute()


@pytest.fixture
def way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a file of way points in the working directory, which is the test's own."""
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "way.csv", ROWS)


def files_of(run: str) -> dict[str, dict[str, str]]:
    return data_in(Path(run), "run").get("parameter_files", {})


def test_a_repeated_run_says_that_a_file_is_another(way: Path):
    assert call("run", "vsl_model_based", *CUSTOM, *SHORT, "--out", "first").exit_code == 1  # it was ended
    kept = files_of("first")
    assert (list(kept), kept["waypoints"]["file"]) == (["waypoints"], str(way))
    again = call("run", "--config", "first/run.json", *SHORT, "--out", "second")
    assert (files_of("second"), "not the file that the run had" in again.output) == (kept, False)
    write(way, OTHER)
    changed = call("run", "--config", "first/run.json", *SHORT, "--out", "third")
    assert f"first/run.json: {way} is not the file that the run had" in changed.output
    assert files_of("third") != kept
    given = ("-p", "planner.path=CUSTOM", "-p", f"planner.waypoints={way}")
    call("run", "vsl_model_based", *given, *SHORT, "--out", "of a unit")
    assert list(files_of("of a unit")) == ["planner.waypoints"]


@pytest.mark.slow
def test_a_campaign_is_another_with_another_file(way: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pools, "LocalPool", InProcessPool.opened)
    sweep = ("sweep", "vsl_model_based", "load=0", *CUSTOM, "--stop", "0.1", "--no-report", "--out", "campaign")
    assert [call(*sweep).exit_code for _ in range(2)] == [0, 0]
    write(way, OTHER)
    assert "content of way.csv is way.csv (sha256 " in refusal(*sweep)


def test_a_run_goes_on_with_its_own_file_alone(way: Path):
    run = killed_run(Path("killed"), 0.06, "run", "vsl_model_based", *CUSTOM, *SHORT, "--checkpoint", "0.04")
    write(way, OTHER)
    named = f"{way}, which its parameter waypoints names, "
    assert f"{named}is not the file that the run began with" in refusal("resume", run)
    way.unlink()
    assert f"{named}is not there any more" in refusal("resume", run)
    write(way, ROWS)
    assert call("resume", run, "--no-report").exit_code == 1  # ended as asked
