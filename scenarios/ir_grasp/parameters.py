"""Parameters of the infrared grasp, and the situation that a seed draws from them; see `paper.toml` for the defaults.

A `Situation` is where object and hand are before the grasp: what vision saw, and how the object was moved since.
"""

import math
from dataclasses import dataclass

import numpy as np

from handover.controllers.ir_grasp.parameters import Strategy
from handover.cosim.blocks.ports import Floats, Vector2, parameter
from handover.cosim.blocks.units import Metre, MetrePerSecond, Radian, Second
from handover.plants.ir_grasp.hand import PALM
from handover.plants.ir_grasp.objects import SOLIDS, Thing, outlines


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
    carried_speed: MetrePerSecond = parameter(
        0.0, "speed at which the ground under the object carries it", minimum=0.0, maximum=0.2
    )
    carried_direction: Radian = parameter(
        math.pi / 2.0, "where to, counter-clockwise from the approach", minimum=-math.pi, maximum=math.pi
    )
    carried_from: Second = parameter(0.0, "when it begins to carry", minimum=0.0, maximum=90.0)
    carried_until: Second = parameter(12.0, "when it stops", minimum=0.0, maximum=90.0)
    nudge: Vector2[Metre] = parameter(
        np.zeros(2), "how far somebody bumps the object meanwhile, in W", minimum=-0.1, maximum=0.1
    )
    nudge_time: Second = parameter(4.0, "when the bump begins", minimum=0.0, maximum=90.0)
    vision_position: Metre = parameter(
        0.003, "standard deviation of the pre-grasp position, by axis", minimum=0.0, maximum=0.05
    )
    vision_yaw: Radian = parameter(0.03, "standard deviation of the pre-grasp heading", minimum=0.0, maximum=0.5)
    run_up: Metre = parameter(
        0.12, "distance of the wrist from the pre-grasp pose at the start", minimum=0.0, maximum=0.5
    )

    @property
    def carry_velocity(self) -> Floats:
        """Velocity of the ground under the object, in W, in m/s."""
        return self.carried_speed * np.array([math.cos(self.carried_direction), math.sin(self.carried_direction)])


_PALM_FRONT = max(x for x, _ in PALM)


@dataclass(frozen=True)
class Situation:
    """Drawn by a seed, in W: the object's shift and turn from its reference pose, the pre-grasp pose, the hand's start.

    Vision saw the object at the origin of W in its reference pose, hence a hand that comes along x.
    """

    p_WO: Floats
    turn: float
    p_WH_pregrasp: Floats
    yaw: float
    p_WH_start: Floats

    @classmethod
    def draw(cls, p: Parameters, seed: int) -> "Situation":
        """Draw a situation: the same for any strategy, and other parameters only scale the random numbers."""
        rng = np.random.default_rng(seed)
        distance, direction, turn = rng.random(3)
        error = rng.standard_normal(3)
        shift = p.shift_least + (p.shift_most - p.shift_least) * distance
        angle = p.shift_spread * (2.0 * direction - 1.0)
        yaw = p.vision_yaw * float(error[2])
        pregrasp = pregrasp_position(p.thing, p.standoff) + p.vision_position * error[:2]
        return cls(
            p_WO=shift * np.array([math.cos(angle), math.sin(angle)]) if p.perturbed else np.zeros(2),
            turn=p.turn_most * (2.0 * float(turn) - 1.0) if p.perturbed else 0.0,
            p_WH_pregrasp=pregrasp,
            yaw=yaw,
            p_WH_start=pregrasp - p.run_up * np.array([math.cos(yaw), math.sin(yaw)]),
        )


def pregrasp_position(thing: Thing, standoff: float) -> Floats:
    """Return the wrist's position before the middle of the object's width, its palm a standoff from the object."""
    yaw = SOLIDS[thing].yaw
    R_WO = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    points: Floats = np.vstack([outline @ np.transpose(R_WO) for outline in outlines(thing)])
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([low[0] - standoff - _PALM_FRONT, (low[1] + high[1]) / 2.0])
