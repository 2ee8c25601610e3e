"""What the hand measures: infrared readings of the fingers in turn, encoders, and the tendon's tension."""

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, Final, NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.hand import FINGERS, JOINTS, PALM
from handover.plants.ir_grasp.parameters import OUT_OF_RANGE, Params
from handover.plants.ir_grasp.shapes import Disc, Point, Rectangle, capsule_hit
from handover.plants.ir_grasp.world import GraspWorld

_SLOT: Final = 5  # internal steps, 5 ms, for which a sensor is active (assumed)
_SENSORS: Final = len(FINGERS)
_MIDDLE = ((1.0, 0.0),)
_PALM = Rectangle(low=PALM[0], high=PALM[2])
_PHALANGES = [
    (owner, length, radius)
    for owner, f in enumerate(FINGERS)
    for length, radius in zip(f.lengths, f.radii, strict=True)
]


def _may_hide(finger: int) -> list[tuple[int, float, float, float]]:
    """Return number, length, radius and largest radius of each phalanx that a finger's beam may meet, all in m.

    These are those of the other side and its own but the distal one. Index and ring, which are beside each other in
    space, do not hide each other.
    """
    found = [
        (i, length, radius, length / 2.0 + radius)
        for i, (owner, length, radius) in enumerate(_PHALANGES)
        if owner == finger or FINGERS[owner].flexion != FINGERS[finger].flexion
    ]
    distal = max(i for i, (owner, _, _) in enumerate(_PHALANGES) if owner == finger)
    return [phalanx for phalanx in found if phalanx[0] != distal]


_BEFORE: Final = [_may_hide(finger) for finger in range(_SENSORS)]

Capsule = tuple[Point, Point, float]
"""Middles of its ends and radius, in m."""

Pose = tuple[float, float, float]
"""Position in m, and orientation in rad."""

Reflection = tuple[float, float, float]
"""What returns light to a sensor: distance in m, cosine of the angle of incidence, reflectivity."""

PalmInView = tuple[float, float, float, float]
"""Position of a sensor's window from the wrist, in the palm's axes, in m; cosine and sine of the palm's orientation."""

Kept = tuple[int, list[float], tuple[list[float], list[float]], tuple[Any, Any, Any]]
"""Time into the scan, readings, errors of wrist and closure and of joints and tension, and states of random numbers."""


class Sensing:
    """Sensors and encoders of the hand.

    Sensors are active in turn for 5 ms each, thumb, index, ring, `active` of them at once; each is read at the end of
    its time. A reading is the mean over three rays of the beam of `InfraredSensor.ticks`, and `crosstalk` of what
    each other active sensor reads of its own light, plus ambient light and noise, rounded. Errors of
    encoders and tension are drawn anew every 5 ms.

    Args:
        params: of the scene.
        world: at the start, when all have been read.
    """

    def __init__(self, params: Params, world: GraspWorld) -> None:
        self._params = p = params
        self._sensors = p.finger_sensors()
        self._solid = p.solid
        angles = (0.0, -p.beam, p.beam)
        self._rays = [(math.cos(a), math.sin(a)) for a in angles]
        self._widening = math.tan(p.beam)
        self._disc = Disc(radius=p.other_radius)
        self._noise = math.hypot(p.noise, p.ambient_noise)
        self._rng = np.random.default_rng(p.seed)
        self._encoder_rng = np.random.default_rng([p.seed, 0xE2C0DE2])
        self._encoder_noise: Floats = np.array([p.wrist_noise, p.wrist_noise, p.heading_noise, p.closure_noise])
        self._joint_rng = np.random.default_rng([p.seed, 0x70147])
        self._joint_noise: Floats = np.array([p.joint_noise] * JOINTS + [p.tension_noise])
        self._clock = 0  # internal steps into the scan of the sensors
        self.ticks = [0.0] * _SENSORS
        for slot in range(_SENSORS):
            self._read(slot, world)
        self._draw_errors()

    @property
    def until_reading(self) -> int:
        """Internal steps until the next reading."""
        return _SLOT - self._clock % _SLOT

    def advance(self, steps: int, world: GraspWorld) -> None:
        """Let steps pass, not beyond the next reading, after which the world is as given."""
        self._clock = (self._clock + steps) % (_SLOT * _SENSORS)
        if self._clock % _SLOT == 0:
            self._read((self._clock // _SLOT - 1) % _SENSORS, world)
            self._draw_errors()

    def measured(self, world: GraspWorld) -> tuple[float, float, float, float]:
        """Return what the encoders say of the wrist's position (m) and orientation (rad), and of the closure."""
        (x, y, yaw), (e_x, e_y, e_yaw, e_sigma) = world.wrist, self._errors
        return x + e_x, y + e_y, yaw + e_yaw, world.sigma + e_sigma

    def measured_joints(self, q: Sequence[float], tension: float) -> tuple[list[float], float]:
        """Return what encoders say of joint angles, 8, in rad, and the motor's current of the tension, in N."""
        *of_joints, of_tension = self._joint_errors
        return [angle + e for angle, e in zip(q, of_joints, strict=True)], tension + of_tension

    def ranges(self, world: GraspWorld) -> list[float]:
        """Return how far the object is along the middle of each beam, whatever hides it, in m."""
        hits = [world.cast_rays(finger, _MIDDLE, OUT_OF_RANGE)[0] for finger in range(_SENSORS)]
        return [OUT_OF_RANGE if hit is None else max(hit[0], 0.0) for hit in hits]  # contacts overlap a little

    def get_state(self) -> Kept:
        """Return the time into the scan, readings, errors and the random numbers' states."""
        generators = (self._rng.bit_generator, self._encoder_rng.bit_generator, self._joint_rng.bit_generator)
        return self._clock, self.ticks, (self._errors, self._joint_errors), generators

    def set_state(self, state: Kept) -> None:
        """Restore a state that `get_state` gave, once packed and unpacked."""
        self._clock, self.ticks, (self._errors, self._joint_errors), states = state
        for rng, kept in zip((self._rng, self._encoder_rng, self._joint_rng), states, strict=True):
            rng.bit_generator.state = kept

    def _read(self, slot: int, world: GraspWorld) -> None:
        p = self._params
        active = [(slot * p.active + k) % _SENSORS for k in range(p.active)]
        phalanges = world.phalanges() if p.fingers_seen else []
        own = [self._own_light(finger, world, phalanges) for finger in active]
        for k, finger in enumerate(active):
            others = sum(own[:k]) + sum(own[k + 1 :])
            x = own[k] + p.crosstalk * others + p.ambient
            x += self._noise * float(self._rng.standard_normal())
            self.ticks[finger] = self._sensors[finger].reading(x)

    def _own_light(self, finger: int, world: GraspWorld, phalanges: Sequence[Pose]) -> float:
        """Return the ticks that a sensor's own light makes, before rounding."""
        p, solid, sensor = self._params, self._solid, self._sensors[finger]
        met = world.cast_rays(finger, self._rays, p.farthest)
        nearer: Sequence[Reflection | None] = ()
        if p.other_radius > 0.0 or p.fingers_seen:
            nearer = self._before_object(finger, world, phalanges, [p.farthest if h is None else h[0] for h in met])
        total = 0.0
        for hit, hidden_by in zip_longest(met, nearer):
            if hidden_by is not None:
                total += sensor.ticks(*hidden_by)
            elif hit is not None:
                total += sensor.ticks(
                    hit[0], hit[1], solid.reflectivity * solid.faces[hit[2]], p.gloss, p.gloss_exponent
                )
        return total / len(self._rays)

    def _before_object(
        self, finger: int, world: GraspWorld, phalanges: Sequence[Pose], reaches: Sequence[float]
    ) -> Sequence[Reflection | None]:
        """Return what of second object and hand each ray of a sensor meets before its reach; nothing if none can."""
        p = self._params
        window, looks = world.sensor(finger)
        beam = Beam(window, looks, self._widening, p.farthest)
        at = world.other
        other = None if at is None or not beam.may_meet(at, p.other_radius) else (window[0] - at[0], window[1] - at[1])
        before = _hand_before(finger, phalanges, beam) if phalanges else []
        palm = _palm_before(world, window, p.farthest) if phalanges else None
        if other is None and palm is None and not before:
            return ()
        directions = [(c * looks[0] - s * looks[1], s * looks[0] + c * looks[1]) for c, s in self._rays]
        return [
            self._hidden_by(before, palm, other, window, ray, reach)
            for ray, reach in zip(directions, reaches, strict=True)
        ]

    def _hidden_by(
        self,
        before: Sequence[Capsule],
        palm: PalmInView | None,
        other: Point | None,
        window: Point,
        ray: Point,
        reach: float,
    ) -> Reflection | None:
        """Return what a ray meets before `reach` of second object and hand."""
        p = self._params
        met: list[Reflection] = []
        if other is not None:
            hit = self._disc.intersect(*other, *ray)
            if hit is not None:
                met.append((hit.distance, hit.cosine, p.other_reflectivity))
        for a, b, radius in before:
            on_finger = capsule_hit(a, b, radius, window, ray)
            if on_finger is not None:
                met.append((*on_finger, p.finger_reflectivity))
        if palm is not None:
            x, y, cos, sin = palm
            d_x, d_y = cos * ray[0] + sin * ray[1], cos * ray[1] - sin * ray[0]
            leads_away = x * d_x + y * d_y > _PALM.reach
            on_palm = None if leads_away else _PALM.intersect(x, y, d_x, d_y)
            if on_palm is not None:
                met.append((on_palm.distance, on_palm.cosine, p.finger_reflectivity))
        nearest = min(met, default=None)
        return None if nearest is None or nearest[0] >= reach else nearest

    def _draw_errors(self) -> None:
        """Draw new errors of encoders and tension."""
        self._errors = _errors(self._encoder_noise, self._encoder_rng)
        self._joint_errors = _errors(self._joint_noise, self._joint_rng)


def _errors(noise: Floats, rng: np.random.Generator) -> list[float]:
    """Return new errors of these standard deviations; without noise no random numbers are drawn."""
    return (noise * rng.standard_normal(noise.size)).tolist() if noise.any() else [0.0] * noise.size


class Beam(NamedTuple):
    """A sensor's beam: window in m, unit vector in which it looks, tangent of half its angle, and reach in m."""

    window: Point
    looks: Point
    widening: float
    reach: float

    def may_meet(self, middle: Point, size: float) -> bool:
        """Return whether a ray of it may meet what is within `size` of a point, in m."""
        v_x, v_y = middle[0] - self.window[0], middle[1] - self.window[1]
        ahead, aside = v_x * self.looks[0] + v_y * self.looks[1], abs(v_x * self.looks[1] - v_y * self.looks[0])
        return -size < ahead < self.reach + size and aside < 1.5 * size + self.widening * (ahead + size)


def _hand_before(finger: int, phalanges: Sequence[Pose], beam: Beam) -> list[Capsule]:
    """Return the phalanges that a finger's beam may meet."""
    found: list[Capsule] = []
    for i, length, radius, size in _BEFORE[finger]:
        x, y, angle = phalanges[i]
        if beam.may_meet((x, y), size):
            e_x, e_y = length / 2.0 * math.cos(angle), length / 2.0 * math.sin(angle)
            found.append(((x - e_x, y - e_y), (x + e_x, y + e_y), radius))
    return found


def _palm_before(world: GraspWorld, window: Point, reach: float) -> PalmInView | None:
    """Return where a sensor is from the palm, None if no ray of its reaches it."""
    x, y, yaw = world.wrist
    r_x, r_y = window[0] - x, window[1] - y
    if math.hypot(r_x, r_y) > reach + _PALM.reach:
        return None
    c, s = math.cos(yaw), math.sin(yaw)
    return c * r_x + s * r_y, c * r_y - s * r_x, c, s
