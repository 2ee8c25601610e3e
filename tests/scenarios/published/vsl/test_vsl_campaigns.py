"""Small campaigns of real runs of the VSL arm's experiments."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.in_process_pool import InProcessPool
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.cosim.record.reader import Record
from handover.scenarios.published.published_experiment import draw_figures
from handover.scenarios.published.vsl.path_traces import PathTrace, Repetitions, trace_of
from handover.scenarios.published.vsl.vsl_1 import Vsl1, Vsl1Runs, cell
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan_check import prepared


@pytest.mark.slow
def test_a_trace_is_what_the_run_was_judged_by(tmp_path: Path, sketches: Sketches):
    plan = Vsl1().plan(quick=True)
    cells = [("curve", "100 g", arm) for arm in ("rigid", "0.5 bar")]
    folder = CampaignFolder(tmp_path / "c")
    few = prepared(replace(plan, points=[cell(*which) for which in cells]))
    table = run_campaign(few, folder, InProcessPool(), lambda _tally: None)
    runs = Vsl1Runs(table)
    for which in cells:
        (name,) = runs.done.of(cell(*which)).names
        trace = trace_of(Record(folder.runs / name / "signals.parquet"))
        assert len(trace.desired) == 200
        for metric, path in (("mean_error", trace.tracked), ("servo_error", trace.servo)):
            mean = np.linalg.norm(path - trace.desired, axis=1).mean()
            assert mean == pytest.approx(runs.of(metric, *which)[0], rel=1e-9)
        assert trace.along[-1] == pytest.approx(0.1 * np.pi, rel=0.01)
        assert trace.commanded == pytest.approx(trace.desired, abs=1e-9)  # by rigid kinematics nothing is compensated
    draw_figures(Vsl1(), table, folder.runs, folder.figures)
    assert list(sketches) == ["paths", "errors_along"]


def test_repetitions_have_the_mean_and_deviation_of_their_runs():
    desired = np.array([[0.3, 0.0, 0.1], [0.3, 0.0, 0.2]])

    def shifted(by: float) -> PathTrace:
        return PathTrace(desired=desired, tracked=desired + by, servo=desired, estimated=desired, commanded=desired)

    curve = Repetitions.of([shifted(0.001), shifted(0.003)], "tracked")
    assert curve.mean == pytest.approx(desired + 0.002)
    assert curve.deviation == pytest.approx(np.full(2, np.sqrt(3.0) * np.sqrt(2.0) * 0.001))
    assert curve.errors == pytest.approx(np.sqrt(3.0) * np.array([[0.001, 0.001], [0.003, 0.003]]))
    with pytest.raises(ValueError, match="0 runs"):
        Repetitions.of([], "tracked")
