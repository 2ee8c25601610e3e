"""What the free-flyer's figures show: names of short phases, and a robot that drifts away."""

from pathlib import Path

import numpy as np
from matplotlib import image

from handover.scenarios.experiment.plotting import figure, leave_room, shade_phases
from handover.scenarios.free_flyer.scene import Solid, draw_scene

NAMES = {0: "FLY", 1: "CLOSE_GRIPPER", 2: "CHECK_ANGLE", 3: "RETREAT"}


def test_short_phases_are_named_upright_beside_each_other(tmp_path: Path):
    t = np.linspace(0.0, 60.0, 601)
    phase = np.searchsorted([30.0, 30.5, 31.0], t).astype(np.int64)
    with figure(tmp_path / "phases", 1) as (axes,):
        shade_phases(axes, t, phase, NAMES)
        texts = {text.get_text(): text for text in axes.texts}
        assert set(texts) == {"fly", "close gripper", "check angle", "retreat"}
        upright = [texts["close gripper"], texts["check angle"]]
        assert [text.get_rotation() for text in texts.values() if text not in upright] == [0.0, 0.0]
        axes.figure.canvas.draw()
        first, second = (text.get_window_extent() for text in upright)
        assert first.x1 <= second.x0
        axes.set_ylim(0.0, 1.0)
        leave_room(axes)
        assert axes.get_ylim()[1] > 1.0


def test_many_short_phases_stay_within_the_axes(tmp_path: Path):
    t = np.linspace(0.0, 10.0, 1001)
    phase = (np.arange(len(t)) // 5).astype(np.int64)
    with figure(tmp_path / "phases", 1) as (axes,):
        shade_phases(axes, t, phase, {k: f"PHASE_{k}" for k in range(201)})
        places = [text.get_position()[0] for text in axes.texts]
        assert 10 < len(places) < 201
        assert 0.0 <= min(places) <= max(places) <= 10.0


def test_a_robot_that_drifts_away_stays_large_in_the_scene(tmp_path: Path):
    for name in ("apart", "together"):
        (tmp_path / name).mkdir()
    cube = np.array([[x, y, z] for x in (0.0, 0.3) for y in (0.0, 0.3) for z in (0.0, 0.3)])
    near, far = [Solid(cube, "#c9d3df")], [Solid(cube + 80.0, "#c9d3df")]
    draw_scene({"start": near, "end": far}, "", tmp_path / "apart")
    draw_scene({"start": near, "end": near}, "", tmp_path / "together")
    apart, together = (image.imread(tmp_path / name / "scene.png") for name in ("apart", "together"))
    assert apart.shape == together.shape
    assert np.mean(apart[..., :3] < 0.9) > 0.9 * np.mean(together[..., :3] < 0.9)
