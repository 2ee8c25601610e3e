"""A push against the gripper of a robot whose arm gives way, too. [Fernandes2020] sec. 3.3."""

from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.geometry import quaternion_of
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Experiment, FmuOf
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.free_flyer.places import PLACES_OF_ARM_PUSH
from handover.scenarios.robots.free_flyer.push.arm_evaluation import ArmImpedanceEvaluator
from handover.scenarios.robots.free_flyer.push.arm_parameters import ArmPushParameters
from handover.scenarios.robots.free_flyer.robot_wiring import PUSHES_WITH_JOINTS, wired_push


class FlyerArmImpedance(Experiment[ArmImpedanceEvaluator]):
    """One pulse of force or torque on the gripper; base and joints yield, and go back."""

    name: ClassVar[str] = "flyer_arm_impedance"
    title: ClassVar[str] = "a free-flyer yields to a push against its gripper with base and arm"
    parameters_type: ClassVar[type[ArmPushParameters]] = ArmPushParameters
    units: ClassVar[Mapping[str, str]] = {
        "impedance": "ArmImpedanceController",
        "thrusters": "Thrusters",
        "push": "Push",
        "robot": "FreeFlyer",
        "navigation": "Navigation",
    }
    places: ClassVar[Mapping[str, Place]] = PLACES_OF_ARM_PUSH
    headline: ClassVar[tuple[str, ...]] = (
        "greatest_position_error",
        "greatest_orientation_error",
        "base_displacement",
        "base_turn",
        "joint_motion",
        "thrust_impulse",
        "settling_time",
        "disagreement_position",
        "disagreement_orientation",
        "pole_margin_impedance",
        "cpu_per_cycle",
    )

    def build(self, parameters: ArmPushParameters, seed: int, fmu: FmuOf) -> System:
        """Wire robot, thrusters, navigation, controller and push; the gripper starts at its place of rest."""
        p, target = parameters, parameters.target()
        p_BG, R_BG = p.gripper_at_start()
        controller = {
            **p.controller(),
            "p_WG_goal": target.p_WG,
            "q_WG_goal": np.array([1.0, 0.0, 0.0, 0.0]) if p.fixed else quaternion_of(R_BG),
        }
        robot = {
            **vars(p.robot),
            **p.arm(p.arm_factor),
            "q_J_0": p.posture,
            "friction_J": np.full(3, p.friction),
            "p_WB_0": target.p_WG - p_BG,
        }
        s = wired_push(fmu, p, seed, controller, robot)
        arm, impedance = s.units["robot"], s.units["impedance"]
        for name in ("q_J", "v_J"):
            s.connect(getattr(arm.y, name), getattr(impedance.u, name))
        s.connect(impedance.y.tau_J_cmd, arm.u.tau_J)
        return s

    def stop_time(self, parameters: ArmPushParameters) -> Fraction:
        """Return the end of the push, plus the patience for the return to rest."""
        return parameters.stop

    def step_in_parallel(self, parameters: ArmPushParameters) -> Fraction:
        """Return the parameter's."""
        return parameters.step_in_parallel

    def evaluator(self, parameters: ArmPushParameters) -> ArmImpedanceEvaluator:
        """Return the evaluator of one push."""
        return ArmImpedanceEvaluator(parameters)

    def cycle(self) -> tuple[str, ...]:
        """Return the unit that runs on the robot's computer."""
        return ("impedance",)

    def time_figures(self, parameters: ArmPushParameters, record: Record) -> list[TimeFigure]:
        """Return errors actual and calculated, base and joints, push and thrust over time."""
        from handover.scenarios.robots.free_flyer.push.arm_plots import figures_of_arm_push

        return figures_of_arm_push(parameters, record)

    def pushes(self, parameters: ArmPushParameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return base and gripper; its links have no input of a force."""
        return PUSHES_WITH_JOINTS

    def replay(self, parameters: ArmPushParameters, record: Record) -> Replay:
        """Return base and links, the gripper's place of rest and the push in space."""
        from handover.scenarios.robots.free_flyer.push.arm_plots import replay_arm_push

        return replay_arm_push(parameters, record)
