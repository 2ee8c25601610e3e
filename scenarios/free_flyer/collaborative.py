"""The robot gives an object, waits, and takes it back: it holds things for a person. [Fernandes2020] sec. 5.5, T3."""

from collections.abc import Mapping
from typing import Any, ClassVar

from handover.scenarios.free_flyer.flyer_handover import FlyerHandover


class Collaborative(FlyerHandover):
    """The person takes at the robot's first signal and gives at its second."""

    name: ClassVar[str] = "flyer_collaborative"
    title: ClassVar[str] = "a free-flyer gives an object to a person, waits, and takes it back"
    task: ClassVar[str] = "collaborative"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "motion_again": "give", "object_with": "free"}
    receivers: ClassVar[tuple[str, ...]] = ("HAND", "GRIPPER")
