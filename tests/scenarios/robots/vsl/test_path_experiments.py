"""Runs along paths, on the built FMUs, and the claims of [Gandarias2020] sec. V-C."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.kept_runs import kept_run
from support.scenarios.flyer_runs import run
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.vsl.path_experiments import PathExperiment, VslHybrid, VslModelBased


def judge(experiment: type[PathExperiment], *parameters: str) -> Outcome:
    """Run without leaving anything."""
    p, e = parse_parameters(experiment, parameters), experiment()
    evaluator = e.evaluator(p)
    with Master(e.build(p, 1, lambda name: cached(experiment.units[name], 3))) as master:
        master.run(e.stop_time(p), [evaluator], until=lambda: evaluator.over)
    return evaluator.outcome()


def error_of(*parameters: str) -> float:
    """Return the mean error of a short run by rigid-link kinematics."""
    outcome = judge(VslModelBased, "settle=2", "speed=0.1", *parameters)
    assert "the path was completed" in outcome.reason
    assert outcome.metrics["error_far"].value > outcome.metrics["error_near"].value + 0.002  # it grows with the reach
    return outcome.metrics["mean_error"].value


def finished(experiment: type[PathExperiment]) -> tuple[Record, dict[str, float]]:
    """Return the record and the figures of a run by the defaults, which succeeds."""
    out = kept_run("run", experiment.name, "--no-report")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["success"], summary["reason"]
    return Record(out / "signals.parquet"), {name: metric["value"] for name, metric in summary["metrics"].items()}


@pytest.mark.slow
def test_a_run_leaves_its_whole_folder(tmp_path: Path):
    out = tmp_path / "run"
    run(VslHybrid, out, "points=5", "settle=1", "speed=0.2", drawn=True)
    figures = {p.name for p in (out / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("path", "shape", "errors", "error", "signals") for s in ("png", "svg")}
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("experiment", [VslModelBased, VslHybrid])
def test_the_metrics_are_those_of_the_record(experiment: type[PathExperiment]):
    record, found = finished(experiment)
    assert set(found) >= set(PathExperiment.headline) - {"estimate_error", "outside", "model_mismatch"}
    goal, moving = record["planner.p_WG_goal"], record["planner.moving"]
    left = np.flatnonzero(moving[:-1] & (np.any(np.diff(goal, axis=0) != 0.0, axis=1) | ~moving[1:]))
    error = [float(np.linalg.norm(record["arm.p_WG_meas"][k + 1] - goal[k])) for k in left.tolist()]
    assert len(error) == 200
    assert found["mean_error"] == pytest.approx(sum(error) / 200)
    assert found["path_time"] == pytest.approx(0.1 * np.pi / 0.05, abs=0.03)
    assert record.time[-1] < float(experiment().stop_time(experiment.parameters_type()))


def test_the_hybrid_errs_less_than_a_fifth_of_the_model_based_and_knows_where_the_tip_is():
    (_, hybrid), (_, model_based) = finished(VslHybrid), finished(VslModelBased)
    assert hybrid["mean_error"] < model_based["mean_error"] / 5.0
    assert hybrid["estimate_error"] < min(0.005, hybrid["model_error"] / 5.0)
    assert hybrid["outside"] < 0.1


@pytest.mark.slow
def test_the_error_grows_with_the_load_and_falls_with_the_pressure_and_rigid_links_err_less():
    usual, light, stiff, rigid = (error_of(given) for given in ("load=0.075", "load=0", "pressure=2e5", "links=rigid"))
    assert max(light, stiff) < usual - 0.001
    assert finished(VslHybrid)[1]["mean_error"] < rigid < usual


@pytest.mark.slow
@pytest.mark.parametrize(
    ("experiment", "parameters"),
    [(VslHybrid, ("path=linear", "load=0", "pressure=2e5")), (VslModelBased, ("path=square", "motion=dynamic"))],
)
def test_other_paths_loads_and_pressures_succeed(experiment: type[PathExperiment], parameters: tuple[str, ...]):
    outcome = judge(experiment, "settle=2", *parameters)
    assert outcome.success, outcome.reason


@pytest.mark.parametrize(
    ("experiment", "parameters"),
    [(VslModelBased, ("path=custom", "x_g=0.6,0,0.05")), (VslHybrid, ("model=TMP/nowhere.json",))],
)
def test_what_a_unit_refuses_is_named_before_anything_is_written(
    experiment: type[PathExperiment], parameters: tuple[str, ...], tmp_path: Path, wording: Wording
):
    with pytest.raises(InitializationError) as refused:
        run(experiment, tmp_path / "r", *(given.replace("TMP", str(tmp_path)) for given in parameters))
    wording.check(refused.value)
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    ("faults", "parameters"),
    [
        (1, ("path=custom", "x_0=0.3,0,-0.1", "x_g=0.35,0,0")),
        (2, ("path=custom", "x_0=0.3,0,-0.1", "x_g=0.3,0,-0.05")),
    ],
    ids=["below", "both below"],
)
def test_ends_below_the_ground_are_refused_and_named(faults: int, parameters: tuple[str, ...], wording: Wording):
    with pytest.raises(InvalidParameter) as caught:
        VslHybrid().build(parse_parameters(VslHybrid, parameters), 0, Path)
    assert len(caught.value.faults) == faults
    wording.check(caught.value)
