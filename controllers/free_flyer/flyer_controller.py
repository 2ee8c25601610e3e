"""What several of a free-flyer's controllers are made with: parameters of robot and gains, and how they are sampled."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Generic, TypeVar

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody
from handover.controllers.free_flyer.gains import ImpedanceGains
from handover.controllers.free_flyer.ports import ARM, INERTIA, MASS, PERIOD, TERMINALS, Behaviour
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.ports import Matrix3, Vector3, parameter
from handover.cosim.blocks.terminals import Terminal
from handover.cosim.blocks.units import (
    Kilogram,
    KilogramMetre2,
    Metre,
    Newton,
    NewtonMetre,
    NewtonMetrePerRadian,
    NewtonMetreSecondPerRadian,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Second,
)

U = TypeVar("U")
Y = TypeVar("Y")


class SampledController(ABC, Generic[U, Y]):
    """A block that is sampled with `PERIOD`; one with memory gives its state by the last two methods."""

    period: ClassVar[Fraction] = PERIOD

    def outputs(self, t: float, u: U) -> Y:
        """Return what a step would give; no time passes, and nothing is decided."""
        before = self.get_state()
        y = self.step(t, float(self.period), u)
        self.set_state(before)
        return y

    @abstractmethod
    def step(self, t: float, dt: float, u: U) -> Y:
        """Return the commands for the measurements of t, which hold until t + dt."""

    def get_state(self) -> bytes:
        """Return nothing: there is no state."""
        return b""

    def set_state(self, state: bytes) -> None:
        """Do nothing: there is no state."""


class GripperController(SampledController[U, Y]):
    """A controller of the gripper's pose, whose linearised loop is analysed at construction."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "f_cmd": ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas", "p_WG_goal", "q_WG_goal", "active"),
        "tau_cmd": ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas", "p_WG_goal", "q_WG_goal", "active"),
        "error_p": ("p_WB_meas", "q_WB_meas", "p_WG_goal"),
        "error_R": ("q_WB_meas", "q_WG_goal"),
    }
    terminals: ClassVar[tuple[Terminal, ...]] = TERMINALS
    deferred: ClassVar[tuple[str, ...]] = ("control", "threadpoolctl")


@dataclass(frozen=True, kw_only=True)
class RobotParams:
    """What a robot whose joints are fixed knows of itself and its propulsion."""

    mass: Kilogram = parameter(MASS, "mass of the robot", minimum=0.0, maximum=1e4, origin=stated("Astrobee"))
    I_B: Matrix3[KilogramMetre2] = parameter(
        INERTIA, "inertia about the centre of mass, in B", origin=stated("Astrobee")
    )
    p_BG: Vector3[Metre] = parameter(
        ARM,
        "gripper, seen from the centre of mass (assumed)",
        minimum=-5.0,
        maximum=5.0,
        origin=assumed("not given: Astrobee's arm stretched out"),
    )
    delay: Second = parameter(
        0.0,
        "expected time from a measurement to its command's arrival at the propulsion",
        minimum=0.0,
        maximum=0.2,
        origin=NOT_GIVEN,
    )
    lag: Second = parameter(
        0.02,
        "expected time constant of the propulsion (assumed)",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("as the thrusters have it"),
    )

    def body(self) -> FlyerBody:
        """Return the robot's model of itself."""
        return FlyerBody(mass=self.mass, I_B=self.I_B, p_BG=self.p_BG)


@dataclass(frozen=True, kw_only=True)
class LimitParams:
    """Limits of the propulsion, to which commands are clipped."""

    f_max: Vector3[Newton] = parameter(
        np.array([0.55, 0.39, 0.45]),
        "largest force, along the axes of B",
        minimum=0.0,
        maximum=1e4,
        origin=stated("Astrobee, about"),
    )
    tau_max: Vector3[NewtonMetre] = parameter(
        np.array([0.064, 0.040, 0.075]),
        "largest torque, about the axes of B",
        minimum=0.0,
        maximum=1e4,
        origin=stated("Astrobee, about"),
    )


@dataclass(frozen=True, kw_only=True)
class GainParams:
    """Gains of [Fernandes2020] table 4.1, or custom ones."""

    behaviour: Behaviour = parameter(
        Behaviour.RIGID,
        "gains of [Fernandes2020] table 4.1, or CUSTOM for the four matrices below",
        origin=stated("table 4.1"),
    )
    stiffness_translation: Matrix3[NewtonPerMetre] = parameter(
        7.0 * MASS * np.eye(3),
        "CUSTOM: linear k_D, in the goal's axes",
        origin=derived("table 4.1, rigid: 7 times the mass"),
    )
    damping_translation: Matrix3[NewtonSecondPerMetre] = parameter(
        15.0 * np.eye(3), "CUSTOM: linear k_B, in the goal's axes", origin=stated("table 4.1, rigid")
    )
    stiffness_rotation: Matrix3[NewtonMetrePerRadian] = parameter(
        70.0 * INERTIA,
        "CUSTOM: rotational k_D, in the goal's axes",
        origin=derived("table 4.1, rigid: 70 times the inertia"),
    )
    damping_rotation: Matrix3[NewtonMetreSecondPerRadian] = parameter(
        5.0 * np.eye(3), "CUSTOM: rotational k_B, in the goal's axes", origin=stated("table 4.1, rigid")
    )

    def custom_gains(self) -> ImpedanceGains:
        """Return the four matrices."""
        return ImpedanceGains(
            stiffness_translation=self.stiffness_translation,
            damping_translation=self.damping_translation,
            stiffness_rotation=self.stiffness_rotation,
            damping_rotation=self.damping_rotation,
        )
