"""Recorded tracks of a hand: written and read, followed, and refused with file, line and reason."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.plants.hand_scene import DT, IDLE, Scene
from support.wording import Wording

from handover.cosim.blocks.plain_rotation import IDENTITY, from_rotation_vector
from handover.plants.free_flyer.hand.hand_and_object import Driver, HandAndObject, InvalidHandParameters, Params
from handover.plants.free_flyer.hand.hand_kinematics import JOINTS
from handover.plants.free_flyer.hand.hand_track import COLUMNS, HandPose, InvalidTrack, read_track, write_track

AWAY = np.array([1.0, 0.0, 0.0])


def poses(n: int = 60) -> list[tuple[float, HandPose]]:
    """Return a track that moves in all channels, a row every 50 ms."""
    rows: list[tuple[float, HandPose]] = []
    for k in range(n):
        s = math.sin(0.1 * k)
        q = from_rotation_vector((0.3 * s, -0.2 * s, 0.1 * s))
        angles = tuple(0.5 * (1.0 + s) * 0.1 * (i + 1) for i in range(JOINTS))
        rows.append((0.05 * k, HandPose((-0.4 + 0.1 * s, 0.1 - 0.05 * s, -0.05 + 0.07 * s), q, angles, k > 30)))
    return rows


def spoiled(path: Path, **changes: tuple[int, object]) -> Path:
    """Write a track in which entries, by their column, have another value at a line."""
    write_track(path, poses())
    lines = [line.split(",") for line in path.read_text().splitlines()]
    for column, (line, value) in changes.items():
        lines[line - 1][COLUMNS.index(column)] = str(value)
    path.write_text("\n".join(",".join(line) for line in lines) + "\n")
    return path


def test_a_track_is_read_as_it_was_written(tmp_path: Path):
    write_track(tmp_path / "t.csv", poses())
    track = read_track(tmp_path / "t.csv", 0.2)
    for t, pose in poses():
        got = track.at(t)
        assert (got.p, got.angles, got.closed) == (pose.p, pose.angles, pose.closed)
        np.testing.assert_allclose(got.q, pose.q, atol=1e-15)
    middle = track.at(0.075)
    np.testing.assert_allclose(middle.p, 0.5 * (np.array(poses()[1][1].p) + poses()[2][1].p), atol=1e-15)
    assert track.at(poses()[31][0] - 1e-12).closed  # a time that rounding made earlier than its row's
    assert not track.at(poses()[31][0] - 1e-6).closed
    assert track.at(-1.0) == track.at(0.0)
    assert track.at(99.0) == track.at(0.05 * 59)


def test_columns_may_stand_in_any_order_after_excels_byte_order_mark(tmp_path: Path):
    write_track(tmp_path / "t.csv", poses())
    rows = [line.split(",") for line in (tmp_path / "t.csv").read_text().splitlines()]
    (tmp_path / "u.csv").write_text("\ufeff" + "\n".join(",".join(reversed(row)) for row in rows), encoding="utf-8")
    assert read_track(tmp_path / "u.csv", 0.2).at(1.234) == read_track(tmp_path / "t.csv", 0.2).at(1.234)


@pytest.mark.parametrize(
    "change",
    [
        {"p_y": (7, "nan")},
        {"joint_3": (9, "x")},
        {"t": (5, 0.05)},
        {"t": (61, 3.5)},
        {"t": (2, -0.1)},
        {"joint_14": (4, 1.7), "joint_1": (4, -0.1)},
        {"q_w": (3, 1.2)},
        {"closed": (8, 0.5)},
    ],
    ids=lambda change: " ".join(change),
)
def test_what_cannot_be_followed_is_refused_with_file_line_and_reason(
    tmp_path: Path, change: dict[str, tuple[int, object]], wording: Wording
):
    path = spoiled(tmp_path / "t.csv", **change)
    with pytest.raises(InvalidTrack) as refused:
        HandAndObject(replace(IDLE, driven_by=Driver.TRACK, track=str(path)))
    wording.check(refused.value)


def test_all_faults_are_reported_at_once_and_the_first_lines_of_each(tmp_path: Path, wording: Wording):
    rows = [(t, pose._replace(angles=(2.0,) * JOINTS, q=(2.0, 0.0, 0.0, 0.0))) for t, pose in poses(10)]
    write_track(tmp_path / "t.csv", rows)
    with pytest.raises(InvalidTrack) as refused:
        read_track(tmp_path / "t.csv", 0.01)
    assert len(refused.value.faults) == 3
    wording.check(refused.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "t;p_x\n0;1\n",
        ",".join((*COLUMNS, "t")) + "\n",
        "t,p_x\n0,1\n",
        ",".join(COLUMNS) + "\n",
        ",".join(COLUMNS) + "\n0,1,2\n",
        None,
    ],
    ids=["empty", "semicolons", "twice", "lacking", "no rows", "short row", "no file"],
)
def test_a_file_that_is_no_track_is_refused(tmp_path: Path, text: str | None, wording: Wording):
    if text is not None:
        (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InvalidTrack) as refused:
        read_track(tmp_path / "t.csv", 0.2)
    wording.check(refused.value)


def test_a_driver_without_a_track_and_a_track_without_a_driver_are_refused(wording: Wording):
    for params in (Params(driven_by=Driver.TRACK), Params(track="t.csv")):
        with pytest.raises(InvalidHandParameters) as refused:
            HandAndObject(params)
        wording.check(refused.value)


def test_hand_follows_a_track_without_delay_as_its_rows_are_known_beforehand(tmp_path: Path):
    write_track(tmp_path / "t.csv", poses(200))
    scene = Scene(replace(IDLE, driven_by=Driver.TRACK, track=str(tmp_path / "t.csv")), AWAY)
    scene.go(5.0)
    wanted, followed = (np.array([getattr(y, n) for y in scene.seen[60:]]) for n in ("p_WH_goal", "p_WH"))
    errors = [np.sum((wanted[5 : len(wanted) - 5] - followed[5 + n : len(wanted) - 5 + n]) ** 2) for n in range(-4, 5)]
    assert int(np.argmin(errors)) == 4
    assert np.max(np.abs(wanted - followed)) < 0.001
    np.testing.assert_allclose(
        [y.finger for y in scene.seen[60:]], [y.finger_goal for y in scene.seen[60:]], atol=1e-12
    )


def test_a_hand_whose_track_begins_elsewhere_gets_there_at_an_arms_speed(tmp_path: Path):
    write_track(tmp_path / "t.csv", [(0.0, HandPose((0.5, 0.9, 0.4), IDENTITY, (0.0,) * JOINTS, False))])
    scene = Scene(replace(IDLE, driven_by=Driver.TRACK, track=str(tmp_path / "t.csv")), AWAY)
    y = scene.go(3.0)
    np.testing.assert_allclose(y.p_WH, [0.5, 0.9, 0.4], atol=1e-6)
    speeds = np.linalg.norm(np.diff([s.p_WH for s in scene.seen], axis=0), axis=1) / DT
    assert np.max(speeds) <= 2.0 + 1e-9
