"""A free-flyer that offers an object while something knocks against it: its blocks in a loop, in the order of a run."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.free_flyer import handover_state_machine, impedance_controller, pose_controller
from handover.controllers.free_flyer.handover_state_machine import HandoverPhase, HandoverStateMachine, HandoverTask
from handover.controllers.free_flyer.impedance_controller import Behaviour, ImpedanceController
from handover.controllers.free_flyer.pose_controller import PoseController
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand import hand_and_object
from handover.plants.free_flyer.hand.hand_and_object import HandAndObject, Holder, Motion
from handover.plants.free_flyer.robot import free_flyer, navigation, thrusters
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer
from handover.plants.free_flyer.robot.navigation import Navigation
from handover.plants.free_flyer.robot.thrusters import Thrusters

T = 0.016
WAITING = 1.0
"""Seconds after the light at which a knock begins."""
_PLACE, _START = np.array([0.0, -0.07, 0.0]), np.array([0.15, -0.64, 0.0])


@dataclass
class Offer:
    """What came of an offer that nobody took.

    Attributes:
        dropped: whether the object was ever out of the gripper.
        widest: how far the fingers opened from what they held, rad.
        ended: the robot's last phase.
        fastest: the gripper's speed, as it is monitored, at most, m/s.
        failed: deliveries that the robot found to have failed.
        holder: who has the object at the end.
    """

    dropped: bool = False
    widest: float = 0.0
    ended: HandoverPhase = HandoverPhase.OPEN_GRIPPER
    fastest: float = 0.0
    failed: int = 0
    holder: Holder = Holder.FREE


def offer(force: Floats, duration: float, behaviour: Behaviour, seed: int = 0, **decision: Any) -> Offer:
    """Let the robot fetch the object, offer it, and be knocked by a force on its gripper, in W, for a time."""
    robot = FreeFlyer(free_flyer.Params(p_WB_0=_START - free_flyer.Params().p_BG))
    estimate = Navigation(navigation.Params(seed=seed))
    task = HandoverTask.ROBOT_TO_HUMAN
    machine = HandoverStateMachine(handover_state_machine.Params(task=task, behaviour=behaviour, **decision))
    impedance = ImpedanceController(impedance_controller.Params(behaviour=behaviour))
    pose, thrust = PoseController(pose_controller.Params()), Thrusters(thrusters.Params())
    person = HandAndObject(
        hand_and_object.Params(motion=Motion.NONE, seed=seed, angle_0=0.6, grip_fades=bool(decision.get("gradual")))
    )
    r, o = robot.outputs(0.0, free_flyer.Inputs()), person.outputs(0.0, hand_and_object.Inputs())
    found, since, held = Offer(), -1.0, 0.0
    for n in range(round(45.0 / T)):
        t = n * T
        u = navigation.Inputs(**{k: getattr(r, k) for k in ("p_WB", "q_WB", "v_WB", "w_WB")})
        seen: dict[str, Any] = vars(estimate.step(t, T, u) if n else estimate.outputs(t, u))
        d = machine.step(t, T, handover_state_machine.Inputs(**seen, gripper_angle=o.gripper_angle))
        if since < 0.0 and d.phase is HandoverPhase.CHECK_VELOCITY:
            since, held = t, o.gripper_angle
        goal = {"p_WG_goal": d.p_WG_goal, "q_WG_goal": d.q_WG_goal}
        a = impedance.step(t, T, impedance_controller.Inputs(**seen, **goal, active=d.impedance))
        b = pose.step(t, T, pose_controller.Inputs(**seen, **goal, active=d.pose))
        commands = {"f_impedance": a.f_cmd, "tau_impedance": a.tau_cmd, "f_pose": b.f_cmd, "tau_pose": b.tau_cmd}
        y = thrust.step(t, T, thrusters.Inputs(**commands))
        knocked = since >= 0.0 and WAITING <= t - since < WAITING + duration - 1e-9
        f_G = o.f_G + force if knocked else o.f_G
        r = robot.step(t, T, free_flyer.Inputs(f_B=y.f_B, tau_B=y.tau_B, f_G=f_G, tau_G=o.tau_G))
        gripper = {k: getattr(r, k) for k in ("p_WG", "q_WG", "v_WG", "w_WG")}
        o = person.step(t, T, hand_and_object.Inputs(**gripper, closure=d.closure, light=d.light))
        if since >= 0.0:
            found.dropped |= o.holder is not Holder.GRIPPER
            found.widest = max(found.widest, o.gripper_angle - held)
            found.fastest = max(found.fastest, d.speed_G)
            found.ended, found.failed, found.holder = d.phase, d.failed_deliveries, o.holder
            if t - since > WAITING + duration + 4.0:
                break
    return found
