"""Parameters of the grasp scene, and what is wrong with them."""

import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.ports import Floats, Vector2, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import (
    Kilogram,
    Metre,
    MetrePerSecond,
    MetrePerSecond2,
    NewtonMetreSecondPerRadian,
    NewtonPerMetre,
    Number,
    PerSecond,
    PerTick,
    Radian,
    RadianPerSecond,
    RadianPerSecond2,
    Second,
    Tick,
)
from handover.plants.infrared_sensor import InfraredSensor, InvalidSensorParameters
from handover.plants.ir_grasp.objects import SOLIDS, Solid, Thing, outlines

OUT_OF_RANGE = 0.2
"""Value of the output `range` where a sensor's ray meets no object, in m."""

_MIN_MASS = 1e-3
"""Least mass of an object, kg: contacts with much heavier phalanges would throw a lighter one off."""


class InvalidSceneParameters(InvalidParameters):
    """Values of which no scene can be built; `faults` lists all of them."""

    block = "GraspScene"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Table, object, hand and sensors.

    [Luberto] states the operating range of the sensors, their converter (sec. V-B) and the form of their
    characteristic, eq. (11). All else is assumed, the characteristic's coefficients too; the shapes are in
    `handover.plants.ir_grasp.hand` and `handover.plants.ir_grasp.objects`.
    """

    thing: Thing = parameter(Thing.CYLINDER, "what stands on the table, in which reference pose")
    p_WO_0: Vector2[Metre] = parameter(
        np.array([0.0, 0.0]), "where it stands at the start, in the world", minimum=-2.0, maximum=2.0
    )
    yaw_O_0: Radian = parameter(
        0.0, "how far it is turned from its reference pose at the start", minimum=-math.pi, maximum=math.pi
    )
    p_WH_0: Vector2[Metre] = parameter(
        np.array([-0.25, 0.0]), "where the wrist is at the start, in the world", minimum=-2.0, maximum=2.0
    )
    yaw_H_0: Radian = parameter(0.0, "orientation of the hand at the start", minimum=-math.pi, maximum=math.pi)
    sigma_0: Number = parameter(0.0, "closure at the start: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    table_size: Vector2[Metre] = parameter(
        np.array([1.2, 0.9]), "extents of the table, whose middle is the world's origin", minimum=0.1, maximum=4.0
    )
    mass_O: Kilogram = parameter(0.0, "mass of the object; 0: the thing's own", minimum=0.0, maximum=5.0)
    gravity: MetrePerSecond2 = parameter(9.81, "gravity, which presses on the table", minimum=0.0, maximum=30.0)
    table_friction: Number = parameter(0.3, "friction coefficient of object and table", minimum=0.0, maximum=2.0)
    grip_friction: Number = parameter(0.6, "friction coefficient of object and hand", minimum=0.0, maximum=2.0)
    wrist_speed: MetrePerSecond = parameter(0.3, "largest speed of the wrist", minimum=1e-3, maximum=3.0)
    wrist_acceleration: MetrePerSecond2 = parameter(
        10.0, "largest acceleration of the wrist", minimum=0.01, maximum=100.0
    )
    turning_rate: RadianPerSecond = parameter(1.5, "largest turning rate of the wrist", minimum=1e-3, maximum=20.0)
    turning_acceleration: RadianPerSecond2 = parameter(
        50.0, "largest angular acceleration of the wrist", minimum=0.01, maximum=1000.0
    )
    wrist_lag: Second = parameter(
        0.02, "time constant with which the wrist settles on its command", minimum=0.002, maximum=1.0
    )
    closure_rate: PerSecond = parameter(1.0, "largest rate of the closure", minimum=1e-3, maximum=20.0)
    tendon_stiffness: NewtonPerMetre = parameter(400.0, "stiffness k of the tendon", minimum=1.0, maximum=2000.0)
    tendon_travel: Metre = parameter(
        0.094, "length L of tendon that the motor takes up at closure 1", minimum=0.0, maximum=0.3
    )
    joint_damping: NewtonMetreSecondPerRadian = parameter(6e-3, "damping of a joint", minimum=0.0, maximum=1.0)
    phalanx_mass: Kilogram = parameter(0.02, "mass of a phalanx", minimum=5e-3, maximum=1.0)
    a: Metre = parameter(0.062, "a of the characteristic y = a exp(b x) + c exp(d x)", minimum=-1.0, maximum=1.0)
    b: PerTick = parameter(-0.0030, "b of the characteristic", minimum=-0.1, maximum=0.1)
    c: Metre = parameter(0.022, "c of the characteristic", minimum=-1.0, maximum=1.0)
    d: PerTick = parameter(-0.00043, "d of the characteristic", minimum=-0.1, maximum=0.1)
    nearest: Metre = parameter(0.004, "distance of the largest reading; nearer, readings fall again", minimum=1e-4)
    farthest: Metre = parameter(0.065, "distance beyond which nothing is seen", maximum=0.15)
    contact_share: Number = parameter(
        0.4, "share of the largest reading that is left at contact", minimum=0.0, maximum=1.0
    )
    incidence_exponent: Number = parameter(
        1.0, "exponent n of the reading's fall with cos(theta)^n, theta from the normal", minimum=0.0, maximum=10.0
    )
    beam: Radian = parameter(0.15, "half the opening angle of a sensor's beam", minimum=0.0, maximum=0.7)
    reflectivity: Number = parameter(
        0.0, "reflectivity of the object over the reference's; 0: the thing's own", minimum=0.0, maximum=2.0
    )
    noise: Tick = parameter(4.0, "standard deviation of a reading", minimum=0.0, maximum=1000.0)
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    @property
    def solid(self) -> Solid:
        """What stands on the table."""
        return SOLIDS[self.thing]

    def sensor(self) -> InfraredSensor:
        """Return one of the sensors.

        Raises:
            InvalidSensorParameters: its characteristic cannot be inverted.
        """
        coefficients = (self.a, self.b, self.c, self.d)
        return InfraredSensor(*coefficients, self.nearest, self.farthest, self.contact_share, self.incidence_exponent)

    def check(self) -> None:
        """Raise InvalidSceneParameters, with all faults: ranges, mass, an object beside the table, a sensor."""
        faults = parameter_faults(self)
        if not faults:
            if 0.0 < self.mass_O < _MIN_MASS:
                faults.append(f"mass_O {self.mass_O:g} kg must be 0, for the thing's own, or at least {_MIN_MASS:g} kg")
            faults.extend(self._table_faults())
            try:
                self.sensor()
            except InvalidSensorParameters as error:
                faults.extend(error.faults)
        if faults:
            raise InvalidSceneParameters(faults)

    def _table_faults(self) -> list[str]:
        yaw, half = self.solid.yaw + self.yaw_O_0, self.table_size / 2.0
        R_WO: Floats = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        corners: Floats = self.p_WO_0 + np.vstack(outlines(self.thing)) @ np.transpose(R_WO)
        beyond = float(np.max(np.abs(corners) - half))
        if beyond <= 0.0:
            return []
        return [
            f"p_WO_0 {self.p_WO_0.tolist()} m: the {self.thing.name.lower()} stands out {1e3 * beyond:.3g} mm beyond "
            f"the table, which reaches to {half.tolist()} m on either side of the origin"
        ]
