"""What a free-flyer's decision sees and commands in a handover, and the phases that it goes through."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Vector3, Vector4, output, port
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Radian, RadianPerSecond


class HandoverPhase(enum.IntEnum):
    """States of figure 3.1, its two ends, and what the thesis has not: a look whether what was released is gone."""

    OPEN_GRIPPER = 0
    MOVE_TO_OBJECT = 1
    GRASP_OBJECT = 2
    MOVE_TO_HANDOVER = 3
    ACTIVATE_IMPEDANCE = 4
    SIGNAL = 5
    CHECK_VELOCITY = 6
    RELEASE_OBJECT = 7
    CLOSE_GRIPPER = 8
    CHECK_ANGLE = 9
    DEACTIVATE_IMPEDANCE = 10
    RETREAT = 11
    DONE = 12
    GIVEN_UP = 13
    VERIFY_RELEASE = 14


@dataclass(kw_only=True)
class Inputs:
    """The navigation's estimate of the base, and the gripper's angle."""

    p_WB_meas: Vector3[Metre] = port(np.zeros(3), "estimated position of the centre of mass")
    q_WB_meas: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "estimated attitude")
    v_WB_meas: Vector3[MetrePerSecond] = port(np.zeros(3), "estimated velocity of the centre of mass, in the world")
    w_WB_meas: Vector3[RadianPerSecond] = port(np.zeros(3), "estimated angular velocity, in the world")
    gripper_angle: Radian = port(0.0, "angle between the gripper's main links")


@dataclass(kw_only=True)
class Outputs:
    """Where the gripper is to be, which controller is on, and what gripper and light do."""

    phase: HandoverPhase = output("what the robot is doing")
    p_WG_goal: Vector3[Metre] = output("where the gripper is to be")
    q_WG_goal: Vector4[Number] = output("orientation that it is to have")
    impedance: bool = output("impedance control is on")
    pose: bool = output("pose control is on")
    closure: Number = output("gripper command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light: bool = output("signal light: it begins when the robot is ready")
    failed_receptions: int = output("times that the gripper closed on nothing", minimum=0.0)
    failed_deliveries: int = output(
        "times that what it had released was still between the fingers, or what it had not was gone", minimum=0.0
    )
    speed_G: MetrePerSecond = output("speed of the gripper, low-passed, as it is monitored", minimum=0.0)
