"""The experiment `ir-sensor`: what it runs, and what it makes of made-up results."""

from collections.abc import Callable

import pytest
from support.scenarios.made_tables import empty, made_table, one

from handover.scenarios.published.ir_grasp.ir_sensor import (
    REFLECTIVITIES,
    TOLERANCES,
    IrSensorCurve,
    case,
    sensor_runs,
)
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.robots.ir_grasp.ir_sensor import AT, Finger
from handover.scenarios.runs.campaign.plan import PlannedRun
from handover.scenarios.runs.campaign.table import CampaignTable


def sensor_table(**metrics: Callable[[PlannedRun], float | None]) -> CampaignTable:
    """Return a table of the whole plan in which sensors are on their curve, but for metrics as given."""
    usual = {"rank_correlation": 1.0, "first_seen": 0.064, "fit_residual": 3e-4, **AT}
    usual |= {"fit_a": 0.062, "fit_b": -0.003, "fit_c": 0.022, "fit_d": -0.00043}
    return made_table(
        {"run": run.name, "status": "done", "success": True, "finger": run.parameters["finger"]}
        | {name: float(run.parameters[name]) for name in ("reflectivity", "incidence", "scene.sensor_tolerance")}
        | usual
        | {name: of(run) for name, of in metrics.items()}
        for run in IrSensorCurve().plan(quick=False).runs()
    )


def test_the_whole_plan_has_every_sensor_material_and_tolerance():
    runs = sensor_runs(sensor_table())
    assert all(len(runs.of(*case(reflectivity=rho))) == 9 for rho in REFLECTIVITIES)
    assert all(len(runs.of(*case(tolerance=t))) == 9 for t in TOLERANCES)
    assert len(runs.of(*case(Finger.RING, incidence=0.4))) == 3


def test_what_follows_from_the_scenes_own_assumptions_is_reported_of_the_worst_and_has_no_verdict():
    def off(run: PlannedRun) -> float:
        return -0.003 * (1.2 if run.parameters["finger"] == "thumb" else 0.9)

    def lost(run: PlannedRun) -> float:
        return 0.98 if run.parameters["reflectivity"] == "2" and run.repetition == 0 else 1.0

    claims = IrSensorCurve().claims(sensor_table(fit_b=off, rank_correlation=lost))
    reported = {"Distance over": "", "a, b, c, d vary": "off by 0 %: 20 %"}
    reported["A relative estimate"] = "rank correlation 0.9800 at least (reflectivity 2)"
    for part, measured in reported.items():
        claim = one(claims, part)
        assert claim.verdict is Verdict.NOT_COMPARABLE
        assert claim.measured.startswith(measured)


@pytest.mark.parametrize(("error", "holds"), [(0.0039, True), (0.0041, False)])
def test_one_curve_is_judged_by_its_worst_error_at_the_target(error: float, holds: bool):
    def wrong(run: PlannedRun) -> float:
        return 0.010 + (error if run.parameters["reflectivity"] == "0.5" and run.repetition == 1 else 0.0)

    claim = one(IrSensorCurve().claims(sensor_table(apparent_at_10_mm=wrong)), "With one curve")
    assert (claim.verdict is Verdict.REPRODUCED) is holds


@pytest.mark.parametrize(("error", "verdict"), [(0.0, Verdict.NOT_COMPARABLE), (0.005, Verdict.NOT_REPRODUCED)])
def test_one_curve_is_refuted_but_not_confirmed_where_a_reflectivity_was_not_run(error: float, verdict: Verdict):
    def measured(run: PlannedRun) -> float | None:
        return None if run.parameters["reflectivity"] == "1.5" else 0.010 + error

    claim = one(IrSensorCurve().claims(sensor_table(apparent_at_10_mm=measured)), "With one curve")
    assert claim.verdict is verdict
    assert "1.5" in claim.reason


def test_a_distance_that_most_runs_do_not_see_is_reported_as_not_seen():
    def unseen(run: PlannedRun) -> float | None:
        return None if run.parameters["reflectivity"] == "0.2" and run.parameters["finger"] != "ring" else 0.06

    materials = IrSensorCurve().tables(sensor_table(apparent_at_60_mm=unseen))[2]
    cells = {row[0]: dict(zip(materials.header, row, strict=True))["at 60 mm"] for row in materials.rows}
    assert cells["0.2"] == "not seen"
    assert cells["0.5"] == "60.0"


def test_without_runs_there_are_no_verdicts():
    nothing = empty(sensor_table())
    assert {c.verdict for c in IrSensorCurve().claims(nothing)} == {Verdict.NOT_COMPARABLE}
    assert [len(t.rows) for t in IrSensorCurve().tables(nothing)] == [1, 0, 0]  # the controller's own curve
