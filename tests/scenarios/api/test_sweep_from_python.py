"""A campaign from Python: the command's, also from a program without a main guard, and resumed by the same call."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from support.campaigns import campaign_metadata, folder_of, table_of
from support.cosim.native_units import native_fmu
from support.in_process_pool import InProcessPool

import handover
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.runs.campaign import pools
from handover.scenarios.runs.campaign.table import CampaignTable

GIVEN: dict[str, Any] = {"seeds": 2, "strategy": ["blind", "reflex"], "standoff": 0.06}
PROGRAM = """
import handover

campaign = handover.sweep("ir_grasp", strategy=["blind", "reflex"], stop=0.1, out="c", workers=1)
print(campaign)
"""


@pytest.mark.slow
def test_a_program_without_a_main_guard_sweeps(tmp_path: Path):
    (tmp_path / "program.py").write_text(PROGRAM)
    call = [sys.executable, "program.py"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1  # workers do not run the program again
    campaign = handover.load(tmp_path / "c")
    assert isinstance(campaign, handover.Campaign)
    assert [row["strategy"] for row in campaign.rows] == ["blind", "reflex"]


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let this process be the workers."""
    monkeypatch.setattr(pools, "LocalPool", InProcessPool.opened)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a campaign of four runs, two at a point."""
    out = tmp_path_factory.mktemp("campaigns") / "c"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(pools, "LocalPool", InProcessPool.opened)
        handover.sweep("ir_grasp", **GIVEN, out=out, progress=False)
    return out


def test_it_has_a_row_for_each_run_and_a_point_for_each_value(folder: Path):
    campaign = handover.load(folder)
    assert isinstance(campaign, handover.Campaign)
    assert [row["strategy"] for row in campaign.rows] == ["blind", "blind", "reflex", "reflex"]
    seeds = [row["seed"] for row in campaign.rows]
    assert seeds[:2] == seeds[2:]  # paired
    blind, reflex = campaign.points
    assert (reflex.values, reflex.runs, reflex.rate) == ({"strategy": "reflex"}, 2, reflex.successes / 2)
    assert blind.interval is not None
    low, high = blind.interval
    assert low <= blind.rate <= high
    assert campaign.unit("final_distance_thumb") == "m"
    assert [run.success for run in campaign.runs] == [row["success"] for row in campaign.rows]
    assert campaign.runs[0].parameters["standoff"] == 0.06
    table = campaign.to_pandas()
    assert table["seed"].tolist() == seeds
    assert table.attrs["units"]["final_distance_thumb"] == "m"


def test_the_same_call_repeats_nothing(folder: Path):
    before = {path: path.stat().st_mtime_ns for path in (folder / "runs").glob("*/summary.json")}
    campaign = handover.sweep(IrGrasp, **GIVEN, out=folder)
    assert {path: path.stat().st_mtime_ns for path in (folder / "runs").glob("*/summary.json")} == before
    assert len(campaign.rows) == 4


def test_a_notebook_shows_rates_and_medians_and_its_report_is_a_page(folder: Path):
    campaign = handover.load(folder)
    html = campaign._repr_html_()  # type: ignore
    for text in ("<b>ir_grasp</b>", "of 2", "95 % interval", "reflex", "final_distance_thumb, median"):
        assert text in html
    page = campaign.report()
    assert page.path == folder / "report.html"
    assert "strategy" in page.html


def test_a_damaged_folder_is_refused(tmp_path: Path):
    plan, table = campaign_metadata("ir_grasp", [{}]), table_of([{}])
    folder_of(tmp_path, {name: value for name, value in plan.items() if name != "points"}, table)
    with pytest.raises(handover.InvalidInput, match=r"its campaign\.json is damaged: "):
        handover.load(tmp_path)
    folder_of(tmp_path, plan, CampaignTable(table.table.drop_columns(["status"])))
    with pytest.raises(handover.InvalidInput, match="it has no column status"):
        handover.load(tmp_path)


def test_units_are_varied(in_process: None, tmp_path: Path):  # noqa: ARG001
    fmus = [handover.unit("IrReflex", fmi=2), handover.unit("IrReflex", fmi=3)]
    campaign = handover.sweep("ir_grasp", units={"reflex": fmus}, strategy="blind", stop=0.1, out=tmp_path / "c")
    assert [point.values["reflex"] for point in campaign.points] == [str(fmu) for fmu in fmus]
    first, second = campaign.runs
    assert (first.signals["scene.p_WH"] == second.signals["scene.p_WH"]).all()


def test_a_file_is_swept(in_process: None, tmp_path: Path):  # noqa: ARG001
    arrays: list[list[float]] = [[1, 2, 3], [4, 5, 6]]
    campaign = handover.sweep(native_fmu("array_passer"), u=arrays, stop=0.2, step=0.1, out=tmp_path / "c")
    assert [point.values["u"] for point in campaign.points] == ["1,2,3", "4,5,6"]
    assert [row["last_y[2]"] for row in campaign.rows] == [2.0, 5.0]
    assert [float(run.metrics["max_y[3]"]) for run in campaign.runs] == [3.0, 6.0]


def test_options_of_the_command_have_a_hint():
    for option, right in (("repeat", "seeds=2"), ("report", r"report\(\)")):
        with pytest.raises(handover.InvalidInput, match=right):
            handover.sweep("ir_grasp", **dict[str, Any]({option: 1}))


def test_texts_with_commas_are_single_values():
    with pytest.raises(handover.InvalidInput, match=r"at waypoints=a,b\.csv: .*; at waypoints=c\.csv: "):
        handover.sweep("vsl_hybrid", path="custom", waypoints=["a,b.csv", "c.csv"])
