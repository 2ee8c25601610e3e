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
from handover.cosim.system.graph import places, rate
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.runs.reporting.graph import graph_section
from handover.scenarios.runs.reporting.html import picture_source
from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.summary import describe_system

SVG = "image/svg+xml"


def unit(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "model": name.title(), "fmi": "3", "period": 0.02, "sampled": False, **more}


def connection(source: str, target: str, **more: Any) -> dict[str, Any]:
    return {"source": source, "target": target, "unit": "m", "size": 1, "kind": "real", **more}


def html_of(units: Sequence[str | dict[str, Any]], connections: Sequence[dict[str, Any]] = (), **more: Any) -> str:
    described = [unit(u) if isinstance(u, str) else u for u in units]
    section = graph_section({"system": {"units": described, "connections": connections}, **more})
    assert section is not None
    return str(section.html)


def icons_in(html: str) -> list[str]:
    return re.findall(r'<image href="(.*?)"', html)


def mass_with(file: Path, fmi: int, more: dict[str, bytes]) -> Path:
    """Write an FMU that has more members than the mass."""
    mass = FmuArchive(native_fmu("mass", fmi))
    files = {name: mass.read(name) for name in mass.names if not name.endswith("/")}
    return write_archive(file, {**files, **more})


@pytest.mark.parametrize("n", [1, 2, 8, 9])
def test_places_are_the_same_each_time_apart_and_within_the_square(n: int):
    names = [f"u{i}" for i in range(n)]
    pairs = list(itertools.pairwise(names))
    at = np.array(list(places(names, pairs).values()))
    assert np.array_equal(at, np.array(list(places(names, pairs).values())))
    assert np.abs(at).max() <= 1.0 + 1e-9
    assert n == 1 or min(np.linalg.norm(at[i] - at[j]) for i in range(n) for j in range(i)) > 0.05


def test_signals_of_a_pair_share_an_arrow_that_names_them():
    html = html_of(
        ["arm", "hand"],
        [connection("arm.p_WG", "hand.p_WG", size=3), connection("arm.grip", "hand.grip", unit="1"),
         connection("hand.f_G", "arm.f", unit="N", size=3)],
    )  # fmt: skip
    assert html.count('<path d="M-7') == 2
    assert ("2 units<" in html, "3 connections<" in html) == (True, True)
    assert ("1 unit<" in html_of(["arm"], []), "0 connections<" in html_of(["arm"], [])) == (True, True)
    assert "<title>arm → hand\np_WG (m, x 3)\ngrip</title>" in html
    assert "f_G → f (N, x 3)" in html
    assert "<td>arm.grip</td><td>hand.grip</td><td></td><td>1</td>" in html


def test_each_unit_has_its_icon_and_one_colour_for_its_box_and_what_leaves_it():
    units = [unit("arm", model="TendonArm"), unit("pose", model="PoseController"), unit("own", model="../block")]
    html = html_of(units, [connection("arm.y", "pose.u"), connection("pose.y", "arm.u")])
    icons = ("TendonArm", "PoseController", "block")
    assert icons_in(html) == [picture_source(catalog_icon(n).read_bytes(), SVG) for n in icons]
    of_boxes = re.findall(r'<rect [^>]*stroke="(.*?)"', html)
    assert len(set(of_boxes)) == 3
    assert re.findall(r'<path d="M-7[^>]*fill="(.*?)"', html) == of_boxes[:2]


@pytest.mark.parametrize("n", [2, 5, 12, 40])
def test_no_arrows_head_and_no_box_is_covered_by_a_box(n: int):
    names = [f"u{k}" for k in range(n)]
    html = html_of(names, [connection(f"{a}.y", f"{b}.u") for a, b in itertools.pairwise([*names, "u0"])])
    rectangles = re.findall(r'<rect x="(.*?)" y="(.*?)" width="(.*?)" height="(.*?)"', html)
    corner, size = np.array(rectangles, float).T.reshape(2, 2, n)
    heads = np.array(re.findall(r"translate\((.*?) (.*?)\)", html), float).T
    (shown,) = np.array(re.findall(r'viewBox="0 0 (.*?) (.*?)"', html), float)
    assert (shown >= (corner + size).max(axis=1)).all()
    assert (corner >= 0.0).all()
    for k in range(n):
        far = np.abs(heads - (corner + size / 2)[:, [k]]) >= size[:, [k]] / 2
        assert far.any(axis=0).all()
        apart = np.abs(corner + size / 2 - (corner + size / 2)[:, [k]]) >= (size + size[:, [k]]) / 2
        assert apart.any(axis=0).sum() == n - 1


@pytest.mark.parametrize(("fmi", "member"), [(2, "model.png"), (3, "terminalsAndIcons/icon.svg")])
def test_a_unit_of_ones_own_has_the_icon_in_its_fmu(fmi: int, member: str, tmp_path: Path):
    drawing = catalog_icon("Thrusters")
    own = (drawing.with_suffix(".png") if member.endswith(".png") else drawing).read_bytes()
    mine = mass_with(tmp_path / "mine.fmu", fmi, {member: own})
    system = System()
    for name, fmu in (("mine", mine), ("none", native_fmu("mass", fmi)), ("push", cached("Push", fmi))):
        system.add(name, fmu)
    kept = describe_system(system, adaptive=False)["units"]
    assert [u["name"] for u in kept if "icon" in u] == ["mine"]
    of_catalog = [picture_source(catalog_icon(name).read_bytes(), SVG) for name in ("block", "Push")]
    assert icons_in(html_of(json.loads(json.dumps(kept)))) == [
        picture_source(own, "image/png" if fmi == 2 else SVG),
        *of_catalog,
    ]


@pytest.mark.parametrize(
    ("svg", "png", "kept"),
    [(200_000, 5000, "svg"), (200_001, 200_000, "png"), (200_001, 200_001, ""), (0, 200_001, "")],
)
def test_of_an_icon_that_is_too_large_the_png_is_kept(svg: int, png: int, kept: str, tmp_path: Path):
    drawing = catalog_icon("Thrusters")
    files = {"terminalsAndIcons/icon.png": drawing.with_suffix(".png").read_bytes().ljust(png)}
    if svg:
        files["terminalsAndIcons/icon.svg"] = drawing.read_bytes().ljust(svg)
    system = System()
    system.add("mass", mass_with(tmp_path / "mass.fmu", 3, files))
    (described,) = describe_system(system, adaptive=False)["units"]
    assert described.get("icon", {}).get("type") == {"svg": SVG, "png": "image/png"}.get(kept)
    if kept:
        assert base64.b64decode(described["icon"]["base64"]) == files[f"terminalsAndIcons/icon.{kept}"]


@pytest.mark.parametrize(
    "described",
    [
        pytest.param({**unit("a"), "icon": {"type": "text/html", "base64": ""}}, id="an icon of HTML"),
        pytest.param({**unit("a"), "icon": {"type": "image/png", "base64": "https://a.b"}}, id="an icon elsewhere"),
        pytest.param({**unit("a"), "icon": {"type": "image/png", "base64": "abc"}}, id="half an icon"),
        pytest.param(1, id="a number for a unit"),
    ],
)
def test_a_damaged_system_is_reported_as_the_runs_fault(described: Any, tmp_path: Path, wording: Wording):
    run = {"scenario": "x", "parameters": {}, "system": {"units": [described], "connections": list[object]()}}
    (tmp_path / "run.json").write_text(json.dumps(run))
    (tmp_path / "summary.json").write_text(json.dumps({"success": True, "reason": "", "metrics": {}}))
    with pytest.raises(InvalidRunFolder) as refused:
        write_run_page(RunFolder.of_run(tmp_path))
    wording.check(refused.value)
    assert not (tmp_path / "report.html").exists()


def test_a_conversion_stands_in_the_table():
    change = {"source": "a.x", "unit": "mm", "target": "b.x", "target_unit": "m", "factor": 0.001, "offset": 0.0}
    html = html_of(["a", "b"], [connection("a.x", "b.x", unit="mm")], conversions=[change])
    assert "<th>converted</th>" in html
    assert "times 0.001" in html
    assert "<th>converted</th>" not in html_of(["a", "b"], [connection("a.x", "b.x")])


def test_names_with_dots_find_their_units_and_markup_in_names_is_text():
    assert "plant.arm to plant: y.x" in html_of(["plant.arm", "plant"], [connection("plant.arm.y.x", "plant.u")])
    assert "<script>x" not in html_of(["<script>x", "b"], [connection("<script>x.y", "b.u")])


def test_of_a_large_system_there_is_a_table_that_ends():
    names = [f"u{i}" for i in range(41)]
    html = html_of(names, [connection(f"u{k % 41}.y", f"u{k // 41}.x{k}") for k in range(1005)])
    assert "<svg" not in html
    assert "41 units is too large for a drawing" in html
    assert html.count("<tr><td>u0.y</td>") == 25
    assert "5 more are in" in html


def test_without_a_system_there_is_no_section():
    assert graph_section({}) is None
    assert graph_section({"system": {"units": [], "connections": []}}) is None


def test_rates_are_reported_as_one_reads_them():
    given = (0.02, False), (1 / 30, True), (2.0, False), (None, False)
    assert [rate(period, sampled=sampled) for period, sampled in given] == [
        "20 ms",
        "33.3 ms, sampled",
        "2 s",
        "steps vary",
    ]
