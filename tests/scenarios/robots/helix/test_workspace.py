"""Where the Helix reaches and its cameras see, and what is said of a place beyond it."""

import json
from itertools import product

import numpy as np
import pyarrow as pa
import pytest
from support.kept_runs import kept_run
from support.wording import Wording

from handover.fmus.build import cached
from handover.scenarios.published.helix.helix_workspace import AZIMUTHS, HEIGHTS, RADII, HelixWorkspace, reach_by_place
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.robots.helix.cameras import CameraPlaces
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.parameters import Parameters
from handover.scenarios.robots.helix.workspace import cameras_that_see, notes_on_place, reach
from handover.scenarios.runs.campaign.table import CampaignTable


def test_a_ball_is_seen_where_it_and_the_markers_are_whole_and_large_enough():
    for p_WO, cameras in (
        ([0.16, 0.0, -0.6], 2),
        ([0.0, 0.28, -0.6], 2),
        ([0.0, 0.6, -0.6], 1),  # left of a view
        ([0.0, -0.6, -0.6], 1),  # right of a view
        ([0.0, 0.0, -0.05], 0),  # too high
        ([-1.5, 0.0, -0.6], 0),  # behind
        ([0.6, 0.0, -0.6], 0),  # too far off
    ):
        assert cameras_that_see(np.array(p_WO)) == cameras, p_WO
    assert cameras_that_see(np.array([0.16, 0.0, -0.6]), CameraPlaces.THREE) == 3


def test_a_place_beyond_the_workspace_is_noted_with_how_far_the_arm_reaches(wording: Wording):
    high, far, aside, beside = np.array([[0.0, 0.0, -0.05], [0.5, 0.0, -0.6], [0.0, 0.3, -0.6], [0.0, 0.6, -0.6]])
    for notes in (notes_on_place(aside), notes_on_place(high), notes_on_place(far)):
        wording.check("\n".join(notes))
    wording.check("\n".join(notes_on_place(far, marker=0.024)))
    wording.check("\n".join(notes_on_place(beside, CameraPlaces.THREE)))
    for azimuth in np.linspace(-np.pi, np.pi, 12):
        assert not notes_on_place(np.array([0.12 * np.cos(azimuth), 0.12 * np.sin(azimuth), -0.6]))


def test_the_scenario_passes_the_notes_on():
    system = HelixHandover().build(Parameters(radius=0.3), 0, lambda name: cached(HelixHandover.units[name], 3))
    assert any("but the arm is sure to reach" in note for note in system.notes)
    assert not HelixHandover().build(Parameters(), 0, lambda name: cached(HelixHandover.units[name], 3)).notes


def table_of(reached: dict[tuple[float, float], float]) -> CampaignTable:
    """Return a place each 0.03 m; those up to a distance are reached."""
    rows = [
        {"azimuth": a, "height": z, "radius": r, "success": r <= far, "status": "done", "final_distance": 0.001}
        for (a, z), far in reached.items()
        for r in (0.03, 0.06, 0.09, 0.12)
    ]
    return CampaignTable(pa.Table.from_pylist(rows))


def test_the_reach_is_the_distance_up_to_which_all_places_are_reached():
    table = table_of({(0.0, -0.6): 0.09, (1.05, -0.6): 0.0, (0.0, -0.5): 0.12})
    assert reach_by_place(table) == {(0.0, -0.6): 0.09, (1.05, -0.6): 0.0, (0.0, -0.5): 0.12}
    rows = table.table.to_pylist()
    rows[0]["success"] = False  # at 0.03 m
    assert reach_by_place(CampaignTable(pa.Table.from_pylist(rows)))[0.0, -0.6] == 0.0


@pytest.mark.parametrize(("off", "verdict"), [(0.0, Verdict.REPRODUCED), (0.03, Verdict.NOT_REPRODUCED)])
def test_a_reach_that_is_no_longer_the_one_found_is_reported(off: float, verdict: Verdict):
    rows = [
        {"azimuth": a, "height": z, "radius": r, "success": r <= reach(z) + off + 1e-9, "status": "done"}
        for a, z, r in product(AZIMUTHS, HEIGHTS, RADII)
    ]
    assert HelixWorkspace().claims(CampaignTable(pa.Table.from_pylist(rows)))[-1].verdict is verdict
    part = HelixWorkspace().claims(CampaignTable(pa.Table.from_pylist(rows[:-1])))
    assert [claim.verdict for claim in part] == [Verdict.NOT_COMPARABLE] * 2


@pytest.mark.slow
def test_the_reach_is_tried_with_exact_measurements():
    options = ("radius=0.1", "azimuth=1.05", "height=-0.64")
    folder = kept_run("run", "helix_reach", *(text for o in options for text in ("-p", o)), "--no-report")
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["success"], summary["reason"]
