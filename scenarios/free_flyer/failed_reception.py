"""A push without the object: the robot finds its gripper empty and asks again. [Fernandes2020] sec. 3.2.2, 4.3.2."""

from collections.abc import Mapping
from typing import Any, ClassVar

from handover.scenarios.free_flyer.flyer_handover import FlyerHandover


class FailedReception(FlyerHandover):
    """The person pushes the gripper first and gives only at the robot's second signal."""

    name: ClassVar[str] = "flyer_failed_reception"
    title: ClassVar[str] = "a free-flyer closes its gripper on nothing, notices, and asks again"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "push", "motion_again": "give", "object_with": "hand"}
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)
    failures: ClassVar[int] = 1
