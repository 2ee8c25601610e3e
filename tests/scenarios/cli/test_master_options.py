"""`handover run` with options of the master, on two masses as an SSP."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.commands import call, data_in, refusal
from support.cosim.native_units import native_fmu
from support.cosim.oscillator import PLAIN, STATES, equal_masses

from handover.cosim.record.reader import Record
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System

STEPS = ("--step", "1/100", "--no-report", "--out")


@pytest.fixture
def ssp(tmp_path: Path) -> Path:
    return write_ssp(PLAIN.three_units(Fraction(1, 100), 3), tmp_path / "masses.ssp", "two masses", Fraction(1))


def error_at_end(out: Path) -> float:
    record = Record(out / "signals.parquet")
    assert record.time[-1] == 1.0
    return float(np.max(np.abs(np.array([record[s][-1] for s in STATES]) - PLAIN.exact(1.0))))


def test_what_is_chosen_is_done_and_reported(ssp: Path, tmp_path: Path):
    out = tmp_path / "chosen"
    chosen = ("--algorithm", "newton", "--tolerance", "1e-6", "--iterations", "20", "--extrapolation", "linear")
    result = call("run", ssp, *STEPS, out, *chosen, "--format", "csv", "--format", "csv")
    assert result.exit_code == 0, result.output
    assert error_at_end(out) < 0.005  # it is 0.5 with the defaults
    expected = {"algorithm": "newton", "tolerance": 1e-6, "iterations": 20, "extrapolation": "linear"}
    run, summary = data_in(out, "run"), data_in(out)
    assert run["master"] == summary["master"] == {**expected, "adaptive": None, "repeat_discarded": False}
    assert run["formats"] == ["csv"]
    assert "steps" not in summary


def test_a_step_that_follows_its_error_is_reported_with_what_it_came_to(ssp: Path, tmp_path: Path):
    control = ("--adaptive", "1e-3", "--adaptive-absolute", "1e-4", "--first-step", "1/5", "--largest-step", "1/4")
    more = ("--smallest-step", "1e-5", "--extrapolation", "linear")
    result = call("run", ssp, *STEPS, tmp_path / "out", *control, *more)
    assert result.exit_code == 0, result.output
    summary = data_in(tmp_path / "out")
    lengths = {"smallest": "1/100000", "largest": "1/4", "initial": "1/5", "uncontrolled": []}
    assert summary["master"]["adaptive"] == {"relative": 1e-3, "absolute": 1e-4, **lengths}
    steps = summary["steps"]
    assert steps["rejected"] >= 1
    assert steps["accepted"] == len(Record(tmp_path / "out" / "signals.parquet").time) - 1
    assert 1e-5 < steps["shortest"] < steps["longest"] < 0.25
    assert error_at_end(tmp_path / "out") < 0.05


def test_iterations_are_counted_and_what_does_not_converge_ends_the_run_with_status_3(ssp: Path, tmp_path: Path):
    system = equal_masses(k_c=4000.0).two_units(Fraction(1, 10))
    masses, out = write_ssp(system, tmp_path / "stiff.ssp", "two masses", Fraction(1)), tmp_path / "newton"
    result = call("run", masses, "--algorithm", "newton", "--no-report", "--out", out)
    assert result.exit_code == 0, result.output
    metrics = data_in(out)["metrics"]
    assert 1.0 < metrics["iterations"]["value"] < 4.0
    assert metrics["rollbacks"]["value"] >= 10
    strict = ("--algorithm", "fixed-point", "--tolerance", "1e-15", "--iterations", "2")
    for file, options, reported in (
        (masses, strict, "found no solution in 2 iterations"),
        (ssp, ("--adaptive", "1e-9", "--smallest-step", "1/1000"), "times what is tolerated"),
    ):
        result = call("run", file, *STEPS, tmp_path / file.stem, *options)
        assert (result.exit_code, reported in result.output) == (3, True), result.output
        assert data_in(tmp_path / file.stem)["success"] is False
    assert "b.f -> a.f still moves by" in data_in(tmp_path / "stiff")["reason"]


def test_an_algebraic_loop_without_a_solution_is_bad_input(tmp_path: Path):
    s = System()
    unit = s.add("a", native_fmu("gain"), a=1.0, b=1.0)
    s.connect(unit.y.y, unit.u.u)
    reported = refusal("run", write_ssp(s, tmp_path / "loop.ssp", "loop", Fraction(1)), "--out", tmp_path / "out")
    assert "algebraic loop: a.y -> a.u, a.u feeds through to a.y" in " ".join(reported.split())
    assert not (tmp_path / "out").exists()
