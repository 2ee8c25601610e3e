"""A push against the gripper, and the robot's yielding to it. [Fernandes2020] sec. 4.1.3."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.free_flyer.parameters import ImpedanceParameters
from handover.scenarios.robots.free_flyer.places import PLACES_OF_PUSH
from handover.scenarios.robots.free_flyer.published import published_of_push
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import ImpedanceEvaluator
from handover.scenarios.robots.free_flyer.robot_wiring import PUSHES, idle_values, undriven_joints, wired_push


class FlyerImpedance(Experiment[ImpedanceEvaluator]):
    """The thesis's validation of the impedance control: one pulse of force or torque, and the return to rest."""

    name: ClassVar[str] = "flyer_impedance"
    title: ClassVar[str] = "a free-flyer yields to a push against its gripper and comes back"
    parameters_type: ClassVar[type[ImpedanceParameters]] = ImpedanceParameters
    units: ClassVar[Mapping[str, str]] = {
        "impedance": "ImpedanceController",
        "thrusters": "Thrusters",
        "push": "Push",
        "robot": "FreeFlyer",
        "navigation": "Navigation",
    }
    places: ClassVar[Mapping[str, Place]] = PLACES_OF_PUSH
    headline: ClassVar[tuple[str, ...]] = (
        "greatest_position_error",
        "greatest_orientation_error",
        "settling_time",
        "disagreement_position",
        "disagreement_orientation",
        "saturated_share",
        "pole_margin_impedance",
        "damping_ratio_impedance",
        "frequency_impedance",
        "cpu_per_cycle",
    )

    def build(self, parameters: ImpedanceParameters, seed: int, fmu: FmuOf) -> System:
        """Wire robot, thrusters, navigation, impedance controller and push; the gripper starts at its place of rest."""
        p_WG, robot = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"]), parameters.robot
        controller = {
            "behaviour": parameters.behaviour.item,
            **vars(parameters.model),
            "p_WG_goal": p_WG,
            "q_WG_goal": np.array([1.0, 0.0, 0.0, 0.0]),
        }
        return wired_push(fmu, parameters, seed, controller, {**vars(robot), "p_WB_0": p_WG - robot.p_BG})

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject an arm that nothing drives, and values without effect.

        Raises:
            InvalidParameter: with all such values.
        """
        if faults := undriven_joints(system) + idle_values(system, given):
            raise InvalidParameter(faults)

    def stop_time(self, parameters: ImpedanceParameters) -> Fraction:
        """Return the end of the push, plus the patience for the return to rest."""
        return parameters.stop

    def step_in_parallel(self, parameters: ImpedanceParameters) -> Fraction:
        """Return the parameter's."""
        return parameters.step_in_parallel

    def evaluator(self, parameters: ImpedanceParameters) -> ImpedanceEvaluator:
        """Return the evaluator of one push."""
        return ImpedanceEvaluator(parameters)

    def cycle(self) -> tuple[str, ...]:
        """Return the unit that runs on the robot's computer."""
        return ("impedance",)

    def published(self, parameters: ImpedanceParameters) -> Sequence[PublishedValue]:
        """Return the published bounds of the difference between robot and impedance model."""
        return published_of_push(parameters)

    def draw(
        self, parameters: ImpedanceParameters, evaluator: ImpedanceEvaluator, record: Record, folder: Path
    ) -> list[Figure]:
        """Draw the scene at three moments."""
        from handover.scenarios.robots.free_flyer.figures import draw_moments  # matplotlib is slow to import

        return [draw_moments(evaluator.errors(), parameters, record, folder)]

    def time_figures(self, parameters: ImpedanceParameters, record: Record) -> list[TimeFigure]:
        """Return errors actual and calculated, push and thrust over time."""
        from handover.scenarios.robots.free_flyer.push.push_plots import figures_of_push

        return figures_of_push(parameters, record)

    def pushes(self, parameters: ImpedanceParameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return the robot."""
        return PUSHES

    def replay(self, parameters: ImpedanceParameters, record: Record) -> Replay:
        """Return the robot, its gripper's place of rest and the push in space."""
        from handover.scenarios.robots.free_flyer.replay import replay_push

        return replay_push(parameters, record)
