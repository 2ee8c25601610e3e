"""Ports of the unit of hand and object: what the robot does, what its gripper feels, and who holds the object."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Vector3, Vector4, Vector14, output, port
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
from handover.plants.free_flyer.hand.person import Activity


class Holder(enum.IntEnum):
    """Who holds the object."""

    FREE = 0
    GRIPPER = 1
    HAND = 2
    BOTH = 3


@dataclass(kw_only=True)
class Inputs:
    """What the robot does; its gripper's place in the default wiring's start."""

    p_WG: Vector3[Metre] = port(np.array([0.0, -0.07, 0.0]), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "orientation of the gripper in the world")
    v_WG: Vector3[MetrePerSecond] = port(np.zeros(3), "velocity of the gripper in the world")
    w_WG: Vector3[RadianPerSecond] = port(np.zeros(3), "angular velocity of the gripper in the world")
    closure: Number = port(0.0, "closure commanded to the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light: bool = port(False, "the robot's signal light is on")
    p_WH_track: Vector3[Metre] = port(np.array([-0.40, 0.10, -0.05]), "wanted position of the hand, by a hand tracker")
    q_WH_track: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "wanted orientation of the hand, by it")
    finger_track: Vector14[Radian] = port(np.zeros(14), "wanted angles of the joints, by it, as the output finger")
    closed_track: bool = port(False, "by the tracker the hand grasps")
    age: Second = port(0.0, "age of what the tracker says", minimum=0.0)


@dataclass(kw_only=True)
class Outputs:
    """What the gripper feels, where object and hand are, in the world, and who holds the object."""

    f_G: Vector3[Newton] = output("force on the gripper at G, mean over the step")
    tau_G: Vector3[NewtonMetre] = output("torque on the gripper about G, mean over the step")
    p_WO: Vector3[Metre] = output("position of the object's centre")
    q_WO: Vector4[Number] = output("orientation of the object")
    v_WO: Vector3[MetrePerSecond] = output("velocity of the object's centre")
    p_WH: Vector3[Metre] = output("position of the middle of the palm of the hand")
    q_WH: Vector4[Number] = output("orientation of the hand, along the object's axes when it holds it as offered")
    finger: Vector14[Radian] = output("angles of the joints: thumb 2, then 3 of each finger, each from its base")
    gripper_angle: Radian = output("angle between the gripper's fingers")
    holder: Holder = output("who holds the object")
    activity: Activity = output("what the person does")
    f_H: Vector3[Newton] = output("force on the hand, mean over the step")
    p_WH_goal: Vector3[Metre] = output("position at which person or tracker want the hand")
    q_WH_goal: Vector4[Number] = output("orientation in which they want it")
    finger_goal: Vector14[Radian] = output("angles to which they want the joints")
    closed_goal: bool = output("they want the hand to grasp")
