"""What spreads the times: runs with something amiss are kept apart, and compared with the published times."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.helix_1_rows import spread, table_of
from support.scenarios.made_tables import made_table, one, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.helix.helix_1_spread import spread_claims, spread_rows, spread_table, undisturbed
from handover.scenarios.published.published_experiment import Verdict

PLAIN = {0.1: spread(41.0, 1.0), 0.2: spread(29.0, 1.0), 0.4: spread(16.0, 0.5)}
DEFAULTS = {"lost_pictures": 0.0, "tremor": 0.001, "drift": 0.003, "jitter": 0.0, "detector": "joint"}


def table_with(amiss: Mapping[str, Any], times: Sequence[float | None]) -> CampaignTable:
    """Return undisturbed runs and, at the smallest step size, such with something amiss."""
    same: dict[str, Any] = {**DEFAULTS, "servo.epsilon_control": float("nan")}
    disturbed = table_of({0.1: times}, **{**same, **amiss}).rows
    return made_table([*table_of(PLAIN, **same).rows, *({**row, "run": f"amiss_{row['run']}"} for row in disturbed)])


@pytest.mark.parametrize(
    ("amiss", "label"),
    [
        ({"lost_pictures": 0.6}, "pictures lost 60 %"),
        ({"detector": "published"}, "the thesis's detector"),
        ({"servo.epsilon_control": 0.0045}, "ε_control 4.5 mm"),
    ],
)
def test_runs_with_something_amiss_have_their_row_and_stay_out_of_table_1(amiss: Mapping[str, Any], label: str):
    table = table_with(amiss, spread(100.0, 50.0))
    assert [(case.label, len(rows)) for case, rows in spread_rows(table).items()] == [("nothing", 8), (label, 8)]
    assert len(undisturbed(table).rows) == 24
    assert Helix1().tables(table)[0].rows == Helix1().tables(table_of(PLAIN))[0].rows


@pytest.mark.parametrize(
    ("times", "holds"),
    [
        (spread(100.0, 50.0), True),
        (spread(100.0, 10.0), False),  # spread too little
        (spread(300.0, 50.0), False),  # too long
        ([*spread(100.0, 50.0)[:7], None], False),  # one that never closed
    ],
)
def test_times_are_like_the_published_ones_by_mean_and_spread_and_if_all_close(
    times: Sequence[float | None], holds: bool
):
    (claim,) = spread_claims(table_with({"drift": 0.03}, times))
    assert claim.beyond
    assert claim.verdict is (Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED)
    assert claim.measured == ("hand's drift 30 mm" if holds else "none of 1")


def test_the_published_times_stand_above_ours_and_two_are_too_few_to_compare(wording: Wording):
    two = table_with({"tremor": 0.01}, [50.0, 60.0])
    assert spread_claims(two)[0].verdict is Verdict.NOT_COMPARABLE
    for table in (table_with({"jitter": 0.3}, [50.0, 60.0, None, 70.0]), two):
        wording.check(text_of(spread_table(table)))
    plain = table_of(PLAIN)
    assert not spread_rows(plain)
    assert not spread_claims(plain)
    assert not spread_table(plain)


@pytest.mark.slow
def test_runs_on_the_fitted_arm_have_tables_claims_and_figures_of_their_own(tmp_path: Path, sketches: Sketches):
    arm: dict[str, Any] = {"arm.EA": 47.0, "arm.natural_length": "0.134,0.2554,0.2554", "radius": 0.14, "height": -0.62}
    shipped: dict[str, Any] = {"arm.EA": float("nan"), "arm.natural_length": "", "radius": 0.16, "height": -0.6}
    fitted = table_of({**PLAIN, 0.1: spread(100.0, 50.0)}, **{**DEFAULTS, **arm})
    both = [*table_of(PLAIN, **{**DEFAULTS, **shipped}).rows, *fitted.rows]
    table = made_table({**row, "run": f"{k}_{row['run']}"} for k, row in enumerate(both))
    assert Helix1().tables(table)[4].title == "Table 1, with the thesis's settings, arm fitted to fig. 9"
    claims, takes = Helix1().claims(table), "t step size 0.1 the arm takes 104.8 s on average"
    assert one(claims, f"A{takes}").verdict is Verdict.NOT_REPRODUCED
    on_fitted = one(claims, f"On the arm fitted to fig. 9: a{takes}")
    assert (on_fitted.verdict, on_fitted.beyond) == (Verdict.REPRODUCED, True)
    Helix1().draw(table, tmp_path, tmp_path)
    sketches.check("times", "spread")
