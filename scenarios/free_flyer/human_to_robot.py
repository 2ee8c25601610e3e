"""A person puts an object into the robot's gripper, which closes when it is pushed. [Fernandes2020] sec. 4.3.2."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.free_flyer.flyer_handover import FlyerHandover
from handover.scenarios.free_flyer.handover_parameters import Parameters
from handover.scenarios.free_flyer.published import published_of_receiving


class HumanToRobot(FlyerHandover):
    """The person gives, the robot takes."""

    name: ClassVar[str] = "flyer_human_to_robot"
    title: ClassVar[str] = "a person gives an object to a free-flyer"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "give", "object_with": "hand"}
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)

    def published(self, parameters: Parameters) -> Sequence[PublishedValue]:
        """Return the threshold of sec. 4.1.2."""
        return published_of_receiving(parameters)
