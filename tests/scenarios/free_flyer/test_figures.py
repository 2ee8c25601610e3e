"""What the free-flyer's scene shows: a robot that drifts away."""

from pathlib import Path

import numpy as np
from matplotlib import image

from handover.scenarios.free_flyer.scene import Solid, draw_scene


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
