"""The fields that `handover play` offers for parameters: their sliders, which there are, and what is said of faults."""

import re
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest
from support.commands import call
from support.cosim.native_units import native_fmu
from support.rewritten_archive import described_otherwise

from handover.cosim.blocks.variable import Causality, Declared, Kind
from handover.cosim.python_process import code_command
from handover.scenarios.live.parameter_fields import faults_by_name, field_groups, field_of, without_call
from handover.scenarios.live.play_page import Session
from handover.scenarios.live.waiting_command import WaitingCommand
from handover.scenarios.runs.execution.request import RunRequest


@pytest.mark.parametrize(
    ("default", "minimum", "lowest"),
    [("0.1,0.2", None, [0.0, 0.0]), ("0.0", None, [-3.0]), ("0.5,-0.5", None, [-1.0, -2.0]), ("2.0", -1.0, [-1.0])],
)
def test_a_slider_begins_at_the_declared_minimum_or_at_0_for_what_is_positive(
    default: str, minimum: float | None, lowest: list[float]
):
    declared = Declared(name="x", kind=Kind.REAL, causality=Causality.PARAMETER, minimum=minimum)
    assert [slider[0] for slider in field_of(declared, default).sliders] == lowest


def fields_of(subject: str, *given: str) -> list[str]:
    return [f.name for group in field_groups(RunRequest(subject=subject, parameters=given)) for f in group.fields]


def test_a_scenarios_fields_are_its_parameters_without_that_of_an_algorithm_and_an_ssps_those_of_its_units(
    tmp_path: Path,
):
    assert {"force", "thrusters.flapper_range"} <= {*fields_of("flyer_impedance")}
    assert "parallel_step" not in fields_of("flyer_impedance")
    assert "parallel_step" in fields_of("flyer_impedance", "parallel_step=0.004")
    file = str(tmp_path / "x.ssp")
    done = call("export", "flyer_impedance", "--ssp", file)
    assert done.exit_code == 0, done.output
    assert {"push.force", "thrusters.flapper_range"} <= {*fields_of(file)}


def test_a_session_of_an_fmu_has_fields_of_its_inputs_and_gives_a_file_of_them_to_all_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    sessions: list[Session] = []

    async def serve(session: Session, _made: ExitStack) -> None:
        sessions.append(session)

    monkeypatch.setattr("handover.scenarios.cli.play._serve", serve)
    file = tmp_path / "f.csv"
    file.write_text("time,f\n0,0\n1,2\n", encoding="utf-8")
    fmu = tmp_path / "mass.fmu"
    described_otherwise(native_fmu("mass", 2), fmu, lambda text: re.sub("<DefaultExperiment[^>]*/>", "", text))
    arguments = (fmu, "--stop", "1", "-p", "k=2", "--input", file, "--start", "-1", "--out", tmp_path / "p")
    result = call("play", *arguments)
    assert result.exit_code == 0, result.output
    assert "its FMU proposes no communication step; 0.004 s is taken" in result.stderr
    [session] = sessions
    assert {"m", "k", "f"} <= {*session.names}
    assert (session.options, session.request.inputs) == (["--start", "-1", "--stop", "1", "--input", str(file)], file)
    assert faults_by_name(session.first().of(session.request), session.names) == {}
    assert "last_x" in session.headline


def test_a_fault_is_reported_without_the_call_that_refused_it():
    assert without_call("p: out (fmi3GetFloat64 answered Error); set by the scenario") == "p: out; set by the scenario"
    assert without_call("x (of fmi3GetFloat64) is wrong") == "x (of fmi3GetFloat64) is wrong"


def test_a_command_waits_where_pandas_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "pandas.py").write_text("raise ModuleNotFoundError('not installed', name='pandas')\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert subprocess.run(code_command("import pandas"), capture_output=True, check=False).returncode == 1
    waiting = WaitingCommand("ir_grasp")
    waiting.call(["list", "--help"])
    assert waiting.process.wait(60.0) == 0, waiting.last_error
    waiting.close()
    assert not waiting.folder.exists()
