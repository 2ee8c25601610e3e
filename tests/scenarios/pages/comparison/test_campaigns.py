"""Campaigns beside each other: which points are matched, which runs are pairs, and what cannot be compared."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from support.campaigns import campaign_metadata, folder_of, table_of

from handover.scenarios.pages.comparison import sections
from handover.scenarios.pages.comparison.campaigns import (
    ComparedCampaigns,
    SuccessTest,
    bounds_of_p,
    metric_tests,
    remarks_on_metrics,
    success_tests,
)
from handover.scenarios.pages.comparison.entries import NotComparable, differences_of, read_entries
from handover.scenarios.pages.comparison.page import compare, write_comparison
from handover.scenarios.pages.comparison.tables import campaigns_csv, campaigns_data
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.results.run_folder import RunFolder

THINGS = [{"thing": "cylinder"}, {"thing": "baby_cup_a"}]


def campaign(
    path: Path, points: Sequence[Mapping[str, str]], repetitions: int = 6, seeds_from: int = 100, **more: Any
) -> Path:
    """Write a campaign in whose runs the object moved by the given lengths, m, or by 10 mm."""
    moved = more.pop("moved", [0.01] * len(points) * repetitions)
    seeds = [seeds_from + r for _ in points for r in range(repetitions)]
    success = more.pop("success", [r % 2 == 0 for _ in points for r in range(repetitions)])
    metrics = more.pop("metrics", {"moved": moved})
    table = table_of(points, repetitions, seed=seeds, success=success, **metrics)
    folder_of(path, campaign_metadata("ir_grasp", points, repetitions, **more), table)
    return path


def compared(*folders: Path, names: Sequence[str] = (), metrics: Sequence[str] = ()) -> ComparedCampaigns:
    campaigns, runs = read_entries(folders, names)
    assert not runs
    return ComparedCampaigns(campaigns, metrics)


def faults_of(*folders: Path, **given: Any) -> tuple[str, ...]:
    with pytest.raises(NotComparable) as raised:
        compared(*folders, **given)
    return raised.value.faults


def test_points_are_matched_by_the_values_of_what_varies_defaults_included(tmp_path: Path):
    first = campaign(tmp_path / "a", THINGS[::-1], fixed={"strategy": "reflex"})
    second = campaign(tmp_path / "b", [{"standoff": "0.07"}, {"standoff": "0.08"}])  # 70 mm is the default
    results = compared(first, second)
    assert results.keys == ("thing", "standoff")
    shared = (("thing", "cylinder"), ("standoff", "0.07"))
    assert {key: [*results.at(key)] for key in results.matched} == {
        (("thing", "baby_cup_a"), ("standoff", "0.07")): ["a"],
        shared: ["a", "b"],
        (("thing", "cylinder"), ("standoff", "0.08")): ["b"],
    }
    assert [(t.key, t.first, t.second) for t in success_tests(results)] == [(shared, "a", "b")]


def test_runs_with_one_seed_are_pairs(tmp_path: Path):
    first = campaign(tmp_path / "a", [{}], success=[True] * 6, moved=[0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
    second = campaign(tmp_path / "b", [{}], success=[False] * 6, moved=[0.012, 0.023, 0.034, 0.045, 0.056, 0.067])
    results = compared(first, second)
    (test,) = success_tests(results)
    assert test.pairs is not None
    assert (test.pairs.only_first, test.pairs.only_second, test.method) == (6, 0, "McNemar")
    assert test.p == pytest.approx(2 / 2**6)
    (moved,) = metric_tests(results, "moved")
    assert (moved.test.n, moved.test.method) == (6, "Wilcoxon")
    assert moved.test.p == pytest.approx(2 / 2**6)  # all six differences of one sign
    assert moved.test.difference == pytest.approx(0.0045)
    assert moved.test.interval is not None
    assert 0.002 <= moved.test.interval.low < 0.0045 < moved.test.interval.high <= 0.007


def test_a_pair_without_both_values_is_left_out_and_counted(tmp_path: Path):
    first = campaign(tmp_path / "a", [{}], moved=[0.01, 0.02, 0.03, float("nan"), 0.05, 0.06])
    results = compared(first, campaign(tmp_path / "b", [{}]))
    (moved,) = metric_tests(results, "moved")
    assert (moved.n, moved.runs, len(remarks_on_metrics(results))) == (5, 6, 1)
    none_together = compared(
        campaign(tmp_path / "c", [{}], 2, moved=[0.01, float("nan")]),
        campaign(tmp_path / "d", [{}], 2, moved=[float("nan"), 0.01]),
    )
    assert ["no pair" in remark for remark in remarks_on_metrics(none_together)] == [True]


def test_points_with_pairs_are_tested_together_too(tmp_path: Path):
    first = campaign(tmp_path / "a", THINGS, repetitions=3, success=[True] * 6, moved=[0.01] * 3 + [0.02] * 3)
    second = campaign(tmp_path / "b", THINGS, repetitions=3, success=[False] * 6, moved=[0.02] * 3 + [0.04] * 3)
    results = compared(first, second)
    every, *single = success_tests(results)
    assert (every.key, results.label_of(every.key)) == ((), "all runs")
    assert (every.counts, every.p) == ((6, 6, 0, 6), pytest.approx(2 / 2**6))
    assert [t.key for t in single] == list(results.matched)
    assert all(t.p == pytest.approx(2 / 2**3) for t in single)
    moved, *at = metric_tests(results, "moved")
    assert (moved.key, moved.test.n, len(at)) == ((), 6, 2)
    assert moved.test.difference == pytest.approx(0.015)


def test_a_pair_counts_where_both_runs_are_done(tmp_path: Path):
    first, second = campaign(tmp_path / "a", [{}]), campaign(tmp_path / "b", [{}], repetitions=4, seeds_from=103)
    (test,) = success_tests(compared(first, second))
    assert test.counts == (1, 3, 2, 3), "they share 103 to 105"


def test_runs_without_shared_seeds_are_compared_as_groups(tmp_path: Path):
    first = campaign(tmp_path / "a", [{}], success=[True] * 6, moved=[0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
    second = campaign(
        tmp_path / "b", [{}], seeds_from=500, success=[False] * 6, moved=[0.11, 0.12, 0.13, 0.14, 0.15, 0.16]
    )
    results = compared(first, second)
    (test,), (moved,) = success_tests(results), metric_tests(results, "moved")
    assert (test.pairs, test.method, test.counts) == (None, "Fisher", (6, 6, 0, 6))
    assert test.p == pytest.approx(2 / 924)  # of the 12 choose 6 tables, the two extreme ones
    assert (moved.test.method, moved.test.p) == ("Mann-Whitney", pytest.approx(2 / 924))
    assert moved.test.difference == pytest.approx(0.1)


@pytest.mark.parametrize(("n", "least"), [(5, 0.0625), (6, None)])
def test_too_few_pairs_or_runs_for_any_verdict_are_named_with_the_least_p(tmp_path: Path, n: int, least: float | None):
    first = campaign(tmp_path / "a", [{}], n, success=[True] * n, moved=[0.01 * k for k in range(n)])
    second = campaign(tmp_path / "b", [{}], n, success=[False] * n, moved=[0.02 + 0.02 * k for k in range(n)])
    results = compared(first, second)
    tests = [*success_tests(results), *metric_tests(results, "moved")]
    assert [(t.p if isinstance(t, SuccessTest) else t.test.p) for t in tests] == [pytest.approx(2.0 ** (1 - n))] * 2
    sentences = bounds_of_p(tests)
    assert len(sentences) == (least is not None)  # one for both tests
    section = sections.tests_section(results)
    assert section is not None
    assert all(f"{n} pairs" in s and f"{least}" in s and s in section.html for s in sentences)
    few = campaign(tmp_path / "c", [{}], 3, success=[True] * 3)
    (test,) = success_tests(compared(few, campaign(tmp_path / "d", [{}], 3, seeds_from=500, success=[False] * 3)))
    assert test.p == test.least_p == pytest.approx(2 / 20)
    assert ["3 runs each" in s for s in bounds_of_p([test])] == [True]


def test_a_metric_that_one_lacks_is_shown_where_it_is(tmp_path: Path):
    first = campaign(tmp_path / "a", [{}])
    second = campaign(tmp_path / "b", [{}], metrics={"moved": [0.02] * 6, "pushed": [0.5] * 6})
    results = compared(first, second, metrics=["moved", "pushed"])
    assert metric_tests(results, "pushed") == []
    untested, _ = remarks_on_metrics(results)
    assert all(reported in untested for reported in ("pushed", ": a has no value"))
    (point,) = campaigns_data(results, ())["points"]
    assert point["campaigns"]["a"]["metrics"]["pushed"] == {"median": None, "runs": 0, "interval": None}
    assert point["campaigns"]["b"]["metrics"]["pushed"]["median"] == 0.5
    a = point["campaigns"]["a"]
    assert (a["rate"], a["interval"]) == (0.5, pytest.approx([0.1181, 0.8819], abs=1e-4))  # Clopper-Pearson, 3 of 6
    header, a, b = campaigns_csv(results).splitlines()
    assert header.endswith("moved_median,moved_low,moved_high,pushed_median,pushed_low,pushed_high")
    assert a.startswith("a,6,6,3,0.5,")
    assert a.endswith(",0.01,,,,,")
    assert b.endswith(",0.02,,,0.5,,")


def test_columns_of_other_types_in_tables_of_other_versions_are_merged(tmp_path: Path):
    whole = campaign(tmp_path / "a", [{}], metrics={"moved": [2**60] * 6})
    real = campaign(tmp_path / "b", [{}], metrics={"moved": [0.5] * 6})
    begun = campaign(tmp_path / "c", [{}], metrics={"moved": ["0.5"] * 6})
    pq.write_table(pq.read_table(begun / "runs.parquet").slice(0, 0), begun / "runs.parquet")
    results = compared(whole, real, begun)
    assert results.table.column("moved").tolist() == [2.0**60] * 6 + [0.5] * 6


def test_settings_in_which_campaigns_differ_are_listed(tmp_path: Path):
    def unit(digest: str) -> dict[str, dict[str, str]]:
        return {"reflex": {"fmu": "IrReflex.fmu", "sha256": digest * 64}}

    first = campaign(tmp_path / "a", THINGS, units=unit("1"), versions={"numpy": "2.0"}, fixed={"strategy": "blind"})
    second = campaign(tmp_path / "b", THINGS, units=unit("2"), versions={"numpy": "2.1"}, seed=4)
    campaigns, _ = read_entries([first, second])
    assert [(d.kind, d.name, *d.values) for d in differences_of(campaigns, ["thing"])] == [
        ("parameter", "strategy", "blind", "reflex"),
        ("unit", "reflex", "IrReflex.fmu (111111111111)", "IrReflex.fmu (222222222222)"),
        ("seeds", "campaign's seed", "0", "4"),
        ("version", "numpy", "2.0", "2.1"),
    ]
    swept, _ = read_entries([campaign(tmp_path / name, [{"strategy": name}]) for name in ("blind", "forward")])
    assert [(d.name, *d.values) for d in differences_of(swept)] == [("strategy", "blind", "forward")]


def test_other_times_and_files_are_listed(tmp_path: Path):
    def read(digest: str) -> dict[str, dict[str, str]]:
        return {"u.csv": {"file": "u.csv", "sha256": digest * 64}}

    first = campaign(tmp_path / "a", THINGS, stop="5/2", parameter_files=read("1"))
    second = campaign(tmp_path / "b", THINGS, step="1/100", parameter_files=read("2"))
    campaigns, _ = read_entries([first, second])
    assert [(d.kind, d.name, *d.values) for d in differences_of(campaigns, ["thing"])] == [
        ("times", "stop time", "2.5 s", "–"),
        ("times", "communication step", "–", "0.01 s"),
        ("file", "u.csv", "u.csv (111111111111)", "u.csv (222222222222)"),
    ]


def test_campaigns_without_a_common_point_are_refused_with_their_values(tmp_path: Path):
    first, second = campaign(tmp_path / "a", THINGS), campaign(tmp_path / "b", [{"thing": "baby_cup_a"}])
    third = campaign(tmp_path / "c", [{}], fixed={"thing": "paper_box_a"})
    assert faults_of(first, second, third) == (
        f"{third}: none of its points is in another campaign: "
        "thing is paper_box_a in it, cylinder, baby_cup_a in others",
    )


def test_a_metric_in_another_unit_and_one_that_is_unknown_are_refused(tmp_path: Path):
    first, second = campaign(tmp_path / "a", [{}]), campaign(tmp_path / "b", [{}])
    table = table_of([{}], 6, moved=[1.0] * 6)
    whole: Any = table.table
    index = whole.column_names.index("moved")
    field = whole.schema.field(index).with_metadata({"role": "metric", "unit": "s"})
    table.table = whole.cast(whole.schema.set(index, field))
    folder_of(second, campaign_metadata("ir_grasp", [{}], 6), table)
    assert faults_of(first, second, metrics=["mowed"]) == (
        f"{second}: its metric moved is in s, in {first} in m",
        "no campaign has a metric 'mowed'; did you mean moved?",
    )


def test_all_faults_of_folders_and_names_are_reported_at_once(tmp_path: Path):
    first = campaign(tmp_path / "a", [{}])
    other = folder_of(tmp_path / "b", campaign_metadata("vsl_hybrid", [{}]), table_of([{}])).path
    broken, empty = tmp_path / "c", tmp_path / "d"
    for folder in (broken, empty):
        folder.mkdir()
    (broken / "campaign.json").write_text("{")
    faults = faults_of(first, other, broken, empty, first, names=["x", "x", "y"])
    assert [fault.partition(";")[0] for fault in faults[:3]] == [
        f"{first} is named twice",
        "--name is given 3 times, for 5 folders",
        "name 'x' is given twice",
    ]
    assert any(f.startswith(f"{broken}: its campaign.json is damaged") for f in faults)
    assert f"{other} is of another scenario, vsl_hybrid, than {first}, ir_grasp" in faults
    assert all("\n" not in fault for fault in faults)


def test_one_folder_is_not_enough_and_names_of_folders_tell_namesakes_apart(tmp_path: Path):
    faults_of(campaign(tmp_path / "x" / "c", [{}]))
    results = compared(tmp_path / "x" / "c", campaign(tmp_path / "y" / "c", [{}]))
    assert [e.name for e in results.entries] == ["x/c", "y/c"]


def test_campaigns_stand_beside_each_other_at_each_point_with_a_colour_each_also_in_a_list(tmp_path: Path):
    layout = compared(campaign(tmp_path / "a", THINGS), campaign(tmp_path / "b", THINGS)).layout
    assert [name for _, name in layout.ticks or ()] == ["cylinder", "baby cup a"]
    assert list(layout.group_names) == ["a", "b"]
    assert list(layout.groups) == [0, 1, 0, 1]
    assert layout.places.tolist() == pytest.approx([-0.2, 0.2, 0.8, 1.2])
    points = [{"thing": t, "strategy": s} for t in ("cylinder", "baby_cup_a") for s in ("reflex", "blind")]
    layout = compared(campaign(tmp_path / "c", points), campaign(tmp_path / "d", points)).layout
    assert layout.listed
    assert layout.places[0] > layout.places[1] > layout.places[2]
    assert list(layout.groups) == [0, 1] * 4


def test_a_campaign_that_has_not_begun_is_beside_one_that_has_and_names_are_no_html(tmp_path: Path):
    first, second = campaign(tmp_path / "a", THINGS), campaign(tmp_path / "b", THINGS)
    folder_of(second, campaign_metadata("ir_grasp", THINGS, 6), CampaignTable(table_of(THINGS).table.slice(0, 0)))
    write_comparison(compare([first, second], ["<script>alert(1)</script>", "b"]), RunFolder(tmp_path / "out"))
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "0 of 0 runs done succeeded, 12 are still to be done" in html
    assert 'id="success"' in html
    assert 'id="tests"' not in html
    assert "<script>alert" not in html
