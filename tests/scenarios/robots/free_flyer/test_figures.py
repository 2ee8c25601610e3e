"""What the free-flyer's scene shows, by its axes: a robot that drifts away, and what is in front of what."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.cosim.blocks.ports import Floats
from handover.scenarios.robots.free_flyer.scene import Solid, draw_scene

CUBE: Floats = np.array([[x, y, z] for x in (0.0, 0.3) for y in (0.0, 0.3) for z in (0.0, 0.3)])
GREY, BLUE = "#c9d3df", "#2f6db5"
NEAR = [Solid(CUBE, GREY)]
BEFORE, BEHIND = Solid(CUBE - [0.0, 0.5, 0.0], BLUE), Solid(CUBE, GREY)


def faces(axes: Axes) -> tuple[list[Floats], Floats]:
    """Return the drawn polygons, the farthest first, and their colours."""
    (drawn,) = (c for c in axes.collections if isinstance(c, PolyCollection))
    return [np.asarray(path.vertices) for path in drawn.get_paths()], np.asarray(drawn.get_facecolor())


def span(limits: Sequence[float]) -> float:
    return limits[1] - limits[0]


def test_a_robot_that_drifts_away_stays_large_in_the_scene_which_names_its_moments(tmp_path: Path, sketches: Sketches):
    draw_scene({"0.0 s, start": NEAR, "9.0 s, end": [Solid(CUBE + 80.0, GREY)]}, "", tmp_path)
    drawn = sketches["scene"].axes
    for axes, at in zip(drawn, (0.0, 80.0, 0.0, 80.0), strict=True):
        (face,), _ = faces(axes)
        assert face.min() == at
        assert axes.get_xlim()[0] < at < at + 0.3 < axes.get_xlim()[1]
        assert axes.get_ylim()[0] < at < at + 0.3 < axes.get_ylim()[1]
        assert 0.7 * span(axes.get_xlim()) < 0.3
    side = ["0.0 s, start\nfrom the side", "9.0 s, end\nfrom the side"]
    assert [axes.get_title() for axes in drawn] == [*side, "from above", "from above"]


def test_from_the_side_what_is_nearer_hides_what_is_behind_it(tmp_path: Path, sketches: Sketches):
    draw_scene({"start": [BEFORE, BEHIND]}, "", tmp_path)
    from_side, from_above = sketches["scene"].axes
    polygons, colours = faces(from_side)
    np.testing.assert_array_equal(polygons[0], polygons[1])
    assert colours[0][0] > colours[1][0]  # the blue one, of less red, is drawn over the grey one
    apart, _ = faces(from_above)
    assert abs(apart[0].mean(axis=0) - apart[1].mean(axis=0))[1] == pytest.approx(0.5)
