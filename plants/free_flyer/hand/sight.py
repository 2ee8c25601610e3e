"""What a person sees of object and robot, late and askew as through the interface of [Fernandes2020] sec. 4.2.2."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from handover.cosim.blocks.plain_rotation import ZERO, Quaternion, Vector, add_scaled, dot, scale, subtract, vector
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.parameters import ContactParams

CLOSING = 0.1
"""Radians by which the gripper's angle must change for a person to see it (assumed)."""
ROUNDING = 1e-9
"""Seconds by which a sum of steps may miss a time that they fill: step sizes of hosts differ in their last digits."""


@dataclass(slots=True)
class Perception:
    """The gripper and its light, the object, and the hand with its hold of it.

    What is felt: whether the hand holds the object, its own pose and that of the object in it, and the force f_H.
    """

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


_Seen = tuple[float, bool, float, Vector, Quaternion, Vector, Quaternion, bool]
"""When, and what of a Perception is seen and not felt."""
_Timed = TypeVar("_Timed", bound=tuple[Any, ...])


def forget_before(past: list[_Timed], due: float) -> None:
    """Leave of past instants, which begin with their times, s, the one that held at the time `due`, and later ones."""
    while len(past) > 1 and past[1][0] <= due + ROUNDING:
        del past[0]


class Sight:
    """Gives what was there `interface_delay` ago; the own hand, and what it holds, are felt at once.

    Errors are constant in an attempt: where the person takes object and palm to be is off by depth_error times a
    standard normal number along the line of sight, and by sight_error times one along each of two axes across it. When
    the person takes the gripper to have closed or opened is early by the magnitude of timing_error times one. The
    effort is 1 plus effort_spread times one, at least 0.1. A share `haste` of the attempts is hasty.

    Attributes:
        error: of where things are believed to be, m, in the world.
        lead: how early the gripper is believed to have moved, s.
        strength: the effort of this attempt, relative to the mean.
        hasty: whether the person does not wait for the gripper in this attempt.
    """

    def __init__(self, params: ContactParams) -> None:
        self._p = params
        self._rng = np.random.default_rng([params.seed, 2])
        sight = np.asarray(params.line_of_sight) / np.linalg.norm(params.line_of_sight)
        self._line = vector(sight)
        self._clock = 0.0
        self._past: list[_Seen] = []
        self.error: Vector = ZERO
        self.lead, self.strength, self.hasty = 0.0, 1.0, False

    def begin_attempt(self) -> None:
        """Draw the errors of another attempt."""
        p = self._p
        x, y, z, early, strength = (float(n) for n in self._rng.standard_normal(5))
        depth = dot((x, y, z), self._line)
        aside = subtract((x, y, z), scale(depth, self._line))
        self.error = add_scaled(scale(p.sight_error, aside), p.depth_error * depth, self._line)
        self.lead = p.timing_error * abs(early)
        self.strength = max(0.1, 1.0 + p.effort_spread * strength)
        self.hasty = p.haste > 0.0 and float(self._rng.random()) < p.haste

    def look(self, dt: float, there: Perception) -> Perception:
        """Return what is seen at the beginning of a step dt of what is there then."""
        if self._p.interface_delay == 0.0:
            return there
        poses = (there.G.p, there.G.q, there.O.p, there.O.q)
        self._past.append((self._clock, there.light, there.angle, *poses, there.gripped))
        forget_before(self._past, self._clock - self._p.interface_delay)
        self._clock += dt
        _, light, angle, p_WG, q_WG, p_WO, q_WO, gripped = self._past[0]
        return Perception(
            light=light,
            angle=angle,
            G=Frame(p_WG, q_WG),
            O=Frame(p_WO, q_WO),
            gripped=gripped,
            held=there.held,
            p_WH=there.p_WH,
            q_WH=there.q_WH,
            p_OH=there.p_OH,
            q_OH=there.q_OH,
            f_H=there.f_H,
        )

    def takes_for_gripped(self, seen: Perception) -> bool:
        """Return whether the gripper seems to hold the object: by its angle, as early as the error of timing has it."""
        p = self._p
        left = seen.angle - p.angle_object
        closes = seen.angle < p.angle_open - CLOSING and left >= -0.5 * CLOSING
        return seen.gripped or (closes and (self.hasty or left < p.gripper_rate * self.lead))

    def takes_for_free(self, seen: Perception) -> bool:
        """Return whether the gripper seems to have let go of the object, likewise; a hasty person does not wait."""
        p = self._p
        opens = seen.angle > p.angle_object + 0.5 * CLOSING
        left = p.angle_object + p.release_angle - seen.angle
        return self.hasty or not seen.gripped or (opens and left < p.gripper_rate * self.lead)

    def get_state(self) -> tuple[object, ...]:
        """Return what was there and is not yet seen, and the attempt's errors."""
        attempt = (self.error, self.lead, self.strength, self.hasty)
        return self._rng.bit_generator.state, self._clock, self._past, attempt

    def set_state(self, state: Sequence[Any]) -> None:
        """Restore a state that `get_state` gave."""
        self._rng.bit_generator.state, self._clock, past, attempt = state
        self._past = list(past)
        self.error, self.lead, self.strength, self.hasty = attempt
