"""What a campaign's page says, also of one that is not complete, or damaged."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from support.campaigns import campaign_metadata, folder_of, results_of, table_of
from support.wording import Wording

from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page
from handover.scenarios.pages.campaign_report.point_layout import layout_of
from handover.scenarios.pages.campaign_report.spread_section import spread_section
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

POINTS = [{"strategy": "reflex"}, {"strategy": "blind"}]


def page_of(path: Path, plan: dict[str, Any], table: CampaignTable) -> str:
    folder = folder_of(path, plan, table)
    write_campaign_page(folder)
    return folder.report.read_text(encoding="utf-8").replace("\u00a0", " ")


def replaced(table: CampaignTable, column: str, values: list[Any]) -> CampaignTable:
    index = table.table.column_names.index(column)
    whole: Any = table.table
    field = whole.schema.field(index)
    made = pa.array(values)
    fits = made.type == field.type or pa.types.is_null(made.type)
    kept = field if fits and column == "success" else pa.field(column, made.type, metadata=field.metadata)
    return CampaignTable(whole.set_column(index, kept, made.cast(kept.type)))


def part_of(html: str, anchor: str) -> str:
    """Return a section of a page."""
    return html.partition(f'id="{anchor}"')[2].partition("</section>")[0]


def test_a_campaign_that_is_not_complete_says_how_far_it_is(tmp_path: Path):
    html = page_of(tmp_path, campaign_metadata("ir_grasp", POINTS, repetitions=30), table_of(POINTS, repetitions=2))
    assert "<b>4 of 60 runs so far</b>; run the same command again to resume." in html
    assert "In 2 of 4 runs done the task succeeded." in html
    none = CampaignTable(table_of(POINTS).table.slice(0, 0))
    html = page_of(tmp_path / "begun", campaign_metadata("ir_grasp", POINTS), none)
    assert "<b>0 of 4 runs so far</b>" in html
    assert 'id="success"' not in html
    assert 'id="runs"' not in html


def test_failures_are_one_if_but_their_numbers_or_signs_differ_and_what_runs_tell_is_no_html(tmp_path: Path):
    plan = campaign_metadata("ir_grasp", POINTS)
    part = part_of(page_of(tmp_path / "numbers", plan, table_of(POINTS)), "failures")
    assert part.count("slipped at") == part.count("slipped at 0.1 s") == 1
    assert "000_r0001, 001_r0001" in part
    assert "whose reasons differ only in numbers are in one row" in part
    reasons = ["held", "-35 mm beside it", "<script>alert(1)", "+22 mm beside it"]
    html = page_of(tmp_path / "signs", plan, replaced(table_of(POINTS), "reason", reasons))
    assert part_of(html, "failures").count("mm beside it") == part_of(html, "failures").count("-35 mm beside it") == 1
    assert "<script>alert" not in html


def test_a_parameter_that_some_points_leave_alone_is_reported_as_a_gap(tmp_path: Path):
    points = [
        {"strategy": "reflex", "thing": "cylinder"},
        {"strategy": "reflex", "thing": "baby_cup_a"},
        {"strategy": "forward", "thing": "cylinder", "forward": "0.03"},
        {"strategy": "forward", "thing": "cylinder", "forward": "0.04"},
    ]
    html = page_of(tmp_path, campaign_metadata("ir_grasp", points, paired=True), table_of(points))
    assert "<td>reflex</td><td>cylinder</td><td>–</td>" in html
    assert "<td>forward</td><td>cylinder</td><td data-key='0.04'>40 mm</td>" in html
    assert "<td>reflex</td><td>cylinder</td><td>baby cup a</td>" in html


@pytest.mark.parametrize("n", [200, 201])
def test_more_points_than_a_list_has_room_for_are_in_the_table_alone(tmp_path: Path, n: int):
    points = [{"strategy": "forward", "thing": "cylinder", "forward": f"{k:d}e-4"} for k in range(n - 1)]
    points.append({"strategy": "reflex", "thing": "baby_cup_a"})
    html = page_of(tmp_path, campaign_metadata("ir_grasp", points), table_of(points))
    assert 'id="points"' in html
    assert ('id="success"' in html) == (n == 200)
    assert (f"{n} points are too many for plots" in html) == (n > 200)


def test_a_point_of_one_run_has_no_interval_in_the_plot(tmp_path: Path):
    for n in (1, 2):
        html = page_of(tmp_path / str(n), campaign_metadata("ir_grasp", POINTS, n), table_of(POINTS, n))
        part = part_of(html, "success")
        assert ("one at each point." in part) is (n == 1)
        assert ("bars: 95 % intervals" in part) is (n > 1)
        assert ('"array":[null,null]' in part) is (n == 1)


def test_points_of_a_paired_campaign_are_compared(tmp_path: Path):
    table = replaced(table_of(POINTS, repetitions=6), "success", [True] * 6 + [False] * 6)
    html = page_of(tmp_path, campaign_metadata("ir_grasp", POINTS, repetitions=6, paired=True), table)
    assert "<td class=\"number\" data-key='0.03125'>0.0312</td>" in part_of(html, "pairs")


def test_claims_stand_with_their_verdicts(tmp_path: Path):
    folder = folder_of(tmp_path, campaign_metadata("ir_grasp", POINTS), table_of(POINTS))
    claim = Claim(
        claim="it holds <more>", published="2", measured="3", verdict=Verdict.NOT_REPRODUCED, reason="3 is not 2"
    )
    known = [claim.as_data(), replace(claim, beyond=True).as_data()]
    (tmp_path / "claims.json").write_text(json.dumps(known), encoding="utf-8")
    write_campaign_page(folder)
    html = folder.report.read_text(encoding="utf-8")
    assert "it holds &lt;more&gt;" in html
    assert "The paper&#39;s claims: 1 <b class='bad'>not reproduced</b>." in html
    assert "Beyond the paper: 1 <b class='bad'>does not hold</b>." in html


def test_a_papers_campaign_of_another_version_says_what_is_left_out(tmp_path: Path):
    html = page_of(tmp_path, campaign_metadata("helix_handover", POINTS, experiment="helix-1"), table_of(POINTS))
    reported = "The campaign is of another version of helix-1, so this is left out: its runs have no tuning."
    assert reported in part_of(html, "comparison")
    whole = EXPERIMENTS["helix-1"]().plan(quick=False).size
    assert f"a quick plan, of which the whole one has {whole:,} runs" in html.replace("\u202f", ",")


@pytest.mark.parametrize(
    ("file", "content"),
    [
        pytest.param("campaign.json", "", id="an empty campaign"),
        pytest.param("campaign.json", "[]", id="a list for a campaign"),
        pytest.param("campaign.json", '{"scenario": "ir_grasp", "points": 3}', id="a number for points"),
        pytest.param("runs.parquet", "nothing", id="no table"),
        pytest.param("claims.json", '[{"claim": "x"}]', id="half a claim"),
    ],
)
def test_of_a_damaged_folder_nothing_is_written(tmp_path: Path, file: str, content: str, wording: Wording):
    folder = folder_of(tmp_path, campaign_metadata("ir_grasp", POINTS), table_of(POINTS))
    (tmp_path / file).write_text(content, encoding="utf-8")
    with pytest.raises(InvalidRunFolder) as refused:
        write_campaign_page(folder)
    wording.check(refused.value)
    assert not folder.report.exists()


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ("seed", ["x"] * 4),
        ("seed", [None] * 4),
        ("reason", [[1]] * 4),
        ("final_distance_thumb", ["x"] * 4),
        ("run", ["y" * 10_000] * 4),
    ],
)
def test_columns_of_other_types_are_refused(tmp_path: Path, column: str, values: list[Any]):
    table = replaced(table_of(POINTS, final_distance_thumb=[0.04] * 4), column, values)
    folder = folder_of(tmp_path, campaign_metadata("ir_grasp", POINTS), table)
    with pytest.raises(InvalidRunFolder):
        write_campaign_page(folder)
    assert not folder.report.exists()


def test_numbers_of_a_column_have_one_precision_and_what_is_no_number_leaves_a_gap_or_is_shown_as_it_is(tmp_path: Path):
    points = [{"forward": "<b>far</b>"}, {"forward": "0.03"}]
    plan = campaign_metadata("ir_grasp", points) | {"fixed": {"scene.material": "soft"}}
    distances = [0.04068, 0.04068, 0.00005991, 0.00005991]
    table = table_of(points, final_distance_thumb=distances, moved=[math.nan, 0.1, math.inf, None])
    page = page_of(tmp_path, plan, table)
    for anchor in ("points", "runs"):
        part = part_of(page, anchor)
        assert ">40.680<" in part
        assert ">0.060<" in part
        assert "0.05991" not in part.replace("data-key='5.991e-05'", "")
    assert "NaN" not in page.split("</nav>")[1].split("</main>")[0]
    assert "&lt;b&gt;far" in page
    assert "soft" in page[page.index("Fixed parameters") :], "a unit's parameter that is fixed to a name"


def test_a_median_of_some_of_the_runs_says_of_how_many_and_its_interval_has_its_digits(tmp_path: Path):
    values = [*np.linspace(0.0627, 0.0629, 12).tolist(), *[0.04] * 2, *[math.nan] * 10]
    plan = campaign_metadata("ir_grasp", POINTS, repetitions=12)
    part = part_of(page_of(tmp_path, plan, table_of(POINTS, 12, final_distance_thumb=values)), "points")
    assert ", of 2<" in part
    assert "so many of the runs done have a value" in part
    ((median, low, high),) = re.findall(r">(\d+\.\d+) \((\S+) to (\S+)\)<", part)
    assert float(low) <= float(median) <= float(high)
    assert len({len(text.partition(".")[2]) for text in (median, low, high)}) == 1


def test_few_runs_are_points_and_many_have_a_box_too():
    for repetitions, boxed in ((5, False), (12, True)):
        values = np.linspace(0.01, 0.02, 2 * repetitions).tolist()
        results = results_of("ir_grasp", POINTS, repetitions, final_distance_thumb=values)
        section = spread_section(results, layout_of(results))
        assert section is not None
        assert ("Boxes" in section.html) is boxed
        drawn = re.search(r'<script type="application/json">(.*?)</script>', section.html, re.DOTALL)
        assert drawn is not None
        (box, *strips) = json.loads(drawn[1])["data"]
        assert box["type"] == "box"
        assert len(box["median"]) == len(box["x"]) == (2 if boxed else 0)
        assert box["showlegend"] is boxed
        assert [strip["name"] for strip in strips] == ["succeeded", "failed"]
        assert sum(len(strip["x"]) for strip in strips) == 2 * repetitions
