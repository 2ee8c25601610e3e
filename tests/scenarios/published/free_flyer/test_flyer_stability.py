"""The map of the free-flyer's stability: the plan, and how it is judged, on tables that a test makes up."""

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.made_tables import made_table
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.published.free_flyer.flyer_stability import FlyerStability
from handover.scenarios.published.free_flyer.linear_model import linear_loop
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.robots.free_flyer.parameters import Behaviour
from handover.scenarios.runs.campaign.table import CampaignTable


@cache
def table_of(late: float = 0.0, quick: bool = False) -> CampaignTable:
    """Return the plan's runs, at rest as the poles say with the coupling's three steps and a delay besides, s."""
    rows: list[dict[str, Any]] = []
    for run in FlyerStability().plan(quick).runs():
        given = run.parameters
        behaviour, lags = Behaviour[given["behaviour"].upper()], given["propulsion"] == "limited"
        step, delay = float(given["parallel_step"]), float(given["delay"])
        radius = linear_loop(behaviour, 0.02 if lags else 0.0, round(3 * step + delay + late, 6)).pole_radius
        row = {"behaviour": given["behaviour"], "propulsion": given["propulsion"], "status": "done", "run": run.name}
        rows.append(row | {"parallel_step": step, "delay": delay, "settling_time": 2.0 if radius < 1.0 else None})
    return made_table(rows)


@pytest.mark.parametrize(("late", "verdict"), [(0.0, Verdict.REPRODUCED), (0.006, Verdict.NOT_REPRODUCED)])
def test_runs_that_differ_from_the_poles_are_noticed(late: float, verdict: Verdict):
    (claim,) = FlyerStability().claims(table_of(late))
    assert claim.verdict is verdict, claim.measured


def test_runs_that_diverge_until_a_unit_fails_count_as_not_at_rest_and_those_near_the_circle_are_reported():
    rows = table_of().rows
    diverged = [r for r in rows if r["settling_time"] is None]
    ended_so = made_table({**r, "status": "failed"} if r["settling_time"] is None else r for r in rows)
    ((kept,), (same,)) = (FlyerStability().claims(table) for table in (table_of(), ended_so))
    assert same.verdict is kept.verdict is Verdict.REPRODUCED
    assert same.measured == kept.measured
    assert f"failed, {len(diverged)}," in same.reason
    assert "near the unit circle left out" in kept.measured


@pytest.mark.parametrize(("status", "n"), [("failed", 280), ("lost", 1)])
def test_runs_that_failed_or_were_lost_keep_the_claim_from_holding(status: str, n: int):
    rows = table_of().rows
    (claim,) = FlyerStability().claims(made_table([*({**r, "status": status} for r in rows[:n]), *rows[n:]]))
    assert claim.verdict is Verdict.NOT_REPRODUCED
    assert ("1 were lost" in claim.reason) is (status == "lost")
    (claim,) = FlyerStability().claims(made_table([{"status": "failed"}]))
    assert claim.verdict is Verdict.NOT_COMPARABLE


def test_the_table_has_a_row_for_each_loop_and_step():
    (table,) = FlyerStability().tables(table_of())
    assert len(table.rows) == 20
    rigid = next(row for row in table.rows if row[:2] == ["rigid, without lag", "4"])
    assert rigid[2:] == ["14.7", "14", "16"]


@pytest.mark.slow
@pytest.mark.parametrize("broken_off", [False, True])
def test_its_figure_is_drawn_of_all_loops_and_of_a_campaign_that_was_broken_off_in_its_first(
    broken_off: bool, tmp_path: Path, sketches: Sketches
):
    rows = [r for r in table_of().rows if not broken_off or (r["behaviour"], r["propulsion"]) == ("rigid", "ideal")]
    FlyerStability().draw(made_table(rows), tmp_path, tmp_path)
    (drawn,) = sketches.values()
    assert [axes.has_data() for axes in drawn.axes].count(True) == (1 if broken_off else len(drawn.axes))
