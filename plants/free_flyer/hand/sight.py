"""What a person sees of object and robot, late and askew as through the interface of [Fernandes2020] sec. 4.2.2."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handover.cosim.blocks.plain_rotation import ZERO, Quaternion, Vector, add_scaled, dot, scale, subtract, vector
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.parameters import Params

_ROUNDING = 1e-9
"""Seconds by which a sum of steps may miss a time that they fill: step sizes of hosts differ in their last digits."""


@dataclass(slots=True)
class Perception:
    """The gripper and its light, the object, and the hand with its hold of it; f_H is the force that the hand feels."""

    light: bool
    angle: float
    G: Frame
    O: Frame
    gripped: bool
    held: bool
    p_WH: Vector
    q_WH: Quaternion
    p_OH: Vector
    q_OH: Quaternion
    f_H: Vector


_Seen = tuple[float, bool, float, Vector, Quaternion, Vector, Quaternion, bool, bool]
"""When, and what of a Perception is seen and not felt."""


class Sight:
    """Gives what was there `interface_delay` ago; the own hand is felt at once.

    Errors are constant in an attempt: where the person takes object and palm to be is off by depth_error times a
    standard normal number along the line of sight, and by sight_error times one along each of two axes across it. When
    the person takes the gripper to have closed or opened is early by the magnitude of timing_error times one.

    Attributes:
        error: of where things are believed to be, m, in the world.
        lead: how early the gripper is believed to have moved, s.
        strength: the effort of this attempt, relative to the mean.
    """

    def __init__(self, params: Params) -> None:
        self._p = params
        self._rng = np.random.default_rng([params.seed, 2])
        sight = np.asarray(params.line_of_sight) / np.linalg.norm(params.line_of_sight)
        self._line = vector(sight)
        self._clock = 0.0
        self._past: list[_Seen] = []
        self.error: Vector = ZERO
        self.lead, self.strength = 0.0, 1.0

    def begin_attempt(self) -> None:
        """Draw the errors of another attempt."""
        p = self._p
        x, y, z, early, strength = (float(n) for n in self._rng.standard_normal(5))
        depth = dot((x, y, z), self._line)
        aside = subtract((x, y, z), scale(depth, self._line))
        self.error = add_scaled(scale(p.sight_error, aside), p.depth_error * depth, self._line)
        self.lead = p.timing_error * abs(early)
        self.strength = max(0.1, 1.0 + p.effort_spread * strength)

    def look(self, dt: float, there: Perception) -> Perception:
        """Return what is seen at the beginning of a step dt of what is there then."""
        if self._p.interface_delay == 0.0:
            return there
        poses = (there.G.p, there.G.q, there.O.p, there.O.q)
        self._past.append((self._clock, there.light, there.angle, *poses, there.gripped, there.held))
        due = self._clock - self._p.interface_delay + _ROUNDING
        self._clock += dt
        while len(self._past) > 1 and self._past[1][0] <= due:
            del self._past[0]
        _, light, angle, p_WG, q_WG, p_WO, q_WO, gripped, held = self._past[0]
        poses = {"G": Frame(p_WG, q_WG), "O": Frame(p_WO, q_WO)}
        return replace(there, **poses, light=light, angle=angle, gripped=gripped, held=held)

    def get_state(self) -> tuple[object, ...]:
        """Return what was there and is not yet seen, and the attempt's errors."""
        return self._rng.bit_generator.state, self._clock, self._past, self.error, self.lead, self.strength

    def set_state(self, state: Sequence[Any]) -> None:
        """Restore a state that `get_state` gave."""
        self._rng.bit_generator.state, self._clock, past, self.error, self.lead, self.strength = state
        self._past = list(past)
