"""`handover run` with options of the master, on the two-mass oscillator as an SSP."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from support.cosim.oscillator import PLAIN, STATES
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.scenarios.cli.command import main


@pytest.fixture
def ssp(tmp_path: Path) -> Path:
    return write_ssp(PLAIN.three_units(Fraction(1, 100), 3), tmp_path / "masses.ssp", "two masses", Fraction(1))


def run(file: Path, out: Path, *options: str) -> Result:
    return CliRunner().invoke(main, ["run", str(file), "--step", "1/100", "--no-report", "--out", str(out), *options])


def read(out: Path, name: str) -> Any:
    return json.loads((out / name).read_text())


def error_at_end(out: Path) -> float:
    record = Record(out / "signals.parquet")
    assert record.time[-1] == 1.0
    return float(np.max(np.abs(np.array([record[s][-1] for s in STATES]) - PLAIN.exact(1.0))))


def test_what_is_chosen_is_done_and_reported(ssp: Path, tmp_path: Path):
    chosen = ("--algorithm", "newton", "--tolerance", "1e-6", "--iterations", "20", "--extrapolation", "linear")
    result = run(ssp, tmp_path / "chosen", *chosen, "--format", "csv", "--format", "csv")
    assert result.exit_code == 0, result.output
    assert error_at_end(tmp_path / "chosen") < 0.005  # it is 0.5 with the defaults
    expected = {
        "algorithm": "newton",
        "tolerance": 1e-6,
        "iterations": 20,
        "extrapolation": "linear",
        "adaptive": None,
        "repeat_discarded": False,
    }
    assert read(tmp_path / "chosen", "run.json")["master"] == expected
    assert read(tmp_path / "chosen", "run.json")["formats"] == ["csv"]
    assert read(tmp_path / "chosen", "summary.json")["master"] == expected
    assert "steps" not in read(tmp_path / "chosen", "summary.json")


def test_a_step_that_follows_its_error_is_reported_with_what_it_came_to(ssp: Path, tmp_path: Path):
    control = ("--adaptive", "1e-3", "--adaptive-absolute", "1e-4", "--first-step", "1/5", "--largest-step", "1/4")
    result = run(ssp, tmp_path / "out", *control, "--smallest-step", "1e-5", "--extrapolation", "linear")
    assert result.exit_code == 0, result.output
    summary = read(tmp_path / "out", "summary.json")
    assert summary["master"]["adaptive"] == {
        "relative": 1e-3,
        "absolute": 1e-4,
        "smallest": "1/100000",
        "largest": "1/4",
        "initial": "1/5",
        "uncontrolled": [],
    }
    steps = summary["steps"]
    assert steps["rejected"] >= 1
    assert steps["accepted"] == len(Record(tmp_path / "out" / "signals.parquet").time) - 1
    assert 1e-5 < steps["shortest"] < steps["longest"] < 0.25
    assert error_at_end(tmp_path / "out") < 0.05


def test_a_step_that_cannot_be_small_enough_fails_the_run(ssp: Path, tmp_path: Path):
    result = run(ssp, tmp_path / "out", "--adaptive", "1e-9", "--smallest-step", "1/1000")
    assert result.exit_code == 3, result.output
    assert "times what is tolerated" in result.output
    assert read(tmp_path / "out", "summary.json")["success"] is False


@pytest.mark.parametrize(
    "options",
    [
        ("--largest-step", "1", "--first-step", "1"),
        ("--adaptive", "0"),
        ("--tolerance", "inf"),
        ("--adaptive", "1e-3", "--largest-step", "1e-9"),
        ("--repeat-discarded", "--extrapolation", "linear"),
        ("--algorithm", "gauss"),
        ("--iterations", "0"),
    ],
    ids=" ".join,
)
def test_contradictions_are_refused_before_anything_is_made(
    ssp: Path, tmp_path: Path, options: tuple[str, ...], wording: Wording
):
    result = run(ssp, tmp_path / "out", *options)
    assert result.exit_code == 2, result.output
    wording.check(result.output)
    assert not (tmp_path / "out").exists()
