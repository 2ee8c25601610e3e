"""The experiment `helix-1`: its plan, its claims and tables on made-up times, what spreads them, and real runs."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.in_process_pool import InProcessPool
from support.kept_runs import kept_run
from support.scenarios.helix_1_rows import spread, table_of
from support.scenarios.made_tables import made_table, one, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.cli.campaign import CampaignProgress
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.published_experiment import Claim, PaperResults, Verdict, draw_figures, write_claims
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan_check import checked_plan, prepared
from handover.scenarios.runs.campaign.pools import LocalPool
from handover.scenarios.runs.campaign.statistics import MIN_SAMPLES
from handover.scenarios.runs.campaign.table import CampaignTable

PERIOD_TEXTS = {"0.1": "1.38", "0.2": "1.51", "0.4": "1.45"}


def test_the_fitted_arm_is_tried_as_the_shipped_one_and_its_runs_are_found_again():
    plan = checked_plan(Helix1().plan(quick=False))
    fitted = [p for p in plan.points if "arm.natural_length" in p]
    assert Counter((p["alpha"], p["control_period"]) for p in fitted) == dict.fromkeys(PERIOD_TEXTS.items(), 4)
    unset = dict.fromkeys([name for p in plan.points for name in p], "")
    table = made_table({"run": str(i), "status": "failed", **unset, **p} for i, p in enumerate(plan.points))
    assert [arm.broken for arm in Helix1().arms(table)] == [12, len(fitted), 12]


def test_each_step_size_has_its_published_period_at_each_place_twice():
    plan = Helix1().plan(quick=False)
    assert plan.repetitions == 2
    plain = [p for p in plan.points if len(p) == 4]
    seen = Counter((p["tuning"], p["alpha"], p["control_period"]) for p in plain)
    assert seen == {(tuning, *pair): 4 for tuning in ("thesis", "own") for pair in PERIOD_TEXTS.items()}
    assert float(plan.fixed["patience"]) > 2 * 214.9  # the longest published one


def test_what_may_spread_the_times_is_tried_at_the_smallest_step_size_at_each_place_one_thing_at_a_time():
    disturbed = [p for p in Helix1().plan(quick=False).points if len(p) == 5]
    assert {(p["tuning"], p["alpha"], p["control_period"]) for p in disturbed} == {("thesis", "0.1", "1.38")}
    assert set(Counter(tuple(p.items())[4:] for p in disturbed).values()) == {4}


def test_a_quick_one_has_each_step_size_as_often_as_intervals_need():
    plan = Helix1().plan(quick=True)
    assert Counter((p["tuning"], p["alpha"]) for p in plan.points) == {("thesis", a): MIN_SAMPLES for a in PERIOD_TEXTS}
    assert plan.repetitions == 1


PUBLISHED = {0.1: spread(104.8, 52.0), 0.2: spread(42.2, 10.8), 0.4: spread(22.4, 4.3)}


def judged(table: CampaignTable, part: str) -> Claim:
    return one(Helix1().claims(table), part)


def times(**changed: Sequence[float | None]) -> Mapping[float, Sequence[float | None]]:
    return {alpha: changed.get(f"a{alpha:.1f}".replace(".", ""), PUBLISHED[alpha]) for alpha in PUBLISHED}


def test_the_published_figures_reproduce_themselves():
    table = table_of(PUBLISHED)
    claims = {c.claim: c for c in Helix1().claims(table)}
    lengths = ("model's gripper", "control step takes", "Doubling the smallest")  # whose eight runs leave open
    for text, claim in claims.items():
        expected = Verdict.NOT_COMPARABLE if any(part in text for part in lengths) else Verdict.REPRODUCED
        assert claim.verdict is expected, text


def test_one_ball_that_was_not_taken_is_one_too_many_and_a_crash_counts_neither_way():
    claim = judged(table_of(times(a04=[*PUBLISHED[0.4][:7], None])), "Every handover")
    assert (claim.measured, claim.verdict) == ("23/24 (96 %)", Verdict.NOT_REPRODUCED)
    assert claim.interval is not None
    assert claim.interval[1] < 1.0
    assert claim.reason.endswith("p = 1.")
    rows = table_of(PUBLISHED, success=False).rows  # grippers that closed beside the ball have moved their arms
    assert judged(made_table(rows), "begins to close").verdict is Verdict.REPRODUCED
    rows[0] |= {"status": "failed", "success": None, "arm_time": None}
    claim = judged(made_table(rows), "Every handover")
    assert claim.measured == "0/23 (0 %)"
    assert "1 run that did not come to an end" in claim.reason


def test_fewer_runs_than_four_show_nothing_of_every_run():
    rows = table_of(PUBLISHED).rows
    for n, verdict in ((1, Verdict.NOT_COMPARABLE), (3, Verdict.NOT_COMPARABLE), (4, Verdict.REPRODUCED)):
        assert judged(made_table(rows[:n]), "Every handover").verdict is verdict


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (times(a04=PUBLISHED[0.2]), Verdict.NOT_REPRODUCED),
        (dict.fromkeys(PUBLISHED, spread(40.0, 5.0)), Verdict.NOT_REPRODUCED),
        (times(a01=[None] * 8), Verdict.REPRODUCED),  # a run that never closes took longer than any
    ],
)
def test_times_that_do_not_fall_are_seen(found: Mapping[float, Sequence[float | None]], verdict: Verdict):
    claim = judged(table_of(found), "The arm's time falls")
    assert claim.verdict is verdict
    assert claim.measured.startswith("never, ") is (None in found[0.1])


@pytest.mark.parametrize(
    ("mean", "std", "verdict"),
    [(44.8, 5.0, Verdict.REPRODUCED), (24.0, 2.0, Verdict.NOT_REPRODUCED), (30.0, 40.0, Verdict.NOT_COMPARABLE)],
)
def test_a_ratio_is_of_two_unless_its_interval_says_otherwise_or_nothing(mean: float, std: float, verdict: Verdict):
    claim = judged(table_of(times(a02=np.abs(spread(mean, std)).tolist())), "from 0.2 to 0.4")
    assert claim.verdict is verdict


@pytest.mark.parametrize(("mean", "verdict"), [(24.0, Verdict.REPRODUCED), (16.0, Verdict.NOT_REPRODUCED)])
def test_a_mean_time_is_compared_with_the_published_one_and_its_spread(mean: float, verdict: Verdict):
    claim = judged(table_of(times(a04=spread(mean, 1.0))), "At step size 0.4")
    assert claim.verdict is verdict
    assert claim.interval is not None
    assert claim.interval[0] < mean < claim.interval[1]


def test_two_runs_are_too_few_for_a_mean_and_an_error_that_can_stall_at_the_threshold_is_reported():
    table = table_of(times(a04=[20.0, 25.0]))
    assert judged(table, "At step size 0.4").verdict is Verdict.NOT_COMPARABLE
    stalls = [alpha for alpha in PUBLISHED if "50 mm, the threshold" in judged(table, f"At step size {alpha}").reason]
    assert stalls == [0.1]


@pytest.mark.parametrize(("length", "verdict"), [(0.14, Verdict.NOT_COMPARABLE), (0.08, Verdict.NOT_REPRODUCED)])
def test_a_mismatch_that_the_arm_was_fitted_to_can_only_fail(length: float, verdict: Verdict):
    same = {"model_mismatch": length, "arm_travel": 0.2, "model_travel": 0.28}
    assert judged(table_of(PUBLISHED, "thesis", **same), "model's gripper").verdict is verdict


def test_runs_that_all_take_alike_have_no_interval_that_json_cannot_hold():
    alike = table_of({0.1: [40.0] * 8, 0.2: [20.0] * 8, 0.4: [20.0] * 8})
    assert json.dumps([c.as_data() for c in Helix1().claims(alike)], allow_nan=False)
    assert judged(alike, "spread").interval is None


@pytest.mark.parametrize(("distance", "verdict"), [(0.0049, Verdict.REPRODUCED), (0.0051, Verdict.NOT_REPRODUCED)])
def test_our_settings_are_judged_beyond_the_paper_and_last(distance: float, verdict: Verdict):
    ours = table_of(PUBLISHED, "own", grasp_offset_lateral=0.004, final_distance=distance)
    theirs = table_of(PUBLISHED, "thesis", grasp_offset_lateral=0.02, final_distance=0.02)
    claims = Helix1().claims(made_table([*ours.rows, *theirs.rows]))
    assert [c.beyond for c in claims] == [False] * (len(claims) - 3) + [True] * 3
    assert [c.verdict for c in claims[-3:]] == [Verdict.REPRODUCED, Verdict.REPRODUCED, verdict]
    assert claims[-2].measured == "0.0040 m against 0.0200 m (medians)"
    assert claims[-1].measured == f"{1e3 * distance:.1f} mm in the median, {1e3 * distance:.1f} mm at most"


TIMES = {0.1: spread(100.0, 50.0), 0.2: spread(40.0, 10.0), 0.4: [20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, None]}


def test_tables_have_the_papers_rows_with_ours_beside(wording: Wording):
    tables = Helix1().tables(table_of(TIMES, model_mismatch=0.1, arm_travel=0.2, model_travel=0.25))
    wording.check(text_of(tables))
    rows = {row[0]: row[1:] for row in tables[0].rows}
    assert rows["Mean"][:2] == ["104.8 ± 52.0", "100.0 ± 50.0"]
    assert rows["Gripper began to close"][4:] == ["8 of 8", "7 of 8"]


def test_settings_without_runs_have_no_tables():
    assert len(Helix1().tables(table_of(TIMES))) == 4
    assert len(Helix1().tables(made_table([*table_of(TIMES).rows, *table_of(TIMES, "own").rows]))) == 8


@pytest.mark.slow
def test_times_are_drawn_and_errors_of_runs_that_left_a_record(tmp_path: Path, sketches: Sketches):
    run = tmp_path / "runs" / "thesis_0.4_0"
    assert not Helix1().draw(table_of({alpha: [None] * 8 for alpha in TIMES}), tmp_path, tmp_path)
    assert [f.name for f in Helix1().draw(table_of(TIMES), tmp_path / "runs", tmp_path)] == ["times"]
    run.mkdir(parents=True)
    t = np.arange(0.0, 25.0, 0.02)
    record = {"time": t, "servo.phase": np.where(t < 1.45, 0, 1), "servo.error": 0.3 * np.exp(-t / 10.0)}
    pq.write_table(pa.Table.from_pydict(record), run / "signals.parquet")
    sketches.clear()
    Helix1().draw(table_of(TIMES), tmp_path / "runs", tmp_path)
    assert list(sketches) == ["times", "errors", "single_errors"]


SPREAD = "One of the disturbances"
PLAIN = {0.1: spread(41.0, 1.0), 0.2: spread(29.0, 1.0), 0.4: spread(16.0, 0.5)}
DEFAULTS: dict[str, Any] = {"lost_pictures": 0.0, "tremor": 0.001, "drift": 0.003, "jitter": 0.0, "detector": "joint"}


def table_with(amiss: Mapping[str, Any], times: Sequence[float | None]) -> CampaignTable:
    """Return undisturbed runs and, at the smallest step size, such with a disturbance."""
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
    found = Helix1().spread(table)
    assert [(case.label, len(runs)) for case, runs in found.items()] == [("nothing", 8), (label, 8)]
    assert Helix1().arms(table)[0].tried == 24
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
    claim = judged(table_with({"drift": 0.03}, times), SPREAD)
    assert claim.beyond
    assert claim.verdict is (Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED)
    assert claim.measured == ("hand's drift 30 mm" if holds else "none of 1")


def test_the_published_times_stand_above_ours_and_two_are_too_few_to_compare(wording: Wording):
    two = table_with({"tremor": 0.01}, [50.0, 60.0])
    assert judged(two, SPREAD).verdict is Verdict.NOT_COMPARABLE
    for table in (table_with({"jitter": 0.3}, [50.0, 60.0, None, 70.0]), two):
        wording.check(text_of(Helix1().tables(table)[4:]))
    plain = table_of(PLAIN)
    assert not Helix1().spread(plain)
    assert len(Helix1().tables(plain)) == 4


@pytest.mark.slow
def test_runs_on_the_fitted_arm_have_tables_claims_and_figures_of_their_own(tmp_path: Path, sketches: Sketches):
    arm: dict[str, Any] = {"arm.EA": 47.0, "arm.natural_length": "0.134,0.2554,0.2554", "radius": 0.14, "height": -0.62}
    shipped: dict[str, Any] = {"arm.EA": float("nan"), "arm.natural_length": "", "radius": 0.16, "height": -0.6}
    fitted = table_of({**PLAIN, 0.1: spread(100.0, 50.0)}, **DEFAULTS, **arm)
    both = [*table_of(PLAIN, **DEFAULTS, **shipped).rows, *fitted.rows]
    table = made_table({**row, "run": f"{k}_{row['run']}"} for k, row in enumerate(both))
    assert Helix1().tables(table)[4].title == "Table 1, with the thesis's settings, arm fitted to fig. 9"
    claims, takes = Helix1().claims(table), "t step size 0.1 the arm takes 104.8 s on average"
    assert one(claims, f"A{takes}").verdict is Verdict.NOT_REPRODUCED
    on_fitted = one(claims, f"On the arm fitted to fig. 9: a{takes}")
    assert (on_fitted.verdict, on_fitted.beyond) == (Verdict.REPRODUCED, True)
    Helix1().draw(table, tmp_path, tmp_path)
    sketches.check("times", "spread")


FAST = {"alpha": "0.4", "control_period": "1.45", "place": "front", "tuning": "thesis"}


@pytest.mark.slow
def test_an_arm_that_has_no_time_to_move_is_reported_as_such(tmp_path: Path):
    plan, place = Helix1().plan(quick=True), CampaignFolder(tmp_path / "campaign")
    few = replace(plan, points=[p for p in plan.points if p == FAST], fixed={**plan.fixed, "patience": "1"})
    table = run_campaign(prepared(few), place, InProcessPool(), CampaignProgress(StringIO()))
    results = PaperResults.of(Helix1(), table, place.runs)
    write_claims(results.claims, place)
    draw_figures(Helix1(), table, place.runs, place.figures)
    assert len(results.tables) == 4
    claims = [Claim.from_data(c) for c in json.loads((place.path / "claims.json").read_text("utf-8"))]
    closes = one(claims, "begins to close")
    assert (closes.measured, closes.verdict) == ("0/1 (0 %)", Verdict.NOT_COMPARABLE)
    assert not list(place.figures.iterdir())


@pytest.mark.slow
def test_the_record_of_a_handover_is_judged_and_drawn(tmp_path: Path, sketches: Sketches):
    run = kept_run("run", "helix_handover", "--seed", "3")
    (tmp_path / "thesis_0.4_0").symlink_to(run, target_is_directory=True)
    table = table_of({0.4: [20.0]})
    Helix1().draw(table, tmp_path, tmp_path)
    assert set(sketches) == {"times", "errors", "single_errors", "model", "estimate"}
    claims = PaperResults.of(Helix1(), table, tmp_path).claims
    assert one(claims, "Every handover succeeds").measured == "1/1 (100 %)"
    assert "/1 " in one(claims, "The error rises at the change from the first goal to the second").measured


@pytest.mark.paper
def test_table_1_at_full_size(tmp_path: Path):
    folder = CampaignFolder(tmp_path / "campaign")
    ready = prepared(Helix1().plan(quick=False))
    with LocalPool(None) as pool:
        table = run_campaign(ready, folder, pool, CampaignProgress(StringIO()))
    assert set(table.column("status")) == {"done"}
    for part in ("begins to close in every run", "The arm's time falls", "With our settings every handover succeeds"):
        assert one(Helix1().claims(table), part).verdict is Verdict.REPRODUCED
