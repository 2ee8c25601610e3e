"""Campaigns of an FMU or an SSP: parameters by its own names, the values of outputs as metrics, the file's hash."""

import contextlib
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.campaigns import carried_out
from support.cosim.native_units import native_fmu
from support.in_process_pool import InProcessPool
from support.wording import Wording

from handover.cosim.exceptions import InvalidFmu, WiringError
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.pages.comparison.campaigns import ComparedCampaigns
from handover.scenarios.pages.comparison.entries import differences_of, read_entries
from handover.scenarios.pages.comparison.runs import metric_rows
from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import default_folder
from handover.scenarios.runs.campaign.grid import parse_grid, set_parameters
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.results import read_results
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.table_writer import rebuild_table
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.results.run_folder import InvalidRunFolder


def plan_of(file: Path | str, *grid: str, fixed: tuple[str, ...] = (), **more: Any) -> CampaignPlan:
    """Return the plan of `handover sweep FILE GRID -p FIXED`."""
    plan = CampaignPlan(scenario=str(file), points=[{}], **more)
    points = parse_grid(plan.kind, grid)
    return replace(plan, points=points, fixed=set_parameters(plan.kind, fixed, points))


def columns(table: CampaignTable, *names: str) -> list[list[float]]:
    return [table.column(name).tolist() for name in names]


def ramp(folder: Path, slope: float = 1.0) -> Path:
    file = folder / "ramp.csv"
    file.write_text(f"time,u\n0,-1\n1,{slope - 1.0}\n", encoding="utf-8")
    return file


def test_an_fmu_is_swept_by_its_own_names(tmp_path: Path):
    """y = a u + b with u = t - 1: each point's line has its ends at 0 s and 1 s, the latter a step of 0.1 s late."""
    file = native_fmu("gain", 2)
    plan = plan_of(file, "a=1,-2", "b=0:3:2", stop=Fraction(1), inputs=ramp(tmp_path))
    folder = carried_out(plan, tmp_path / "c")
    table = CampaignTable.read(folder.table)
    a, b, last, low, high = columns(table, "a", "b", "last_y", "min_y", "max_y")
    assert (a, b) == ([1.0, 1.0, -2.0, -2.0], [0.0, 3.0, 0.0, 3.0])
    assert low == pytest.approx([-1.0, 2.0, 0.2, 3.2])
    assert high == pytest.approx([-0.1, 2.9, 2.0, 5.0])
    assert last == pytest.approx([-0.1, 2.9, 0.2, 3.2])
    assert table.column("success").tolist() == [True] * 4
    assert {p.name for p in folder.fmus.iterdir()} == {file.name, "ramp.csv"}
    assert read_results(folder).shown_metrics == ("last_y", "min_y", "max_y")


def test_columns_have_the_units_that_the_fmu_declares(tmp_path: Path):
    folder = carried_out(plan_of(native_fmu("mass", 3), "m=1,2", fixed=("f=1", "k=0")), tmp_path / "c")
    table = CampaignTable.read(folder.table)
    units = [table.unit(name) for name in ("m", "f", "k", "last_x", "max_v")]
    assert units == ["kg", "N", "N/m", "m", "m/s"]
    assert table.column("last_x").tolist() == pytest.approx([0.5, 0.25])  # f t^2 / 2 m at 1 s
    assert [read_results(folder).unit(name) for name in ("m", "f")] == ["kg", "N"]


def two_gains(folder: Path) -> Path:
    s = System()
    first, second = s.add("first", native_fmu("gain", 2), u=1.0), s.add("second", native_fmu("gain", 3))
    s.connect(first.y.y, second.u.u)
    return write_ssp(s, folder / "two.ssp", "two gains", Fraction(1, 2))


def test_an_ssp_is_swept_by_names_of_units(tmp_path: Path):
    plan = plan_of(two_gains(tmp_path), "first.a=2,3", "second.b=0,1", fixed=("second.a=10",))
    folder = carried_out(plan, tmp_path / "c")
    table = CampaignTable.read(folder.table)
    first, second = columns(table, "last_first.y", "last_second.y")
    assert first == pytest.approx([2.0, 2.0, 3.0, 3.0])
    assert second == pytest.approx([20.0, 21.0, 30.0, 31.0])
    (tmp_path / "two.ssp").unlink()
    folder.table.unlink()
    rebuild_table(folder)  # from the runs' folders
    assert CampaignTable.read(folder.table).table.equals(table.table, check_metadata=True)


def test_what_is_recorded_besides_outputs_is_a_metric_and_part_of_the_campaign(tmp_path: Path):
    plan = plan_of(native_fmu("mass", 2), "m=1,2", fixed=("d=3",), recorded=("mass.d",))
    folder = carried_out(plan, tmp_path / "c")
    assert CampaignTable.read(folder.table).column("max_d").tolist() == [3.0, 3.0]
    with pytest.raises(InvalidRunFolder, match=r"recorded is mass\.d there, not given in this command"):
        folder.check(replace(plan, recorded=()), prepared(plan).fmus)
    with pytest.raises(WiringError, match=r"mass\.e"):
        prepared(replace(plan, recorded=("mass.e",)))


def test_a_value_is_the_same_however_it_is_written():
    plan = prepared(plan_of(native_fmu("mass", 2), "m=1.0,2e0", "k=0:1.50:2", fixed=("f=+0.10",))).plan
    assert [dict(point) for point in plan.points][:2] == [{"m": "1", "k": "0"}, {"m": "1", "k": "1.5"}]
    assert plan.fixed == {"f": "0.1"}


@pytest.mark.parametrize("given", ["mas=1,2", "m=1,heavy", "m=1,inf", "m=1,1.0", "m=1,2 -p k=3,4"])
def test_wrong_values_are_refused_before_anything_is_written(given: str, wording: Wording):
    grid, _, fixed = given.partition(" -p ")
    with pytest.raises(InvalidParameter) as e:
        prepared(plan_of(native_fmu("mass", 2), grid, fixed=tuple(fixed.split())))
    wording.check(e.value)


def test_what_cannot_be_run_is_refused(tmp_path: Path, wording: Wording):
    file = two_gains(tmp_path)
    for subject, grid, error in (
        (file, "first.c=1,2", InvalidParameter),
        (file, "first.a=1,x", InvalidParameter),
        (tmp_path / "absent.fmu", "a=1,2", InvalidFmu),
    ):
        with pytest.raises(error) as e:
            prepared(plan_of(subject, grid))
        wording.check(e.value)
    with pytest.raises(UsageError) as e:
        plan_of(native_fmu("mass", 2), "m=1,2", inputs=tmp_path / "absent.csv")
    wording.check(e.value)


def test_the_same_files_resume_it_and_others_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    opened = contextlib.ExitStack()  # removes what is empty
    file, inputs = tmp_path / "gain.fmu", ramp(tmp_path)
    file.write_bytes(native_fmu("gain", 2).read_bytes())
    plan = plan_of(file, "a=1,2", inputs=inputs, stop=Fraction(1))

    def fmus() -> dict[str, Path]:
        return dict(prepared(plan).fmus)

    folder = default_folder(plan, fmus(), opened)
    assert folder.path.name.endswith("_gain")
    pool = InProcessPool(lambda job: "its worker went away" if "a=2" in job.name else "")
    run_campaign(prepared(plan), folder, pool, lambda _counts: None)
    assert default_folder(plan, fmus(), opened).path == folder.path
    resumed = InProcessPool()
    run_campaign(prepared(plan), folder, resumed, lambda _counts: None)
    assert resumed.begun == ["001_a=2_r0000"]
    source = json.loads((folder.runs / "001_a=2_r0000" / "run.json").read_text())["source"]
    assert source["fmu"] == str(tmp_path / folder.fmus / "gain.fmu")  # all workers see it
    ramp(tmp_path, slope=3.0)
    with pytest.raises(InvalidRunFolder, match=r"content of .*ramp\.csv is ramp\.csv"):
        folder.check(plan, fmus())
    ramp(tmp_path)
    file.write_bytes(native_fmu("gain", 3).read_bytes())
    with pytest.raises(InvalidRunFolder, match=r"unit gain is gain\.fmu \(sha256 .* there, gain\.fmu \(sha256"):
        folder.check(plan, fmus())


def test_campaigns_of_two_files_are_compared(tmp_path: Path):
    """Two versions of a unit, each a file of its own name, beside each other at the same values."""
    paths = [tmp_path / "ours", tmp_path / "theirs"]
    for path, file in zip(paths, (native_fmu("mass", 2), native_fmu("mass", 3)), strict=True):
        carried_out(plan_of(file, "m=1,2", fixed=("f=1",)), path)
    campaigns, _ = read_entries(paths)
    compared = ComparedCampaigns(campaigns, ("last_x",))
    assert [compared.label_of(key) for key in compared.matched] == ["m 1 kg", "m 2 kg"]
    for key in compared.matched:
        ours, theirs = (compared.median(point, "last_x") for point in compared.at(key).values())
        assert ours == pytest.approx(theirs)
    _, runs = read_entries([path / "runs" / "000_m=1_r0000" for path in paths])
    assert [row.name for row in metric_rows(runs)][:4] == ["last_x", "last_v", "min_x", "max_x"]
    assert {(d.kind, d.name) for d in differences_of(runs)} == {("unit", "mass")}
