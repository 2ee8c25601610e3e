"""Outputs of which nobody thought, such as all zero or NaN: what is made of them fails by a line, the rest is made."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.constant_records import constant_record
from support.scenarios.flyer_runs import run
from support.sketched_figures import sketches as sketches

from handover.cosim.record.reader import RecordedSignals
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.reporting.run_figures import draw_figures
from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.tolerated_faults import GuardedEvaluator, ToleratedFaults, fault_line

KINDS = {"zero": 0.0, "one": 1.0, "nan": np.nan, "infinite": np.inf}
FIRST = "flyer_impedance"
LIKE_OTHERS = {"vsl_hybrid", *(f"flyer_{task}" for task in ("human_to_robot", "failed_reception", "collaborative"))}
"""Scenarios whose figures, replay and evaluator are another's."""
ALL = [(40, "nan", name) for name in SCENARIOS if name not in LIKE_OTHERS]
ALL += [(rows, kind, name) for rows, kind in ((1, "one"), (2, "infinite"), (2, "zero")) for name in (FIRST, "ir_grasp")]
ALL += [(2, "zero", "helix_handover")]


@pytest.mark.filterwarnings("ignore:.*:RuntimeWarning")
@pytest.mark.usefixtures("sketches")
@pytest.mark.parametrize(
    ("rows", "kind", "name"), [pytest.param(*one, marks=() if one[2] == FIRST else pytest.mark.slow) for one in ALL]
)
def test_verdict_figures_and_page_are_made_of_any_outputs(rows: int, kind: str, name: str, tmp_path: Path):
    experiment = SCENARIOS[name]()
    parameters = parse_parameters(SCENARIOS[name], ())
    system = experiment.build(parameters, 0, lambda unit: cached(experiment.units[unit], 3))
    folder = RunFolder(tmp_path / "run")
    folder.make()
    record = constant_record(system, KINDS[kind], rows, folder.signals)
    evaluator = GuardedEvaluator(experiment.evaluator_of_record(parameters, []))
    signals = RecordedSignals(record)
    for row, t in enumerate(record.time.tolist()):
        signals.row = row
        evaluator(t, signals)
    evaluator.finish(signals)
    outcome = evaluator.outcome()
    assert outcome.reason.startswith("not judged: ") == bool(evaluator.fault)
    assert not (evaluator.fault and outcome.success)
    faults = ToleratedFaults()
    if rows > 1:
        drawn = draw_figures(experiment, parameters, evaluator.evaluator, record, folder.figures, faults)
        assert {p.stem for p in folder.figures.iterdir()} >= {f.name for f in drawn}
    given = {v.name: _plain(getattr(parameters, v.name)) for v in experiment.parameters()}
    folder.write_run({"scenario": name, "parameters": given})
    folder.write_summary(
        {"success": outcome.success, "reason": outcome.reason, "metrics": {}, "left_out": faults.lines}
    )
    faults.lines += write_run_page(folder)
    page = folder.report.read_text(encoding="utf-8")
    assert page.count("Left out: ") == len(set(faults.lines))
    assert all(len(line) < 400 and "\n" not in line for line in faults.lines)
    assert rows == 1 or 'id="signals"' in page


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()  # type: ignore
    name = getattr(value, "name", None)
    return value if name is None else str(name).lower()


@pytest.mark.slow
def test_an_arm_whose_outputs_are_all_zero_and_figures_that_fail_cost_neither_verdict_nor_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def replay(_scenario: object, _parameters: object, _record: object) -> None:
        raise ValueError("no two points of the arm differ")

    out, arm = tmp_path / "r", "arm=support.scenarios.zero_arm:ZeroArm"
    given = ["--unit", arm, "-p", "points=3", "-p", "settle=0.2", "--out", str(out)]
    with monkeypatch.context() as patched:
        patched.setattr(SCENARIOS["vsl_model_based"], "replay", replay)
        patched.setattr(SCENARIOS["vsl_model_based"], "time_figures", replay)
        done = CliRunner().invoke(main, ["run", "vsl_model_based", *given])
    assert done.exit_code == 1, done.output
    lines = [line for line in done.output.splitlines() if " could not be drawn: " in line]
    assert [line.partition(" could")[0] for line in lines] == ["the figures over time", "the replay"]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["left_out"] == lines
    assert summary["complete"]
    for drawn in (False, True):
        page = (out / "report.html").read_text(encoding="utf-8")
        assert "Left out: the replay could not be drawn: ValueError: no two points of the arm differ" in page
        assert ('id="replay"' in page, 'id="time"' in page) == (drawn, drawn)
        assert 'id="signals"' in page
        assert CliRunner().invoke(main, ["report", str(out)]).exit_code == 0


@pytest.mark.parametrize(
    "where", ["__call__", *(pytest.param(w, marks=pytest.mark.slow) for w in ("over", "outcome", "pictures"))]
)
def test_an_evaluator_that_fails_leaves_a_whole_run_that_is_not_judged(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scenario = SCENARIOS["flyer_impedance"]
    evaluator: object = scenario().evaluator(parse_parameters(scenario, ()))

    def fail(*_: object) -> object:
        raise ZeroDivisionError("no time has passed")

    monkeypatch.setattr(evaluator.__class__, where, property(fail) if where == "over" else fail)
    ended = run(scenario, tmp_path / "r", stop=0.125)
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert (tmp_path / "r" / "signals.parquet").is_file()
    if where == "pictures":
        assert summary["left_out"] == list(ended.left_out)
        assert "the cameras' pictures could not be kept: ZeroDivisionError: no time has passed" in ended.left_out[0]
        return
    assert not ended.outcome.success
    assert ended.failure is None
    assert summary["complete"]
    assert summary["reason"].startswith("not judged: ")
    assert "ZeroDivisionError: no time has passed" in summary["reason"]


def test_a_fault_is_one_short_line_with_its_place():
    try:
        raise ValueError("a long\nmessage " * 100)
    except ValueError as e:
        line = fault_line(e)
    assert line.startswith("ValueError: a long message a long")
    assert line.endswith(")")
    assert len(line) < 300
    assert "test_constant_outputs.py, line" in line
