"""Runs along paths, on the built FMUs, and the claims of [Gandarias2020] sec. V-C."""

import hashlib
import itertools
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.kept_runs import kept_run

from handover.cosim.exceptions import InitializationError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import Observer
from handover.fmus.build import cached
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.runner import run_task
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import RunResult
from handover.scenarios.results.task import Task
from handover.scenarios.vsl.path_experiments import PathExperiment, VslHybrid, VslModelBased

BOTH = [VslModelBased, VslHybrid]


def run(experiment: type[PathExperiment], out: Path, *parameters: str) -> RunResult:
    """Run as the command does, with record, figures and report."""
    task = Task(
        experiment=experiment(),
        parameters=parse_parameters(experiment, parameters),
        seed=0,
        fmus={name: cached(unit, 3) for name, unit in experiment.units.items()},
        folder=RunFolder(out),
    )
    with Interruption() as interruption:
        return run_task(task, lambda _t, _stop: None, interruption)


def judge(
    experiment: type[PathExperiment], *parameters: str, seed: int = 0, observers: Sequence[Observer] = ()
) -> Outcome:
    """Run without leaving anything."""
    p, e = parse_parameters(experiment, parameters), experiment()
    evaluator = e.evaluator(p)
    with Master(e.build(p, seed, lambda name: cached(experiment.units[name], 3))) as master:
        master.run(e.stop_time(p), [*observers, evaluator], until=lambda: evaluator.over)
    return evaluator.outcome()


def error_of(*parameters: str) -> float:
    """Return the mean error of a short run by rigid-link kinematics."""
    outcome = judge(VslModelBased, "settle=2", "speed=0.1", *parameters)
    assert "the path was completed" in outcome.reason
    return outcome.metrics["mean_error"].value


def digest(out: Path) -> str:
    return hashlib.sha256((out / "signals.parquet").read_bytes()).hexdigest()


Finished = Callable[[type[PathExperiment]], tuple[Path, dict[str, Any]]]


@pytest.fixture(scope="module")
def finished() -> Finished:
    """Return the folder of a run by the defaults, without figures, and its summary."""

    def of(experiment: type[PathExperiment]) -> tuple[Path, dict[str, Any]]:
        out = kept_run("run", experiment.name, "--no-report")
        return out, json.loads((out / "summary.json").read_text())

    return of


def metric(finished: tuple[Path, dict[str, Any]], name: str) -> float:
    return finished[1]["metrics"][name]["value"]


@pytest.mark.parametrize("experiment", BOTH)
def test_the_default_run_succeeds_with_all_its_figures(experiment: type[PathExperiment], finished: Finished):
    _, summary = finished(experiment)
    assert summary["success"], summary["reason"]
    assert set(summary["metrics"]) >= set(PathExperiment.headline) - {"estimate_error", "outside", "model_mismatch"}


@pytest.mark.slow
def test_a_run_leaves_its_whole_folder():
    out = kept_run("run", "vsl_hybrid")
    figures = {p.name for p in (out / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("path", "shape", "errors", "error", "signals") for s in ("png", "svg")}
    assert (out / "report.html").is_file()


@pytest.mark.parametrize("experiment", BOTH)
def test_the_metrics_are_those_of_the_record(experiment: type[PathExperiment], finished: Finished):
    ended = finished(experiment)
    record = Record(ended[0] / "signals.parquet")
    goal, moving = record["planner.p_WG_goal"], record["planner.moving"]
    left = np.flatnonzero(moving[:-1] & (np.any(np.diff(goal, axis=0) != 0.0, axis=1) | ~moving[1:]))
    error = [float(np.linalg.norm(record["arm.p_WG_meas"][k + 1] - goal[k])) for k in left.tolist()]
    assert len(error) == 200
    assert metric(ended, "mean_error") == pytest.approx(sum(error) / 200)
    assert metric(ended, "path_time") == pytest.approx(0.1 * np.pi / 0.05, abs=0.03)
    assert record.time[-1] < float(experiment().stop_time(experiment.parameters_type()))


def test_the_hybrid_errs_less_than_a_fifth_of_the_model_based(finished: Finished):
    errors = [metric(finished(e), "mean_error") for e in (VslHybrid, VslModelBased)]
    assert errors[0] < errors[1] / 5.0


def test_the_hybrid_knows_where_the_tip_is(finished: Finished):
    ended = finished(VslHybrid)
    assert metric(ended, "estimate_error") < min(0.005, metric(ended, "model_error") / 5.0)
    assert metric(ended, "outside") < 0.1


def test_the_same_seed_gives_the_same_signals_and_another_seed_others(tmp_path: Path):
    digests: list[str] = []
    for k, seed in enumerate((0, 0, 1)):
        (tmp_path / str(k)).mkdir()
        with Recorder(tmp_path / str(k) / "signals.parquet") as recorder:
            judge(VslHybrid, "settle=0.5", "speed=0.4", "points=10", seed=seed, observers=[recorder])
        digests.append(digest(tmp_path / str(k)))
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.slow
def test_the_error_grows_with_the_load_and_falls_with_the_pressure():
    loads = [error_of(f"load={kg}") for kg in (0.0, 0.05, 0.1)]
    assert all(b > a + 0.001 for a, b in itertools.pairwise(loads)), loads
    pressures = [error_of(f"pressure={pa}") for pa in (0.5e5, 1.0e5, 2.0e5)]
    assert all(b < a - 0.001 for a, b in itertools.pairwise(pressures)), pressures


@pytest.mark.slow
@pytest.mark.parametrize("path", ["curve", "square"])
def test_the_error_grows_with_the_reach(path: str):
    metrics = judge(VslModelBased, "settle=2", "speed=0.1", f"path={path}").metrics
    assert metrics["error_far"].value > metrics["error_near"].value + 0.002


@pytest.mark.slow
def test_the_hybrid_errs_less_than_rigid_links_and_they_less_than_the_model_based(finished: Finished):
    rigid = error_of("links=rigid")
    hybrid, model_based = (metric(finished(e), "mean_error") for e in (VslHybrid, VslModelBased))
    assert hybrid < rigid < model_based


@pytest.mark.slow
@pytest.mark.parametrize(
    ("experiment", "parameters"),
    [
        (VslHybrid, ("path=linear",)),
        (VslModelBased, ("path=square",)),
        (VslHybrid, ("motion=dynamic",)),
        (VslModelBased, ("load=0", "pressure=2e5")),
        (VslHybrid, ("load=0", "pressure=2e5")),
    ],
)
def test_other_paths_loads_and_pressures_succeed(experiment: type[PathExperiment], parameters: tuple[str, ...]):
    outcome = judge(experiment, *parameters, seed=1)
    assert outcome.success, outcome.reason


@pytest.mark.parametrize("experiment", BOTH)
def test_a_point_out_of_reach_is_refused_and_named_before_anything_is_written(
    experiment: type[PathExperiment], tmp_path: Path
):
    with pytest.raises(InitializationError, match=r"segment 1 of 1, point \d+ of 100, \(0\.4\d+, 0, 0\.05\) m"):
        run(experiment, tmp_path / "r", "path=custom", "x_g=0.6,0,0.05")
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    ("parameters", "entries"),
    [
        (("path=custom", "x_0=0.3,0,-0.1", "x_g=0.35,0,0"), [r"x_0: (0.3, 0, -0.1) m is below the ground"]),
        (("path=custom", "x_0=0.3,0,-0.1", "x_g=0.3,0,-0.05"), ["x_0: (0.3, 0, -0.1) m", "x_g: (0.3, 0, -0.05) m"]),
        (("x_0=0.3,0,0.1",), ["x_0: the path curve has ends of its own", "path=custom only"]),
        (("path=square", "x_0=0.3,0,0.1", "x_g=0.3,0,-0.2"), ["x_0: the path square", "x_g: the path square"]),
    ],
)
@pytest.mark.parametrize("experiment", BOTH)
def test_ends_below_the_ground_or_of_another_path_are_refused_and_named(
    experiment: type[PathExperiment], parameters: tuple[str, ...], entries: list[str], tmp_path: Path
):
    with pytest.raises(InvalidParameter) as caught:
        run(experiment, tmp_path / "r", *parameters)
    assert len(caught.value.faults) == sum(part.startswith("x_") for part in entries)
    assert all(part in str(caught.value) for part in entries)
    assert not (tmp_path / "r").exists()


def test_a_model_that_is_not_there_is_refused_and_named(tmp_path: Path):
    with pytest.raises(InitializationError, match=r"nowhere\.json"):
        run(VslHybrid, tmp_path / "r", "model=nowhere.json")
    assert not (tmp_path / "r").exists()
