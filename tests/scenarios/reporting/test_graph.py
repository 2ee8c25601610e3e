"""The graph of a run's system: places, arrows with their signals, and a table; of a large system the table alone."""

import base64
import itertools
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.fmu.file.archive import FmuArchive, write_archive
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.reporting.graph import bent, graph_section, places, rate
from handover.scenarios.reporting.html import picture_source
from handover.scenarios.reporting.run_page import write_run_page
from handover.scenarios.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.results.system_facts import describe_system

LOOP = [("camera", "vision"), ("vision", "servo"), ("servo", "arm"), ("arm", "camera"), ("arm", "hand"),
        ("hand", "arm"), ("hand", "camera")]  # fmt: skip


def unit(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "model": name.title(), "fmi": "3", "period": 0.02, "sampled": False, **more}


def connection(source: str, target: str, **more: Any) -> dict[str, Any]:
    return {"source": source, "target": target, "unit": "m", "size": 1, "kind": "real", **more}


def html_of(units: list[str], connections: list[dict[str, Any]], **more: Any) -> str:
    section = graph_section({"system": {"units": [unit(u) for u in units], "connections": connections}, **more})
    assert section is not None
    return str(section.html)


def test_a_loop_lies_clockwise_in_the_order_of_its_signals():
    at = places(["arm", "hand", "camera", "servo", "vision"], LOOP)
    angles = {name: float(np.arctan2(p[0], p[1])) % (2 * np.pi) for name, p in at.items()}
    assert sorted(angles, key=lambda name: angles[name]) == ["arm", "hand", "camera", "vision", "servo"]


@pytest.mark.parametrize("n", [1, 2, 8, 9])
def test_places_are_the_same_each_time_apart_and_within_the_square(n: int):
    names = [f"u{i}" for i in range(n)]
    pairs = list(itertools.pairwise(names))
    at = np.array(list(places(names, pairs).values()))
    assert np.array_equal(at, np.array(list(places(names, pairs).values())))
    assert np.abs(at).max() <= 1.0 + 1e-9
    assert n == 1 or min(np.linalg.norm(at[i] - at[j]) for i in range(n) for j in range(i)) > 0.05


def test_there_and_back_lie_apart():
    a, b = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    there, back = bent(a, b), bent(b, a)
    assert there[0] == pytest.approx(a)
    assert there[-1] == pytest.approx(b)
    assert np.linalg.norm(there[10] - back[10]) > 0.3


def test_signals_of_a_pair_share_an_arrow_that_names_them():
    html = html_of(
        ["arm", "hand"],
        [connection("arm.p_WG", "hand.p_WG", size=3), connection("arm.grip", "hand.grip", unit="1"),
         connection("hand.f_G", "arm.f", unit="N", size=3)],
    )  # fmt: skip
    assert html.count('"symbol":"arrow"') == 2
    assert "p_WG (m, x 3)" in html
    assert "f_G \\u2192 f (N, x 3)" in html or "f_G → f (N, x 3)" in html
    assert "<td>arm.grip</td><td>hand.grip</td><td></td><td>1</td>" in html


def test_each_unit_has_its_icon_and_one_of_another_package_that_of_any_block():
    units = [unit("arm", model="TendonArm"), unit("pose", model="PoseController"), unit("own", model="../block")]
    section = graph_section({"system": {"units": units, "connections": []}})
    assert section is not None
    figure = json.loads(re.findall(r'<script type="application/json">(.*?)</script>', str(section.html))[0])
    shown = [base64.b64decode(image["source"].removeprefix("data:image/svg+xml;base64,")) for image in
             figure["layout"]["images"]]  # fmt: skip
    assert shown == [catalog_icon(name).read_bytes() for name in ("TendonArm", "PoseController", "block")]
    nodes = figure["data"][-1]
    assert [(i["x"], i["y"]) for i in figure["layout"]["images"]] == list(zip(nodes["x"], nodes["y"], strict=True))


ENDS = [("mass", "spring"), ("mass", "other"), ("spring", "mass")]


def test_a_units_node_and_box_have_one_colour_wherever_it_lies():
    html = html_of(["spring", "other", "mass"], [connection(f"{a}.y", f"{b}.u") for a, b in ENDS])
    figure = json.loads(re.findall(r'<script type="application/json">(.*?)</script>', html)[0])
    nodes = figure["data"][-1]
    colours = dict(zip(zip(nodes["x"], nodes["y"], strict=True), nodes["marker"]["line"]["color"], strict=True))
    assert colours == {(box["x"], box["y"]): box["bordercolor"] for box in figure["layout"]["annotations"]}


def pictures(units: list[dict[str, Any]]) -> list[str]:
    section = graph_section({"system": {"units": units, "connections": []}})
    assert section is not None
    figure = json.loads(re.findall(r'<script type="application/json">(.*?)</script>', str(section.html))[0])
    return [image["source"] for image in figure["layout"]["images"]]


@pytest.mark.parametrize(("fmi", "member"), [(2, "model.png"), (3, "terminalsAndIcons/icon.svg")])
def test_a_unit_of_ones_own_has_the_icon_in_its_fmu(fmi: int, member: str, tmp_path: Path):
    mass = FmuArchive(native_fmu("mass", fmi))
    catalogs = catalog_icon("Thrusters")
    own = catalogs.with_suffix(".png") if member.endswith(".png") else catalogs
    files = {name: mass.read(name) for name in mass.names if not name.endswith("/")}
    mine = write_archive(tmp_path / "mine.fmu", {**files, member: own.read_bytes()})
    system = System()
    for name, fmu in (("mine", mine), ("none", mass.path), ("push", cached("Push", fmi))):
        system.add(name, fmu)
    kept = describe_system(system, adaptive=False)["units"]
    assert [u["name"] for u in kept if "icon" in u] == ["mine"]
    shown = pictures(json.loads(json.dumps(kept)))
    of_catalog = [picture_source(catalog_icon(name).read_bytes(), "image/svg+xml") for name in ("block", "Push")]
    assert shown == [picture_source(own.read_bytes(), f"image/{'png' if fmi == 2 else 'svg+xml'}"), *of_catalog]


@pytest.mark.parametrize(
    ("svg", "png", "kept"),
    [
        (200_000, 5000, "svg"),
        (200_001, 5000, "png"),
        (200_001, 200_000, "png"),
        (200_001, 200_001, ""),
        (0, 200_001, ""),
    ],
)
def test_of_an_icon_that_is_too_large_the_png_is_kept(svg: int, png: int, kept: str, tmp_path: Path):
    mass = FmuArchive(native_fmu("mass", 3))
    drawing = catalog_icon("Thrusters")
    files = {name: mass.read(name) for name in mass.names if not name.endswith("/")}
    files["terminalsAndIcons/icon.png"] = drawing.with_suffix(".png").read_bytes().ljust(png)
    if svg:
        files["terminalsAndIcons/icon.svg"] = drawing.read_bytes().ljust(svg)
    system = System()
    system.add("mass", write_archive(tmp_path / "mass.fmu", files))
    (described,) = describe_system(system, adaptive=False)["units"]
    types = {"svg": "image/svg+xml", "png": "image/png"}
    assert described.get("icon", {}).get("type") == types.get(kept)
    if kept:
        assert base64.b64decode(described["icon"]["base64"]) == files[f"terminalsAndIcons/icon.{kept}"]


@pytest.mark.parametrize(
    "described",
    [
        pytest.param({"name": "a", "icon": {"type": "text/html", "base64": ""}}, id="an icon of HTML"),
        pytest.param({"name": "a", "icon": {"type": "image/png", "base64": "https://a.b"}}, id="an icon elsewhere"),
        pytest.param({"name": "a", "icon": {"type": "image/png", "base64": "abc"}}, id="half an icon"),
        pytest.param(1, id="a number for a unit"),
    ],
)
def test_a_damaged_system_is_reported_as_the_runs_fault(described: Any, tmp_path: Path, wording: Wording):
    run = run_of(tmp_path, [{**unit("a"), **described} if isinstance(described, dict) else described])
    with pytest.raises(InvalidRunFolder) as refused:
        write_run_page(run)
    wording.check(refused.value)
    assert not (tmp_path / "report.html").exists()


def test_a_conversion_stands_in_the_table():
    change = {"source": "a.x", "unit": "mm", "target": "b.x", "target_unit": "m", "factor": 0.001, "offset": 0.0}
    html = html_of(["a", "b"], [connection("a.x", "b.x", unit="mm")], conversions=[change])
    assert "<th>converted</th>" in html
    assert "times 0.001" in html
    assert "<th>converted</th>" not in html_of(["a", "b"], [connection("a.x", "b.x")])


def test_names_with_dots_find_their_units():
    html = html_of(["plant.arm", "plant"], [connection("plant.arm.y.x", "plant.u")])
    assert "plant.arm to plant: y.x" in html


def test_markup_in_names_is_text():
    assert "<script>x" not in html_of(["<script>x", "b"], [connection("<script>x.y", "b.u")])


def test_of_a_large_system_there_is_a_table_that_ends():
    names = [f"u{i}" for i in range(41)]
    html = html_of(names, [connection(f"u{k % 41}.y", f"u{k // 41}.x{k}") for k in range(1005)])
    assert 'class="plot"' not in html
    assert "41 units is too large for a drawing" in html
    assert html.count("<tr><td>u0.y</td>") == 25
    assert "5 more are in" in html


def test_without_a_system_there_is_no_section():
    assert graph_section({}) is None
    assert graph_section({"system": {"units": [], "connections": []}}) is None


@pytest.mark.parametrize(
    ("period", "sampled", "text"),
    [(0.02, False, "20 ms"), (1 / 30, True, "33.3 ms, sampled"), (2.0, False, "2 s"), (None, False, "steps vary")],
)
def test_rates_are_reported_as_one_reads_them(period: float | None, sampled: bool, text: str):
    assert rate(unit("u", period=period, sampled=sampled)) == text


def run_of(folder: Path, units: Sequence[object]) -> RunFolder:
    """Write the folder of a run of these units."""
    run = {"scenario": "x", "parameters": {}, "system": {"units": units, "connections": list[object]()}}
    (folder / "run.json").write_text(json.dumps(run))
    (folder / "summary.json").write_text(json.dumps({"success": True, "reason": "", "metrics": {}}))
    return RunFolder.of_run(folder)
