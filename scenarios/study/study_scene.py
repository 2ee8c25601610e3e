"""The scene of a round, as the person sees it, with what helps to see how far away things are."""

from typing import Any

import numpy as np

from handover.scenarios.experiment.replay import Line
from handover.scenarios.live.stage import Stage

TARGET, PLUMB = "place to go", "depth"
"""Labels of what the page moves: the place of the device's test, and lines from hand and object down to the floor."""
_GHOST, _HAND, _OBJECT = "#009e73", "#8a5a2b", "#d1602b"
"""Of the palette of Okabe and Ito where it is free: told apart by colour-blind eyes."""
_RADIUS, _WIDTH = 0.025, 2.0


def study_scene(stage: Stage) -> dict[str, Any] | None:
    """Return the scene as `sceneIn` takes it, None where the scenario has none; what the page moves is hidden at first.

    Its last traces are a ball at `TARGET`, then two `PLUMB` lines, of the hand and of the object.
    """
    hidden = np.full((1, 2, 3), np.nan)
    ball = Line(label=TARGET, colour=_GHOST, points=hidden, radii=np.full(2, _RADIUS), opacity=0.5)
    plumbs = [Line(label=PLUMB, colour=colour, points=hidden, width=_WIDTH) for colour in (_HAND, _OBJECT)]
    return stage.scene_of_person([ball, *plumbs])
