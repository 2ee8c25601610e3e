"""The experiment `ir-sensor`: what it runs, and what it makes of made-up results."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pyarrow as pa
import pytest

from handover.scenarios.campaign.plan import PlannedRun
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.ir_grasp.ir_sensor import AT
from handover.scenarios.published.ir_grasp.ir_sensor import IrSensorCurve
from handover.scenarios.published.ir_grasp.ir_sensor_cases import REFLECTIVITIES, TOLERANCES, Case, SensorRuns
from handover.scenarios.published.published_experiment import Claim, Verdict


def sensor_table(quick: bool = False, **metrics: Callable[[PlannedRun], float | None]) -> CampaignTable:
    """Return a table of the whole plan in which sensors are on their curve, but for metrics as given."""

    def row(run: PlannedRun) -> Mapping[str, Any]:
        figures: dict[str, Any] = {"rank_correlation": 1.0, "first_seen": 0.064, "fit_residual": 3e-4, **AT}
        figures.update({"fit_a": 0.062, "fit_b": -0.003, "fit_c": 0.022, "fit_d": -0.00043})
        figures.update({name: of(run) for name, of in metrics.items()})
        return {
            "run": run.name,
            "status": "done",
            "success": True,
            "finger": run.parameters["finger"],
            **{name: float(run.parameters[name]) for name in ("reflectivity", "incidence", "scene.sensor_tolerance")},
            **figures,
        }

    return CampaignTable(pa.Table.from_pylist([dict(row(run)) for run in IrSensorCurve().plan(quick).runs()]))


def one(claims: Sequence[Claim], begin: str) -> Claim:
    (found,) = (claim for claim in claims if claim.claim.startswith(begin))
    return found


def test_the_whole_plan_has_every_sensor_material_and_tolerance():
    runs = SensorRuns(sensor_table())
    assert all(len(runs.rows(Case(reflectivity=rho))) == 9 for rho in REFLECTIVITIES)
    assert all(len(runs.rows(Case(tolerance=t))) == 9 for t in TOLERANCES)
    assert len(runs.rows(Case(incidence=0.4))) == 3


def test_what_follows_from_the_scenes_own_assumptions_has_no_verdict():
    claims = IrSensorCurve().claims(sensor_table())
    assert one(claims, "Distance over reading").verdict is Verdict.NOT_COMPARABLE
    assert one(claims, "a, b, c, d vary only slightly").verdict is Verdict.NOT_COMPARABLE


def test_constants_are_told_by_their_largest_deviation_from_the_mean():
    def off(run: PlannedRun) -> float:
        return -0.003 * (1.2 if run.parameters["finger"] == "thumb" else 0.9)

    claim = one(IrSensorCurve().claims(sensor_table(fit_b=off)), "a, b, c, d vary")
    assert claim.measured.startswith("off by 0 %: 20 %")


def test_that_readings_keep_the_order_is_told_of_the_worst_material_and_judged_of_none():
    def lost(run: PlannedRun) -> float:
        return 0.98 if run.parameters["reflectivity"] == "2" and run.repetition == 0 else 1.0

    claim = one(IrSensorCurve().claims(sensor_table(rank_correlation=lost)), "A relative estimate")
    assert claim.verdict is Verdict.NOT_COMPARABLE
    assert claim.measured == "rank correlation 0.9800 at least (reflectivity 2)"


@pytest.mark.parametrize(("error", "holds"), [(0.0039, True), (0.0041, False)])
def test_one_curve_is_judged_by_its_worst_error_at_the_target(error: float, holds: bool):
    def wrong(run: PlannedRun) -> float:
        return 0.010 + (error if run.parameters["reflectivity"] == "0.5" and run.repetition == 1 else 0.0)

    claim = one(IrSensorCurve().claims(sensor_table(apparent_at_10_mm=wrong)), "With one curve")
    assert (claim.verdict is Verdict.REPRODUCED) is holds


def test_a_distance_that_most_runs_do_not_see_is_told_as_not_seen():
    def unseen(run: PlannedRun) -> float | None:
        return None if run.parameters["reflectivity"] == "0.2" and run.parameters["finger"] != "ring" else 0.06

    materials = IrSensorCurve().tables(sensor_table(apparent_at_60_mm=unseen))[2]
    cells = {row[0]: dict(zip(materials.header, row, strict=True))["at 60 mm"] for row in materials.rows}
    assert cells["0.2"] == "not seen"
    assert cells["0.5"] == "60.0"


def test_without_runs_there_are_no_verdicts():
    empty = CampaignTable(sensor_table().table.slice(0, 0))
    assert {c.verdict for c in IrSensorCurve().claims(empty)} == {Verdict.NOT_COMPARABLE}
    assert [len(t.rows) for t in IrSensorCurve().tables(empty)] == [1, 0, 0]  # the controller's own curve
