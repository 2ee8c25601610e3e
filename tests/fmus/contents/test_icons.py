"""Every unit of the catalog has an icon of its own, and its FMUs have it where the standards look for it."""

import importlib
import itertools
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import pytest
from support.fmus.rendered_icons import ICONS, difference, drawings, pixels, rendered
from support.fmus.written_blocks import write_block
from support.wording import Wording

from handover.cosim.fmu.file.archive import TERMINALS
from handover.fmus.build import build_block, cached
from handover.fmus.catalog import UNITS
from handover.fmus.contents.icons import InvalidIcon, catalog_icon

OwnBlock = Callable[[str], str]

_etree: Any = importlib.import_module("lxml.etree")


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_drawings_are_small_square_one_of_each_unit_and_one_of_any_block():
    assert {file.stem for file in drawings()} == {*UNITS, "block"}
    assert [name for name in UNITS if catalog_icon(name).stem != name] == []
    assert catalog_icon("of somebody else").samefile(ICONS / "block.svg")
    for file in drawings():
        root = _etree.fromstring(file.read_bytes())
        assert file.stat().st_size < 3000
        assert (root.get("viewBox"), root.get("stroke-width")) == ("0 0 96 96", "3")
        names = {_etree.QName(element).localname for element in root.iter()}
        assert names <= {"svg", "g", "path", "circle", "ellipse", "rect"}
        assert len({element.get("stroke") for element in root.iter("{*}g")}) in (2, 3)
        assert not any("href" in key or "url(" in text for e in root.iter() for key, text in e.attrib.items())


def test_pictures_are_their_drawings_which_differ():
    """Else: `make icons`."""
    shown = {file.stem: rendered(file) for file in drawings()}
    pngs = {file.stem: pixels(file.with_suffix(".png").read_bytes()) for file in drawings()}
    assert [name for name in shown if difference(shown[name], pngs[name]) >= 0.5] == []
    alike = [(a, b) for a, b in itertools.combinations(shown, 2) if difference(shown[a], shown[b]) < 5.0]
    assert alike == []


def test_units_have_their_icon_as_both_standards_name_it():
    svg, in_fmi3 = catalog_icon("Push"), members(cached("Push", 3))
    assert in_fmi3["terminalsAndIcons/icon.svg"] == svg.read_bytes()
    assert in_fmi3["terminalsAndIcons/icon.png"] == svg.with_suffix(".png").read_bytes()
    assert members(cached("Push", 2))["model.png"] == in_fmi3["terminalsAndIcons/icon.png"]


def test_the_place_of_an_icon_keeps_to_the_standards_schema():
    schema = _etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"))
    root = _etree.fromstring(members(cached("Push", 3))[TERMINALS])
    assert schema.validate(root), schema.error_log
    icon, canvas = root.find("GraphicalRepresentation/Icon"), root.find("GraphicalRepresentation/CoordinateSystem")
    assert {k: icon.get(k) for k in ("x1", "y1", "x2", "y2")} == {k: canvas.get(k) for k in ("x1", "y1", "x2", "y2")}


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> OwnBlock:
    """Return what writes a block with a line in its class, and returns its path."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(line: str) -> str:
        name = f"with_icon_{sum(map(ord, request.node.name))}"
        block = write_block(tmp_path, name, "1.0", f"{name}_helper")
        file = tmp_path / f"{name}.py"
        file.write_text(file.read_text().replace('    "Answers."\n', f'    "Answers."\n\n    {line}\n'))
        return block

    return write


def test_a_block_of_ones_own_has_the_icon_of_any_block(own: OwnBlock, tmp_path: Path):
    packed = members(build_block(own(""), 3, tmp_path))
    assert packed["terminalsAndIcons/icon.svg"] == (ICONS / "block.svg").read_bytes()
    assert members(build_block(own(""), 2, tmp_path))["model.png"] == (ICONS / "block.png").read_bytes()


def test_or_the_one_that_it_names(own: OwnBlock, tmp_path: Path):
    block = own('icon = "small.png"')
    for suffix in (".png", ".svg"):
        shutil.copy(catalog_icon("Push").with_suffix(suffix), tmp_path / f"small{suffix}")
        packed = members(build_block(block, 3, tmp_path))
        assert packed["terminalsAndIcons/icon.png"] == (tmp_path / "small.png").read_bytes()
        assert ("terminalsAndIcons/icon.svg" in packed) is (suffix == ".svg")


@pytest.mark.parametrize("named", [7, "none.png", "../elsewhere.png", "text.png", "cut.png", "bad.png", "page.png"])
def test_what_names_no_picture_is_refused_before_anything_is_written(
    own: OwnBlock, tmp_path: Path, named: object, wording: Wording
):
    (tmp_path / "text.png").write_text("a picture")
    (tmp_path / "cut.png").write_bytes(catalog_icon("Push").with_suffix(".png").read_bytes()[:60])
    for name, drawing in (("bad", "<svg"), ("page", "<html/>")):
        shutil.copy(catalog_icon("Push").with_suffix(".png"), tmp_path / f"{name}.png")
        (tmp_path / f"{name}.svg").write_text(drawing)
    with pytest.raises(InvalidIcon) as caught:
        build_block(own(f"icon = {named!r}"), 3, tmp_path / "out")
    wording.check(caught.value)
    assert not (tmp_path / "out").exists()
