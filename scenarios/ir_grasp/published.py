"""What the paper tells of a grasp with given parameters. [Luberto] table II."""

from collections.abc import Sequence

from handover.controllers.ir_grasp.parameters import Strategy
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.ir_grasp.parameters import Parameters

FINGERS = ("thumb", "index", "ring")
"""As table II is kept in `paper.toml`."""


def published_of(p: Parameters) -> Sequence[PublishedValue]:
    """Return table II's distances of the object in such a pose; nothing for other strategies than the reflex."""
    if p.strategy is not Strategy.REFLEX or p.literal:
        return ()
    pose = "perturbed" if p.perturbed else "nominal"
    thing = p.thing.name.lower().removesuffix("_a").removesuffix("_b")
    return [
        PublishedValue(
            metric=f"final_distance_{finger}",
            paper="ir_grasp",
            name=f"final_distance_{pose}_{thing}",
            index=(k,),
            note="of several grasps together; how they were summed up is not told",
        )
        for k, finger in enumerate(FINGERS)
    ]
