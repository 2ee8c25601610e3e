from pathlib import Path

import numpy as np
import pytest
from support.scenarios.made_tables import made_table
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.published.helix.helix_places import HelixPlaces, random_places
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.robots.helix.workspace import cameras_that_see, reach
from handover.scenarios.runs.campaign.table import CampaignTable

PLACES = random_places(200)


def table_of(missed: int, offset: float = 0.001) -> CampaignTable:
    reasons = ("the ball left", "the ball was pushed out of the hand at 5.1 s; ball at")
    return made_table(
        {name: float(value) for name, value in place.items()}
        | {"status": "done", "success": i >= missed, "reason": reasons[i < missed], "final_distance": 0.001}
        | {"closing_distance": 0.003, "grasp_offset_lateral": offset, "grasp_offset_axial": 0.0}
        for i, place in enumerate(PLACES)
    )


def test_places_are_within_reach_and_view_and_others_for_another_seed():
    for place in PLACES[::4]:
        r, z, a = (float(place[name]) for name in ("radius", "height", "azimuth"))
        assert r <= reach(z) + 1e-3
        assert cameras_that_see(np.array([r * np.cos(a), r * np.sin(a), z])) == 2
    assert random_places(3, seed=1) != PLACES[:3]
    assert HelixPlaces().plan(quick=False).points == PLACES
    assert HelixPlaces().plan(quick=True).points == random_places(3)


@pytest.mark.parametrize(
    ("missed", "offset", "holds"), [(4, 0.001, [True, True]), (5, 0.001, [False, True]), (0, 0.003, [True, False])]
)
def test_claims_are_about_success_and_exactness(missed: int, offset: float, holds: list[bool]):
    assert [c.verdict is Verdict.REPRODUCED for c in HelixPlaces().claims(table_of(missed, offset))] == holds


def test_each_failure_is_reported_with_its_place_and_reason(tmp_path: Path, sketches: Sketches):
    (table,) = HelixPlaces().tables(table_of(3))
    assert len(table.rows) == 3
    assert "pushed the ball out of the hand (3)" in table.note
    (drawn,) = HelixPlaces().draw(table_of(3), tmp_path, tmp_path)
    sketches.check(drawn.name)
