"""The diagram of an exported system: boxes apart, lines from edge to edge, all of it in the system's area."""

import itertools
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu
from support.cosim.ssp_schemas import expect_valid

from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.icon import Icon, read_icon
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.ssp.xml import NAMESPACES
from handover.cosim.system.graph import places
from handover.cosim.system.system import System

Box = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Lower left and upper right corner."""


class Drawn:
    """What a tool that reads the geometry of an SSP draws."""

    def __init__(self, ssp: Path) -> None:
        with zipfile.ZipFile(ssp) as archive:
            self.files = {name: archive.read(name) for name in archive.namelist()}
        system = ET.fromstring(self.files["SystemStructure.ssd"]).find("ssd:System", NAMESPACES)
        assert system is not None
        self.area = box(system, "ssd:SystemGeometry")
        self.components = {c.attrib["name"]: c for c in system.iterfind("ssd:Elements/ssd:Component", NAMESPACES)}
        self.boxes = {name: box(c, "ssd:ElementGeometry") for name, c in self.components.items()}
        self.own = list(system.iterfind("ssd:Connectors/ssd:Connector", NAMESPACES))
        self.connections = list(system.iterfind("ssd:Connections/ssd:Connection", NAMESPACES))

    def connectors(self, unit: str) -> dict[str, NDArray[np.float64]]:
        """Return the places of a unit's connectors in its box, (0, 0) to (1, 1)."""
        listed = self.components[unit].iterfind("ssd:Connectors/ssd:Connector", NAMESPACES)
        return {c.attrib["name"]: spot(c) for c in listed}

    def line(self, connection: ET.Element) -> NDArray[np.float64]:
        """Return the points of a line with both ends, shape (n, 2)."""
        found = connection.find("ssd:ConnectionGeometry", NAMESPACES)
        assert found is not None
        xs, ys = ([float(x) for x in found.attrib[axis].split()] for axis in ("pointsX", "pointsY"))
        start, end = (
            self.end(connection.attrib[f"{e}Element"], connection.attrib[f"{e}Connector"]) for e in ("start", "end")
        )
        return np.array([start, *(np.array([x, y]) for x, y in zip(xs, ys, strict=True)), end])

    def end(self, unit: str, connector: str) -> NDArray[np.float64]:
        low, high = self.boxes[unit]
        return low + self.connectors(unit)[connector] * (high - low)


def box(parent: ET.Element, name: str) -> Box:
    found = parent.find(name, NAMESPACES)
    assert found is not None
    x_1, y_1, x_2, y_2 = (float(found.attrib[key]) for key in ("x1", "y1", "x2", "y2"))
    return np.array([x_1, y_1]), np.array([x_2, y_2])


def spot(connector: ET.Element) -> NDArray[np.float64]:
    found = connector.find("ssd:ConnectorGeometry", NAMESPACES)
    assert found is not None
    return np.array([float(found.attrib["x"]), float(found.attrib["y"])])


def ring(fmu: FmuOf, n: int) -> System:
    """Return n masses and springs in turn, each of which is moved by the one before it."""
    s = System()
    units = [s.add(f"unit_{k}", fmu("Spring" if k % 2 else "Mass", 2)) for k in range(n)]
    for a, b in itertools.pairwise(units):
        s.connect(a.y.f, b.u.f) if "f" in a.description.outputs else s.connect(a.y.x, b.u.x)
    return s


def outside(point: NDArray[np.float64], around: Box) -> bool:
    return bool(np.any(point < around[0]) or np.any(point > around[1]))


@pytest.mark.parametrize("n", [1, 2, 9])
def test_boxes_are_apart_at_the_places_of_the_graph_and_lines_lead_from_edge_to_edge(
    fmu: FmuOf, tmp_path: Path, n: int
):
    s = ring(fmu, n)
    file = write_ssp(s, tmp_path / "a.ssp", "a")
    expect_valid(file, "1.0")
    drawn = Drawn(file)
    for low, high in drawn.boxes.values():
        assert np.all(low > drawn.area[0])
        assert np.all(high < drawn.area[1])
    for (a_low, a_high), (b_low, b_high) in itertools.combinations(drawn.boxes.values(), 2):
        assert np.any(a_low - b_high > 30.0) or np.any(b_low - a_high > 30.0)
    layout = places(list(s.units), [(c.source.unit, c.target.unit) for c in s.connections])
    middles = np.array([(low + high) / 2 for low, high in drawn.boxes.values()])
    factor = np.abs(middles).max() / max(np.abs(np.array(list(layout.values()))).max(), 1e-9)
    np.testing.assert_allclose(middles, factor * np.array(list(layout.values())), atol=0.02)
    assert len(drawn.connections) == n - 1
    for connection in drawn.connections:
        line = drawn.line(connection)
        ends = [connection.attrib["startElement"], connection.attrib["endElement"]]
        assert all(not outside(point, drawn.area) for point in line)
        assert all(outside(point, drawn.boxes[unit]) for point in line[1:-1] for unit in ends)


def test_connectors_are_on_edges_towards_their_partners_and_inputs_from_outside_at_the_left(fmu: FmuOf, tmp_path: Path):
    s = ring(fmu, 2)
    s.external(s.units["unit_0"].u.f)
    drawn = Drawn(write_ssp(s, tmp_path / "a.ssp", "a"))
    mass, spring = drawn.connectors("unit_0"), drawn.connectors("unit_1")
    assert {name: at[0] for name, at in mass.items()} == {"f": 0.0, "x": 1.0, "v": 1.0}
    assert {name: at[0] for name, at in spring.items()} == {"x": 0.0, "f": 1.0}
    assert len({tuple(at) for at in mass.values()}) == 3
    assert [tuple(spot(c)) for c in drawn.own] == [(0.0, 0.5)]


def test_units_have_the_icons_of_their_fmus_which_come_along(fmu: FmuOf, tmp_path: Path):
    s = System()
    for name in ("one", "other"):
        s.add(name, fmu("Mass", 2))
    s.add("three", fmu("Spring", 3))
    s.add("foreign", native_fmu("mass", 2))
    drawn = Drawn(write_ssp(s, tmp_path / "a.ssp", "a"))
    named = {n: c.find("ssd:ElementGeometry", NAMESPACES).get("iconSource") for n, c in drawn.components.items()}  # type: ignore
    assert named["one"] == named["other"] != named["three"]
    assert named["foreign"] is None
    assert drawn.files[str(named["one"])] == read_icon(FmuArchive(fmu("Mass", 2))).png
    assert drawn.files[str(named["three"])] == read_icon(FmuArchive(fmu("Spring", 3))).png
    assert read_icon(FmuArchive(native_fmu("mass", 2))) == Icon()
    assert [name for name in drawn.files if name.endswith(".png")] == sorted({str(named["one"]), str(named["three"])})


def test_without_networkx_many_units_lie_on_a_circle(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "networkx", None)
    at = np.array(list(places([f"u{k}" for k in range(12)], []).values()))
    assert np.linalg.norm(at, axis=1) == pytest.approx(np.ones(12))
    assert len({tuple(p.round(6)) for p in at}) == 12
