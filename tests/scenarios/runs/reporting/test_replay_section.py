"""A replay's data: rigid bodies once, poses by moment, what stays once, and nothing of a wrong length."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.replay import Body, Line, Replay, prism
from handover.scenarios.runs.reporting.replay_section import frame_rows, replay_section, scene_content

ROWS = 1000
MOVING: Floats = np.column_stack([np.linspace(0.0, 2.0, ROWS), np.zeros(ROWS), np.zeros(ROWS)])
SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
CUBE = Body(label="<cube>", colour="#123456", mesh=prism(SQUARE, -0.1, 0.1), p_WB=MOVING)


@pytest.fixture
def record(tmp_path: Path) -> Record:
    pq.write_table(pa.Table.from_pydict({"time": np.linspace(0.0, 10.0, ROWS)}), tmp_path / "s")
    return Record(tmp_path / "s")


def data(replay: Replay, record: Record) -> dict[str, Any]:
    """Return what the page's script gets."""
    found = re.search(r'<script type="application/json">(.*?)</script>', replay_section(replay, record).html)
    assert found is not None
    return json.loads(found[1])


def numbers(packed: dict[str, Any]) -> NDArray[np.float64]:
    """Return an array of the page as its script unpacks it."""
    values = np.frombuffer(base64.b64decode(packed["bdata"]), np.dtype(packed["dtype"])).astype(np.float64)
    if "step" not in packed:
        return values
    return np.where(values == 65535, np.nan, packed["low"] + packed["step"] * values)


@pytest.mark.parametrize("shift", [0.0, 1.0, 1e3])
def test_a_place_is_kept_to_far_less_than_a_pixel_of_the_scene(record: Record, shift: float):
    rng = np.random.default_rng(1)
    p_WB = shift * np.linspace(0.0, 1.0, ROWS)[:, None] + rng.uniform(-1.0, 1.0, size=(ROWS, 3))
    p_WB[[0, -1], 1] = np.nan
    body, window = replace(CUBE, p_WB=p_WB), np.array([[-1.0] * 3, [1.0] * 3])
    (trace,) = data(Replay(bodies=[body], window=window), record)["traces"]
    packed = trace["parts"][0]["p"]
    assert packed["dtype"] == ("f4" if shift > 100.0 else "u2")
    kept = numbers(packed).reshape(-1, 3)
    np.testing.assert_allclose(kept, p_WB[frame_rows(record.time)], rtol=1e-7, atol=2.0 / 20_000)


def test_a_body_is_held_once_and_its_place_at_some_moments(record: Record):
    (trace,) = data(Replay(bodies=[CUBE]), record)["traces"]
    assert len(numbers(trace["parts"][0]["vertices"])) == CUBE.mesh.vertices.size
    p = numbers(trace["parts"][0]["p"]).reshape(-1, 3)
    assert len(p) < 300 < ROWS
    np.testing.assert_allclose([p[0], p[-1]], MOVING[[0, -1]])
    (trace,) = data(Replay(bodies=[replace(CUBE, p_WB=np.ones((ROWS, 3)))]), record)["traces"]
    assert len(numbers(trace["parts"][0]["p"])) == 3, "what stays is held once"


def test_orientations_follow_each_other_the_short_way(record: Record):
    q_WB = np.tile([1.0, 0.0, 0.0, 0.0], (ROWS, 1))
    q_WB[:, 3] = np.linspace(0.0, 0.5, ROWS)
    q_WB[ROWS // 2 :] *= -1.0
    (trace,) = data(Replay(bodies=[replace(CUBE, q_WB=q_WB)]), record)["traces"]
    q = numbers(trace["parts"][0]["q"]).reshape(-1, 4)
    assert np.all(np.einsum("ij,ij->i", q[1:], q[:-1]) > 0.0)


def test_the_axes_hold_everything_at_all_times(record: Record):
    tube = Line(label="tube", colour="#ffffff", points=MOVING[:, None] + [[0, 0, 0], [0, 3, 0]], radii=np.full(2, 0.5))
    value = data(Replay(bodies=[CUBE], lines=[tube]), record)
    assert np.all(np.array(value["low"]) <= [-0.5, -0.5, -0.5])
    assert np.all(np.array(value["high"]) >= [2.5, 3.5, 0.5])
    assert np.all(np.array(value["high"]) - value["low"] < [3.4, 4.4, 1.4])


def test_a_body_with_more_or_fewer_rows_than_the_record_is_refused(record: Record):
    with pytest.raises(ValueError, match="'<cube>' has 999 rows, the record 1000"):
        replay_section(Replay(bodies=[replace(CUBE, p_WB=MOVING[1:])]), record)


def test_a_legends_chip_has_all_colours_of_what_it_names_and_names_are_text(record: Record):
    tube = Line(label="<cube>", colour="#abcdef", points=MOVING[:, None] + [[0, 0, 0], [0, 3, 0]], radii=np.ones(2))
    alone = replace(CUBE, label="alone", colour="#fedcba")
    glass = replace(CUBE, label="glass", opacity=0.5)
    html = replay_section(Replay(bodies=[CUBE, CUBE, alone, glass], lines=[tube], notes=["a < b"]), record).html
    chips = re.findall(r'<i style="background: (.*?)">', html)
    assert chips == ["linear-gradient(90deg, #123456 0% 50%, #abcdef 50% 100%)", "#fedcba", "#12345680"]
    assert "<cube>" not in html
    assert "&lt;cube&gt;" in html
    assert "a &lt; b" in html


def test_views_hold_what_is_drawn_or_the_window_and_no_more(record: Record):
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    drawn = data(Replay(bodies=[CUBE]), record)
    ends = np.vstack([MOVING[0] + corners, MOVING[-1] + corners])
    assert {tuple(p) for p in drawn["held"]} <= {tuple(p) for p in np.round(ends, 4).tolist()}
    np.testing.assert_allclose(np.min(drawn["held"], axis=0), ends.min(axis=0), atol=1e-4)
    np.testing.assert_allclose(np.max(drawn["held"], axis=0), ends.max(axis=0), atol=1e-4)
    points = data(Replay(bodies=[CUBE], window=np.vstack([corners, np.zeros((1, 3))])), record)
    np.testing.assert_allclose(sorted(points["held"]), sorted(corners.tolist()), atol=1e-4)
    box = data(Replay(bodies=[CUBE], window=corners[[0, -1]]), record)
    assert box["held"] is None
    assert (box["low"], box["high"]) == ([-0.1] * 3, [0.1] * 3)


@pytest.mark.parametrize("window", [None, np.array([[-0.1, -0.1, -0.1], [2.1, 0.1, 0.1]])])
def test_a_scene_under_way_has_room_around_it(record: Record, window: Floats | None):
    near, far = (scene_content(Replay(bodies=[CUBE], window=window), record, room=room) for room in (0.0, 0.25))
    seen = [np.array(c["held"] or [c["low"], c["high"]]) for c in (near, far)]
    np.testing.assert_allclose(seen[0].min(axis=0) - seen[1].min(axis=0), 0.25 * 2.2, atol=1e-3)
    np.testing.assert_allclose(seen[1].max(axis=0) - seen[0].max(axis=0), 0.25 * 2.2, atol=1e-3)
