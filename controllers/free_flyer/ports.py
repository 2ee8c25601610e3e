"""What a free-flyer's controllers share: ports, behaviours, sampling period and public values of Astrobee.

Each controller turns the navigation's estimate and a goal into thrust. Astrobee is the robot of [Fernandes2020]; only
where its gripper is, is assumed.
"""

import enum
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np

from handover.cosim.blocks.plain_rotation import Quaternion, normalize, quaternion, quaternion_dot
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, output, port
from handover.cosim.blocks.terminals import TerminalKind, terminal
from handover.cosim.blocks.units import (
    Metre,
    MetrePerSecond,
    Newton,
    NewtonMetre,
    Number,
    Radian,
    RadianPerSecond,
    Second,
)

PERIOD: Final = Fraction(2, 125)
"""Time between two samples in s, that of Astrobee's software, 1/62.5 s; sec. 4.1.2 prints 67.5 Hz."""

MASS = 9.584
"""kg"""

INERTIA = np.diag([0.1534, 0.1427, 0.1623])
"""About the centre of mass, kg m2."""

ARM = np.array([-0.30, 0.0, 0.0])
"""Gripper seen from the centre of mass, m; assumed."""


class Behaviour(enum.IntEnum):
    """Gains of the impedance control, and the velocity thresholds that belong to them, sec. 4.1.2, or custom ones."""

    RIGID = 0
    COMPLIANT = 1
    CUSTOM = 2


@dataclass(kw_only=True)
class Inputs:
    """The navigation's estimate of the base, the gripper's goal, and whether to act.

    An estimate that is updated at a rate, as by the parameter `update_rate` of the unit Navigation, is older by up to
    1 / rate. No controller expects that unless its parameter `delay` includes it: half of it, on average.
    """

    p_WB_meas: Vector3[Metre] = port(np.zeros(3), "estimated position of the centre of mass")
    q_WB_meas: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "estimated attitude")
    v_WB_meas: Vector3[MetrePerSecond] = port(np.zeros(3), "estimated velocity of the centre of mass, in the world")
    w_WB_meas: Vector3[RadianPerSecond] = port(np.zeros(3), "estimated angular velocity, in the world")
    p_WG_goal: Vector3[Metre] = port(np.array([0.0, -0.07, 0.0]), "where the gripper is to be")
    q_WG_goal: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "orientation that it is to have")
    active: bool = port(False, "the controller is on")


@dataclass(kw_only=True)
class Outputs:
    """Command in B at the centre of mass, zero when not active; the gripper's error; the linearised loop's poles."""

    f_cmd: Vector3[Newton] = output("commanded force, in B")
    tau_cmd: Vector3[NewtonMetre] = output("commanded torque about the centre of mass, in B")
    error_p: Metre = output("distance of the gripper from its goal", minimum=0.0)
    error_R: Radian = output("angle between the gripper and its goal", minimum=0.0)
    pole_radius: Number = output("largest |z| of the linearised loop", minimum=0.0)
    damping_ratio: Number = output("least damping ratio of the linearised loop")
    pole_frequency: RadianPerSecond = output("frequency of the pole with that ratio", minimum=0.0)
    slowest_decay: Second = output("time constant of the pole with the largest |z|", minimum=0.0)


TERMINALS = (
    terminal("estimate", TerminalKind.MOTION, "p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas"),
    terminal("goal", TerminalKind.POSE, "p_WG_goal", "q_WG_goal"),
    terminal("command", TerminalKind.WRENCH, "f_cmd", "tau_cmd"),
)
"""What of a controller's ports is connected together."""


class InvalidOrientation(ValueError):
    """A quaternion that is zero or not finite, which is not an orientation; nothing has changed."""

    is_refusal = True

    def __init__(self, block: str, name: str, q: Floats) -> None:
        super().__init__(f"{block}: {name} = {np.asarray(q).tolist()} must be finite and not zero")
        self.name = name


def unit_quaternion(q: Floats, block: str, name: str) -> Quaternion:
    """Return a port's or a parameter's quaternion, scalar first, divided by its norm.

    Raises:
        InvalidOrientation: it is zero or not finite.
    """
    given = quaternion(q)
    if not 1e-12 < quaternion_dot(given, given) < math.inf:
        raise InvalidOrientation(block, name, q)
    return normalize(given)
