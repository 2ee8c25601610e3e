"""What spreads the times: runs with something amiss are kept apart, and compared with the published times."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from support.scenarios.helix_1_rows import spread, table_of

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.helix.helix_1_spread import spread_claims, spread_rows, spread_table, undisturbed
from handover.scenarios.published.published_experiment import Verdict

PLAIN = {0.1: spread(41.0, 1.0), 0.2: spread(29.0, 1.0), 0.4: spread(16.0, 0.5)}
DEFAULTS = {"lost_pictures": 0.0, "tremor": 0.001, "drift": 0.003, "jitter": 0.0, "detector": "joint"}


def table_with(amiss: Mapping[str, Any], times: Sequence[float | None]) -> CampaignTable:
    """Return undisturbed runs and, at the smallest step size, such with something amiss."""
    same: dict[str, Any] = {**DEFAULTS, "servo.epsilon_control": float("nan")}
    plain = table_of(PLAIN, **same).table.to_pylist()
    disturbed = table_of({0.1: times}, **{**same, **amiss}).table.to_pylist()
    return CampaignTable(pa.Table.from_pylist([*plain, *({**row, "run": f"amiss_{row['run']}"} for row in disturbed)]))


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
    assert undisturbed(table).table.num_rows == 24
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


def test_the_published_times_stand_above_ours():
    (table,) = spread_table(table_with({"jitter": 0.3}, [50.0, 60.0, None, 70.0]))
    assert list(table.rows[0][:5]) == ["published", "", "8 of 8", "8 of 8", "98.3 (42.9 to 214.9)"]
    assert list(table.rows[2][:5]) == [
        "jitter of the control period",
        "30 %",
        "3 of 4",
        "3 of 4",
        "60.0 (50.0 to 70.0)",
    ]


def test_two_times_are_too_few_to_compare():
    table = table_with({"tremor": 0.01}, [50.0, 60.0])
    assert spread_claims(table)[0].verdict is Verdict.NOT_COMPARABLE
    assert list(spread_table(table)[0].rows[2][5:]) == ["", "", ""]


def test_campaigns_without_such_runs_say_nothing_of_them():
    table = table_of(PLAIN)
    assert not spread_rows(table)
    assert not spread_claims(table)
    assert not spread_table(table)


@pytest.mark.slow
def test_times_are_drawn_by_what_is_amiss(tmp_path: Path):
    names = [f.name for f in Helix1().draw(table_with({"tremor": 0.01}, [50.0, None, 70.0]), tmp_path, tmp_path)]
    assert names == ["times", "spread"]
    assert (tmp_path / "spread.png").exists()


@pytest.mark.slow
def test_runs_on_the_fitted_arm_have_tables_claims_and_figures_of_their_own(tmp_path: Path):
    of_arm: dict[str, Any] = {
        "arm.EA": 47.0,
        "arm.natural_length": "0.134,0.2554,0.2554",
        "radius": 0.14,
        "height": -0.62,
    }
    plain: dict[str, Any] = {
        **DEFAULTS,
        "arm.EA": float("nan"),
        "arm.natural_length": "",
        "radius": 0.16,
        "height": -0.6,
    }
    both = [table_of(PLAIN, **plain), table_of({**PLAIN, 0.1: spread(100.0, 50.0)}, **{**plain, **of_arm})]
    rows = [{**row, "run": f"{k}_{row['run']}"} for k, part in enumerate(both) for row in part.table.to_pylist()]
    table = CampaignTable(pa.Table.from_pylist(rows))
    assert [t.title for t in Helix1().tables(table)][4] == "Table 1, with the thesis's settings, arm fitted to fig. 9"
    claims = {c.claim: c for c in Helix1().claims(table)}
    takes = "t step size 0.1 the arm takes 104.8 s on average"
    assert claims[f"A{takes}"].verdict is Verdict.NOT_REPRODUCED
    on_fitted = claims[f"On the arm fitted to fig. 9: a{takes}"]
    assert (on_fitted.verdict, on_fitted.beyond) == (Verdict.REPRODUCED, True)
    assert [f.name for f in Helix1().draw(table, tmp_path, tmp_path)] == ["times", "spread"]
