"""Parameters of the infrared grasp; origins of the defaults are in `paper.toml`."""

import math
from dataclasses import dataclass

from handover.controllers.ir_grasp.parameters import Strategy
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Metre, Radian
from handover.plants.ir_grasp.objects import Thing


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One grasp. The run's seed draws the perturbation and what vision is off by, the same for any strategy."""

    thing: Thing = parameter(Thing.CYLINDER, "what is grasped, in which reference pose")
    perturbed: bool = parameter(True, "the object was moved after vision saw it")
    strategy: Strategy = parameter(
        Strategy.REFLEX, "correct the pre-grasp pose by the sensors, close there at once, or go forward and close"
    )
    forward: Metre = parameter(0.035, "how far forward, for that strategy", minimum=0.0, maximum=0.3)
    literal: bool = parameter(False, "the correction's equations as printed: [Luberto] eqs. (4) and (9)")
    standoff: Metre = parameter(
        0.07, "gap between palm and object at the pre-grasp pose that vision asks for", minimum=0.0, maximum=0.3
    )
    shift_least: Metre = parameter(0.03, "how far a perturbed object was moved at least", minimum=0.0, maximum=0.1)
    shift_most: Metre = parameter(0.05, "how far it was moved at most", minimum=0.0, maximum=0.1)
    shift_spread: Radian = parameter(
        math.pi / 2.0,
        "largest angle between its shift and the hand's approach; pi / 2: never towards the hand",
        minimum=0.0,
        maximum=math.pi,
    )
    turn_most: Radian = parameter(
        0.35, "how far a perturbed object was turned at most, either way", minimum=0.0, maximum=math.pi
    )
    vision_position: Metre = parameter(
        0.003, "standard deviation of the pre-grasp position, by axis", minimum=0.0, maximum=0.05
    )
    vision_yaw: Radian = parameter(0.03, "standard deviation of the pre-grasp heading", minimum=0.0, maximum=0.5)
    run_up: Metre = parameter(
        0.12, "distance of the wrist from the pre-grasp pose at the start", minimum=0.0, maximum=0.5
    )
