"""The fields that `handover play` offers for parameters: their sliders, which there are, and what is told of faults."""

from pathlib import Path

import pytest
from click.testing import CliRunner
from support.cosim.native_units import native_fmu

from handover.cosim.blocks.variable import Causality, Declared, Kind
from handover.scenarios.cli.command import main
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.live.parameter_fields import faults_by_name, field_groups, field_of, without_call
from handover.scenarios.live.play_page import Session


@pytest.mark.parametrize(
    ("default", "minimum", "lowest"),
    [("0.1,0.2", None, [0.0, 0.0]), ("0.0", None, [-3.0]), ("0.5,-0.5", None, [-1.0, -2.0]), ("2.0", -1.0, [-1.0])],
)
def test_a_slider_begins_at_the_declared_minimum_or_at_0_for_what_is_positive(
    default: str, minimum: float | None, lowest: list[float]
):
    declared = Declared(name="x", kind=Kind.REAL, causality=Causality.PARAMETER, minimum=minimum)
    assert [slider[0] for slider in field_of(declared, default).sliders] == lowest


def test_a_parameter_of_an_algorithm_that_no_session_runs_by_is_shown_only_where_it_is_given():
    for given in ((), ("parallel_step=0.004",)):
        groups = field_groups(RunRequest(subject="flyer_impedance", parameters=given))
        names = [field.name for group in groups for field in group.fields]
        assert ("parallel_step" in names) == bool(given)
        assert "force" in names


def test_a_session_of_an_fmu_has_fields_of_its_inputs_and_gives_a_file_of_them_to_all_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    sessions: list[Session] = []

    async def serve(session: Session) -> None:
        sessions.append(session)

    monkeypatch.setattr("handover.scenarios.cli.play._serve", serve)
    file = tmp_path / "f.csv"
    file.write_text("time,f\n0,0\n1,2\n", encoding="utf-8")
    arguments = ["play", str(native_fmu("mass", 2)), "-p", "k=2", "--input", str(file), "--start", "-1"]
    arguments += ["--out", str(tmp_path / "p")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    [session] = sessions
    assert {"m", "k", "f"} <= {*session.names}
    assert (session.options, session.request.inputs) == (["--start", "-1", "--input", str(file)], file)
    assert faults_by_name(session.first().of(session.request), session.names) == {}
    assert "last_x" in session.headline


def test_a_fault_is_told_without_the_call_that_refused_it():
    assert without_call("p: out (fmi3GetFloat64 answered Error); set by the scenario") == "p: out; set by the scenario"
    assert without_call("x (of fmi3GetFloat64) is wrong") == "x (of fmi3GetFloat64) is wrong"
