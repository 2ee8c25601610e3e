"""Each published experiment plans runs that its scenario takes, each once, and as many as its paper has."""

import pytest

from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.runs.campaign.plan_check import checked_plan

SIZES = {
    "flyer-approaches": (1_280, 20),
    "flyer-controllers": (176, 8),
    "flyer-handover": (252, 24),
    "flyer-impedance": (162, 12),
    "flyer-navigation": (348, 18),
    "flyer-stability": (280, 30),
    "flyer-study": (1_800, 48),
    "helix-1": (136, 9),
    "helix-2": (20, 2),
    "helix-3": (16, 2),
    "helix-disturbances": (204, 9),
    "helix-improvements": (240, 4),
    "helix-places": (200, 3),
    "helix-reflex": (360, 18),
    "helix-workspace": (250, 3),
    "ir-convergence": (160, 10),
    "ir-limits": (6_708, 101),
    "ir-sensor": (87, 8),
    "ir-table": (640, 120),
    "vsl-1": (375, 18),
    "vsl-2": (580, 12),
}
"""Of the whole plan and of the quick one."""

LONG = ("helix-1", "helix-disturbances", "helix-improvements", "helix-places", "ir-limits")
PLANS = [
    pytest.param(name, quick, marks=[pytest.mark.slow] if name in LONG and not quick else [])
    for name in EXPERIMENTS
    for quick in (False, True)
]


@pytest.mark.parametrize(("name", "quick"), PLANS)
def test_the_scenario_takes_every_point(name: str, quick: bool):
    plan = EXPERIMENTS[name]().plan(quick)
    assert checked_plan(plan).size == plan.size == SIZES[name][quick]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_no_point_is_run_twice(name: str):
    points = EXPERIMENTS[name]().plan(quick=False).points
    assert len({frozenset(p.items()) for p in points}) == len(points)
