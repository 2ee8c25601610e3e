"""Each published experiment plans runs that its scenario takes, each once."""

import pytest

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.published.catalog import EXPERIMENTS


@pytest.mark.parametrize(
    "quick", [pytest.param(False, marks=pytest.mark.slow, id="whole"), pytest.param(True, id="quick")]
)
@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if not name.startswith("flyer")])
def test_the_scenario_takes_every_point(name: str, quick: bool):
    plan = EXPERIMENTS[name]().plan(quick)
    assert checked_plan(plan).size == plan.size > 0
