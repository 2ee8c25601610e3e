"""The robot fetches an object, brings it to a person and lets go when the person pulls. [Fernandes2020] sec. 4.3.1."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.free_flyer.flyer_handover import FlyerHandover
from handover.scenarios.free_flyer.handover_parameters import Parameters
from handover.scenarios.free_flyer.published import published_of_giving


class RobotToHuman(FlyerHandover):
    """The robot gives, the person takes."""

    name: ClassVar[str] = "flyer_robot_to_human"
    title: ClassVar[str] = "a free-flyer fetches an object and gives it to a person"
    task: ClassVar[str] = "robot_to_human"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "object_with": "free"}
    receivers: ClassVar[tuple[str, ...]] = ("HAND",)

    def published(self, parameters: Parameters) -> Sequence[PublishedValue]:
        """Return what sec. 4.1.2 and 4.3 tell."""
        return published_of_giving(parameters)
