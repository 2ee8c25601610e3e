"""Parameters of the grasp scene, and what is wrong with them."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, stated
from handover.cosim.blocks.ports import Corners8, Floats, Vector2, Vector3, Vector8, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Kilogram,
    Metre,
    MetrePerSecond,
    MetrePerSecond2,
    Newton,
    NewtonMetreSecondPerRadian,
    NewtonPerMetre,
    Number,
    PerSecond,
    Radian,
    RadianPerSecond,
    RadianPerSecond2,
    Second,
    Tick,
)
from handover.plants.infrared_sensor import InfraredSensor, InvalidSensorParameters, SensorParameters, ToleratedSensor
from handover.plants.ir_grasp.actuation import STIFFNESS
from handover.plants.ir_grasp.ground import Span, bump
from handover.plants.ir_grasp.objects import Solid, Thing, placed, polygon_corners, solid_of, with_own
from handover.plants.ir_grasp.shapes import Disc, polygon_faults

_OWN_TEST = assumed("a test of our own; not in the paper")
_DRAWN = assumed("not given; the scenario draws it")
_ALIKE = assumed("not given; sensors that are alike")

OUT_OF_RANGE = 0.2
"""Value of the output `range` where a sensor's ray meets no object, in m."""

_MIN_MASS = 1e-3
"""Least mass of an object, kg: contacts with much heavier phalanges would throw a lighter one off (assumed)."""

PENTAGON = np.array(
    [
        [-0.03, -0.024],
        [0.034, -0.03],
        [0.04, 0.01],
        [0.002, 0.036],
        [-0.036, 0.014],
        [0.0, 0.0],
        [0.0, 0.0],
        [0.0, 0.0],
    ]
)
"""Corners of the polygon that is the default, (8, 2), in m."""


class InvalidSceneParameters(InvalidParameters):
    """Values of which no scene can be built; `faults` lists all of them."""

    block = "GraspScene"


@dataclass(frozen=True, kw_only=True)
class Params(SensorParameters):
    """Table, object, hand and sensors.

    [Luberto] states the operating range of the sensors, their converter (sec. V-B) and the form of their
    characteristic, eq. (11). All else is assumed, the characteristic's coefficients too; the shapes are in
    `handover.plants.ir_grasp.hand` and `handover.plants.ir_grasp.objects`.
    """

    thing: Thing = parameter(
        Thing.CYLINDER,
        "what stands on the table, in which reference pose",
        origin=stated("tables I and II have a cylinder, a baby cup and a paper box, the latter two in two poses"),
    )
    disc_radius: Metre = parameter(
        0.033, "radius of thing=disc", minimum=5e-3, maximum=0.1, origin=assumed("a test of our own; the cylinder's")
    )
    bar_size: Vector2[Metre] = parameter(
        np.array([0.11, 0.03]),
        "length and width of thing=bar",
        minimum=5e-3,
        maximum=0.3,
        origin=_OWN_TEST,
    )
    corners: Corners8[Metre] = parameter(
        PENTAGON,
        "corners of thing=polygon, counter-clockwise: the first corner_count, the rest may be 0",
        minimum=-0.2,
        maximum=0.2,
        origin=_OWN_TEST,
    )
    corner_count: int = parameter(
        5,
        "how many corners thing=polygon has",
        minimum=3,
        maximum=8,
        origin=_OWN_TEST,
    )
    thing_seed: int = parameter(
        0,
        "which object of its family thing=drawn is; odd ones are kept from all tuning",
        minimum=0,
        origin=_OWN_TEST,
    )
    p_WO_0: Vector2[Metre] = parameter(
        np.array([0.0, 0.0]), "where it stands at the start, in the world", minimum=-2.0, maximum=2.0, origin=_DRAWN
    )
    yaw_O_0: Radian = parameter(
        0.0,
        "how far it is turned from its reference pose at the start",
        minimum=-math.pi,
        maximum=math.pi,
        origin=_DRAWN,
    )
    p_WH_0: Vector2[Metre] = parameter(
        np.array([-0.25, 0.0]),
        "where the wrist is at the start, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=_DRAWN,
    )
    yaw_H_0: Radian = parameter(
        0.0, "orientation of the hand at the start", minimum=-math.pi, maximum=math.pi, origin=_DRAWN
    )
    sigma_0: Number = parameter(
        0.0, "closure at the start: 0 open, 1 closed", minimum=0.0, maximum=1.0, origin=NOT_GIVEN
    )
    table_size: Vector2[Metre] = parameter(
        np.array([1.2, 0.9]),
        "extents of the table, whose middle is the world's origin",
        minimum=0.1,
        maximum=4.0,
        origin=NOT_GIVEN,
    )
    carry_velocity: Vector2[MetrePerSecond] = parameter(
        np.zeros(2),
        "velocity of the ground under the object, which carries it",
        minimum=-0.5,
        maximum=0.5,
        origin=_OWN_TEST,
    )
    carry_from: Second = parameter(
        0.0,
        "when the ground begins to carry the object",
        minimum=0.0,
        maximum=600.0,
        origin=_OWN_TEST,
    )
    carry_until: Second = parameter(12.0, "when it stops", minimum=0.0, maximum=600.0, origin=_OWN_TEST)
    nudge: Vector2[Metre] = parameter(
        np.zeros(2),
        "how far somebody bumps the object along, in the world, if nothing holds it",
        minimum=-0.2,
        maximum=0.2,
        origin=assumed("fig. 3b has an unexpected motion of the object; its size is not given"),
    )
    nudge_time: Second = parameter(
        4.0, "when the bump begins", minimum=0.0, maximum=600.0, origin=assumed("not given; while the reflex probes")
    )
    nudge_speed: MetrePerSecond = parameter(0.1, "speed of the bump", minimum=1e-3, maximum=0.5, origin=NOT_GIVEN)
    mass_O: Kilogram = parameter(
        0.0,
        "mass of the object; 0: the thing's own",
        minimum=0.0,
        maximum=5.0,
        origin=assumed("not given; 0: the thing's own, in plants/ir_grasp/objects.py"),
    )
    mass_offset: Vector2[Metre] = parameter(
        np.zeros(2),
        "shifts the centre of mass from the middle, in the object's axes",
        minimum=-0.1,
        maximum=0.1,
        origin=_OWN_TEST,
    )
    gravity: MetrePerSecond2 = parameter(
        9.81, "gravity, which presses on the table", minimum=0.0, maximum=30.0, origin=assumed("standard")
    )
    table_friction: Number = parameter(
        0.3, "friction coefficient of object and table", minimum=0.0, maximum=2.0, origin=NOT_GIVEN
    )
    grip_friction: Number = parameter(
        0.6, "friction coefficient of object and hand", minimum=0.0, maximum=2.0, origin=NOT_GIVEN
    )
    wrist_speed: MetrePerSecond = parameter(
        0.3, "largest speed of the wrist", minimum=1e-3, maximum=3.0, origin=NOT_GIVEN
    )
    wrist_acceleration: MetrePerSecond2 = parameter(
        10.0, "largest acceleration of the wrist", minimum=0.01, maximum=100.0, origin=NOT_GIVEN
    )
    turning_rate: RadianPerSecond = parameter(
        1.5, "largest turning rate of the wrist", minimum=1e-3, maximum=20.0, origin=NOT_GIVEN
    )
    turning_acceleration: RadianPerSecond2 = parameter(
        50.0, "largest angular acceleration of the wrist", minimum=0.01, maximum=1000.0, origin=NOT_GIVEN
    )
    wrist_lag: Second = parameter(
        0.02, "time constant with which the wrist settles on its command", minimum=0.002, maximum=1.0, origin=NOT_GIVEN
    )
    closure_rate: PerSecond = parameter(
        1.0, "largest rate of the closure", minimum=1e-3, maximum=20.0, origin=NOT_GIVEN
    )
    tendon_stiffness: NewtonPerMetre = parameter(
        400.0, "stiffness k of the tendon", minimum=1.0, maximum=2000.0, origin=NOT_GIVEN
    )
    tendon_travel: Metre = parameter(
        0.094, "length L of tendon that the motor takes up at closure 1", minimum=0.0, maximum=0.3, origin=NOT_GIVEN
    )
    joint_damping: NewtonMetreSecondPerRadian = parameter(
        6e-3, "damping of a joint", minimum=0.0, maximum=1.0, origin=NOT_GIVEN
    )
    phalanx_mass: Kilogram = parameter(0.02, "mass of a phalanx", minimum=5e-3, maximum=1.0, origin=NOT_GIVEN)
    stiffness_tolerance: Number = parameter(
        0.0,
        "largest part by which each joint's stiffness is off its design's, drawn",
        minimum=0.0,
        maximum=0.9,
        origin=_OWN_TEST,
    )
    beam: Radian = parameter(
        0.15, "half the opening angle of a sensor's beam", minimum=0.0, maximum=0.7, origin=NOT_GIVEN
    )
    reflectivity: Number = parameter(
        0.0,
        "reflectivity of the object over the reference's; 0: the thing's own",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("not given; 0: the thing's own, in plants/ir_grasp/objects.py"),
    )
    face_reflectivity: Vector8[Number] = parameter(
        np.ones(8),
        "factor of the reflectivity by face: edge of a bar, box or polygon from corner 1 on, eighth of a disc",
        minimum=0.0,
        maximum=10.0,
        origin=_OWN_TEST,
    )
    gloss: Number = parameter(
        0.0,
        "share of light that the object reflects like a mirror",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; matte"),
    )
    gloss_exponent: Number = parameter(
        40.0,
        "exponent m of the mirror's lobe, cos(2 theta)^m",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed("not given; a lobe that is half as bright 5 degrees off"),
    )
    noise: Tick = parameter(4.0, "standard deviation of a reading", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN)
    a_scale: Vector3[Number] = parameter(np.ones(3), "factor of a, by finger", minimum=0.2, maximum=5.0, origin=_ALIKE)
    b_scale: Vector3[Number] = parameter(np.ones(3), "factor of b, by finger", minimum=0.2, maximum=5.0, origin=_ALIKE)
    c_scale: Vector3[Number] = parameter(np.ones(3), "factor of c, by finger", minimum=0.2, maximum=5.0, origin=_ALIKE)
    d_scale: Vector3[Number] = parameter(np.ones(3), "factor of d, by finger", minimum=0.2, maximum=5.0, origin=_ALIKE)
    sensor_tolerance: Number = parameter(
        0.0,
        "largest part by which each of a, b, c, d of each finger is off besides, drawn",
        minimum=0.0,
        maximum=0.5,
        origin=_ALIKE,
    )
    ambient: Tick = parameter(
        0.0, "what ambient light adds to each reading", minimum=0.0, maximum=4095.0, origin=NOT_GIVEN
    )
    ambient_noise: Tick = parameter(0.0, "standard deviation of that", minimum=0.0, maximum=1000.0, origin=NOT_GIVEN)
    active: int = parameter(
        1, "how many sensors are active at once", minimum=1, maximum=3, origin=stated("sec. V-B: one sensor at a time")
    )
    crosstalk: Number = parameter(
        0.1,
        "part of another active sensor's own light that a sensor receives",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("not given; without effect while one sensor is active at a time"),
    )
    fingers_seen: bool = parameter(
        False, "fingers and palm hide the object from sensors and return light", origin=NOT_GIVEN
    )
    finger_reflectivity: Number = parameter(
        0.5, "reflectivity of fingers and palm", minimum=0.0, maximum=2.0, origin=NOT_GIVEN
    )
    wrist_noise: Metre = parameter(
        0.0, "standard deviation of the measured wrist, by axis", minimum=0.0, maximum=0.05, origin=NOT_GIVEN
    )
    heading_noise: Radian = parameter(
        0.0, "standard deviation of the measured heading", minimum=0.0, maximum=0.5, origin=NOT_GIVEN
    )
    closure_noise: Number = parameter(
        0.0, "standard deviation of the measured closure", minimum=0.0, maximum=0.5, origin=NOT_GIVEN
    )
    joint_noise: Radian = parameter(
        0.0, "standard deviation of each measured joint angle", minimum=0.0, maximum=0.5, origin=NOT_GIVEN
    )
    tension_noise: Newton = parameter(
        0.0, "standard deviation of the measured tension", minimum=0.0, maximum=10.0, origin=NOT_GIVEN
    )
    other_radius: Metre = parameter(
        0.0,
        "radius of a second object on the table, a disc; 0: none",
        minimum=0.0,
        maximum=0.1,
        origin=_OWN_TEST,
    )
    p_WX_0: Vector2[Metre] = parameter(
        np.array([0.0, 0.12]),
        "where the second object stands at the start, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=_OWN_TEST,
    )
    other_mass: Kilogram = parameter(
        0.15,
        "mass of the second object",
        minimum=_MIN_MASS,
        maximum=5.0,
        origin=_OWN_TEST,
    )
    other_reflectivity: Number = parameter(
        0.9,
        "reflectivity of the second object",
        minimum=0.0,
        maximum=2.0,
        origin=_OWN_TEST,
    )
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    @property
    def solid(self) -> Solid:
        """What stands on the table."""
        solid = solid_of(
            self.thing,
            disc_radius=self.disc_radius,
            bar_size=self.bar_size,
            corners=self.corners,
            corner_count=self.corner_count,
            thing_seed=self.thing_seed,
        )
        return with_own(solid, self.mass_O, self.reflectivity, self.face_reflectivity, self.mass_offset)

    @property
    def ground_spans(self) -> tuple[Span, ...]:
        """When the ground under the object moves, and how fast."""
        x, y = self.nudge.tolist()
        v_x, v_y = self.carry_velocity.tolist()
        return (self.carry_from, self.carry_until, (v_x, v_y)), bump((x, y), self.nudge_time, self.nudge_speed)

    @property
    def joint_stiffness(self) -> Floats:
        """Stiffness of the joints, (8,), in N m/rad: that of the hand's design, each off by the tolerance."""
        rng = np.random.default_rng([self.seed, 0x571FF])
        return STIFFNESS * (1.0 + self.stiffness_tolerance * rng.uniform(-1.0, 1.0, STIFFNESS.shape))

    def finger_sensors(self) -> list[InfraredSensor]:
        """Return the sensors of thumb, index and ring, each with its constants off by its scales and the tolerance.

        Raises:
            InvalidSensorParameters: a characteristic cannot be inverted.
        """
        scales = np.column_stack([self.a_scale, self.b_scale, self.c_scale, self.d_scale])
        rng = np.random.default_rng([self.seed, 0x5E2502])
        off: Floats = scales * (1.0 + self.sensor_tolerance * rng.uniform(-1.0, 1.0, scales.shape))
        constants = off * np.array([self.a, self.b, self.c, self.d])
        self.sensor()  # what is wrong with all is reported once
        faults, sensors = list[str](), list[InfraredSensor]()
        for finger, (a, b, c, d) in zip(("thumb", "index", "ring"), constants.tolist(), strict=True):
            try:
                sensors.append(ToleratedSensor(a, b, c, d, *self.optics))
            except InvalidSensorParameters as error:
                faults.extend(f"{finger}, with its scales and tolerance: {fault}" for fault in error.faults)
        if faults:
            raise InvalidSensorParameters(faults)
        return sensors

    def check(self) -> None:
        """Raise InvalidSceneParameters, with all faults: ranges, mass, an object beside the table, a sensor."""
        faults = parameter_faults(self)
        if not faults:
            if 0.0 < self.mass_O < _MIN_MASS:
                faults.append(f"mass_O {self.mass_O:g} kg must be 0, for the thing's own, or at least {_MIN_MASS:g} kg")
            faults.extend([*self._ground_faults(), *(self._shape_faults() or self._table_faults())])
            try:
                self.finger_sensors()
            except InvalidSensorParameters as error:
                faults.extend(error.faults)
        if faults:
            raise InvalidSceneParameters(faults)

    def _ground_faults(self) -> list[str]:
        if np.any(self.carry_velocity) and not self.carry_from < self.carry_until:
            return [
                f"carry_until {self.carry_until:g} s must be after carry_from {self.carry_from:g} s; "
                "with nothing to carry, carry_velocity must be 0 m/s"
            ]
        return []

    def _shape_faults(self) -> list[str]:
        if self.thing is Thing.POLYGON:
            faults = polygon_faults(polygon_corners(self.corners, self.corner_count), "corners")
            if faults:
                return faults
        solid = self.solid
        if not np.any(self.mass_offset) or _is_in(solid):
            return []
        x, y = solid.centre_of_mass
        return [
            f"mass_offset {self.mass_offset.tolist()} m: the centre of mass would be at ({x:.4g}, {y:.4g}) m of the "
            f"{self.thing.name.lower()}, outside it"
        ]

    def _table_faults(self) -> list[str]:
        half = self.table_size / 2.0
        solid = self.solid
        outline: Floats = np.vstack(placed(solid, self.p_WO_0, solid.yaw + self.yaw_O_0))
        named = [(f"p_WO_0 {self.p_WO_0.tolist()} m: the {self.thing.name.lower()}", outline)]
        if np.any(self.carry_velocity) or np.any(self.nudge):
            carried = (self.carry_until - self.carry_from) * self.carry_velocity
            for way in (carried, self.nudge, carried + self.nudge):  # straight lines between these places
                x, y = self.p_WO_0 + way
                named.append((f"carried to [{x:.3f}, {y:.3f}] m: the {self.thing.name.lower()}", outline + way))
        if self.other_radius > 0.0:
            edge = self.other_radius * np.array([[1.0, 1.0], [-1.0, -1.0]])
            named.append((f"p_WX_0 {self.p_WX_0.tolist()} m: the second object", self.p_WX_0 + edge))
        reaches = f"the table, which reaches to {half.tolist()} m on either side of the origin"
        return [
            f"{what} stands out {1e3 * beyond:.3g} mm beyond {reaches}"
            for what, points in named
            if (beyond := float(np.max(np.abs(points) - half))) > 0.0
        ]


def _is_in(solid: Solid) -> bool:
    """Return whether an object's centre of mass is in its first part."""
    x, y = solid.centre_of_mass
    body = solid.parts[0]
    if isinstance(body, Disc):
        return math.hypot(x, y) < body.radius
    edges = pairwise([*body.corners, body.corners[0]])  # even-odd rule
    crossed = [(a, b) for a, b in edges if (a[1] > y) != (b[1] > y)]
    return sum(x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) for a, b in crossed) % 2 == 1
