"""`handover run` with an iterated coupling: its summary, and how it ends where the units do not converge."""

import json
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.cosim.native_units import native_fmu
from support.cosim.oscillator import equal_masses

from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.scenarios.cli.command import main


@pytest.fixture(scope="module")
def masses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("masses") / "masses.ssp"
    return write_ssp(equal_masses(k_c=4000.0).two_units(Fraction(1, 10)), file, "two masses", Fraction(1))


def run(file: Path, out: Path, *arguments: str) -> Result:
    return CliRunner().invoke(main, ["run", str(file), "--out", str(out), *arguments])


def test_the_summary_says_how_much_was_iterated(masses: Path, tmp_path: Path):
    result = run(masses, tmp_path / "out", "--algorithm", "newton", "--no-report")
    assert result.exit_code == 0, result.output
    metrics = json.loads((tmp_path / "out" / "summary.json").read_text())["metrics"]
    assert 1.0 < metrics["iterations"]["value"] < 4.0
    assert metrics["rollbacks"]["value"] >= 10


def test_units_that_do_not_agree_end_the_run_with_status_3(masses: Path, tmp_path: Path):
    strict = ("--tolerance", "1e-15", "--iterations", "2")
    result = run(masses, tmp_path / "out", "--algorithm", "fixed-point", *strict)
    assert result.exit_code == 3, result.output
    assert "found no solution in 2 iterations" in result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "b.f -> a.f still moves by" in summary["reason"]
    assert (tmp_path / "out" / "report.html").is_file()


def test_an_algebraic_loop_without_a_solution_is_bad_input(tmp_path: Path):
    s = System()
    unit = s.add("a", native_fmu("gain"), a=1.0, b=1.0)
    s.connect(unit.y.y, unit.u.u)
    result = run(write_ssp(s, tmp_path / "loop.ssp", "loop", Fraction(1)), tmp_path / "out")
    assert result.exit_code == 2, result.output
    assert "algebraic loop: a.y -> a.u, a.u feeds through to a.y" in " ".join(result.output.split())
    assert not (tmp_path / "out").exists()
