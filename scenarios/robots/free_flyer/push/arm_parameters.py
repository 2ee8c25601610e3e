"""Parameters of a push on a robot whose arm moves, and the robot that they describe."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handover.controllers.free_flyer.arm_impedance_controller import Params as ControllerParams
from handover.controllers.free_flyer.arm_model import ArmModel, Chain
from handover.controllers.free_flyer.gains import ImpedanceGains
from handover.controllers.free_flyer.ports import Behaviour as ControllerBehaviour
from handover.cosim.blocks.origins import NOT_GIVEN, assumed
from handover.cosim.blocks.ports import Floats, Vector3, parameter
from handover.cosim.blocks.units import NewtonMetre, Number, Radian
from handover.plants.free_flyer.robot.free_flyer import Params as RobotParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.robots.free_flyer.parameters import Axis, Body, ImpedanceParameters


@dataclass(frozen=True)
class ArmTarget:
    """What a run is judged by: where the gripper rests, and the robot as its controllers assume it to be.

    Attributes:
        p_WG, R_WG: pose of rest, (3,), m, and (3, 3).
        gains: of the impedance, in the axes of G at rest.
        model: base and arm.
        fixed: whether the joints are fixed.
    """

    p_WG: Floats
    R_WG: Floats
    gains: ImpedanceGains
    model: ArmModel
    fixed: bool


@dataclass(frozen=True, kw_only=True)
class ArmPushParameters(ImpedanceParameters):
    """One push on a robot whose arm has joints; factors of the arm's length scale its links, too."""

    axis: Axis = parameter(
        Axis.Z,
        "axis of W of the push",
        origin=assumed("sec. 4.1.3: all three; across the arm its joints give way most"),
    )
    joints: int = expose(ControllerParams, "impedance.joints", "robot.joints", minimum=1)
    posture: Vector3[Radian] = parameter(
        np.array([0.6, 0.5, -0.6]),
        "angles of the joints at the start, to which they go back",
        minimum=-1.5,
        maximum=1.5,
        origin=assumed("not given: a bent arm, of which no joint is at a limit"),
    )
    tolerance: float = expose(RobotParams, "robot.tolerance_J", minimum=0.0)
    rotational_damping: float = expose(ControllerParams, "impedance.rotational_damping", maximum=20.0)
    friction: NewtonMetre = parameter(0.0, "dry friction of the joints", minimum=0.0, maximum=1.0, origin=NOT_GIVEN)
    lock_time: float = expose(RobotParams, "robot.lock_time")
    model_link_factor: Number = parameter(
        1.0,
        "mass and inertia of the links that the controller assumes, times the public ones",
        minimum=0.2,
        maximum=5.0,
        origin=assumed("the controllers know the robot's arm"),
    )

    @property
    def fixed(self) -> bool:
        """Whether the joints cannot move, and the controller knows it, eq. (4.1)."""
        return self.tolerance == 0.0

    def arm(self, length: float, mass: float = 1.0) -> dict[str, Any]:
        """Return parameters of the arm, its links scaled."""
        public = {name: np.array(value) for name, value in paper_values("free_flyer", f"arm_{self.joints}").items()}
        scaled = {"link": length * public["link"], "mass_L": mass * public["mass_L"], "I_L": mass * public["I_L"]}
        return {"joints": self.joints, **scaled}

    def controller(self) -> dict[str, Any]:
        """Return parameters of the controller: with fixed joints, those of the whole as one body about B."""
        arm = self.arm(self.model_arm_factor, self.model_link_factor)
        common = {"behaviour": self.behaviour.item}
        moving = {**common, **vars(self.model), **arm, "q_J_goal": self.posture}
        if not self.fixed:
            return moving
        assumed = self._assumed()
        chain = Chain(assumed.model(), np.eye(3), np.zeros(3), assumed.posture)
        whole = assumed.model().whole(assumed.posture)
        return {**common, "joints": 0, **vars(Body(whole.mass, whole.I_B, chain.p[-1]))}

    def _assumed(self) -> ControllerParams:
        arm = self.arm(self.model_arm_factor, self.model_link_factor)
        params = ControllerParams(**vars(self.model), **arm, q_J_goal=self.posture)
        behaviour = ControllerBehaviour(int(self.behaviour))
        return replace(params, behaviour=behaviour, rotational_damping=self.rotational_damping)

    def gripper_at_start(self) -> tuple[Floats, Floats]:
        """Return p_BG (3,) and R_BG (3, 3) of the robot as it is, in its posture."""
        params = ControllerParams(**vars(self.robot), **self.arm(self.arm_factor), q_J_goal=self.posture)
        chain = Chain(params.model(), np.eye(3), np.zeros(3), params.posture)
        return chain.p[-1], chain.R[-1]

    def target(self) -> ArmTarget:
        """Return what a run is judged by; the gripper rests as it starts."""
        assumed, (_, R_WG) = self._assumed(), self.gripper_at_start()
        p_WG = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
        return ArmTarget(p_WG, R_WG, assumed.gains(), assumed.model(), self.fixed)
