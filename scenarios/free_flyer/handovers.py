"""A free-flyer and a person pass an object to each other: four handovers, and what they have in common.

- `RobotToHuman`: the robot fetches an object and lets go when the person pulls. [Fernandes2020] sec. 4.3.1.
- `HumanToRobot`: a person puts an object into the gripper, which closes when it is pushed. Sec. 4.3.2.
- `FailedReception`: a push without the object: the robot finds its gripper empty and asks again. Sec. 3.2.2, 4.3.2.
- `Collaborative`: the robot gives an object, waits, and takes it back: it holds things for a person. Sec. 5.5, T3.

`HandoverOfTask` is any of them, by a parameter: for campaigns in which they stand beside each other.
"""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.plants.free_flyer.hand.hand_track import InvalidTrack, read_track
from handover.plants.free_flyer.hand.parameters import Params
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.free_flyer.handover_evaluation import HandoverEvaluator
from handover.scenarios.free_flyer.parameters import HandoverParameters, Task, TaskParameters
from handover.scenarios.free_flyer.places import PLACES_OF_HANDOVER
from handover.scenarios.free_flyer.published import published_of_giving, published_of_receiving
from handover.scenarios.free_flyer.robot_wiring import common_period, expected_lag, thruster_settings, wire_handover

_FLIGHT = 120
"""Time for flying, fetching and retreating, without the waiting for the person, s (assumed)."""


class FlyerHandover(Experiment[HandoverEvaluator]):
    """Subclasses say what the robot is to do, what the person does, and who is to have the object in turn."""

    parameters_type: ClassVar[type[HandoverParameters]] = HandoverParameters
    units: ClassVar[Mapping[str, str]] = {
        "decision": "HandoverStateMachine",
        "impedance": "ImpedanceController",
        "pose": "PoseController",
        "thrusters": "Thrusters",
        "person": "HandAndObject",
        "robot": "FreeFlyer",
        "navigation": "Navigation",
    }
    places: ClassVar[Mapping[str, Place]] = PLACES_OF_HANDOVER
    headline: ClassVar[tuple[str, ...]] = (
        "transfer_time",
        "transfer_speed",
        "transfer_displacement",
        "return_time",
        "return_speed",
        "return_displacement",
        "failed_receptions",
        "arrival_error",
        "saturated_share",
        "pole_margin_impedance",
        "damping_ratio_impedance",
        "slowest_decay_pose",
        "damping_ratio_pose",
        "cpu_per_cycle",
    )
    task: ClassVar[str]
    """The robot's task, an item of the decision unit's parameter."""
    person: ClassVar[Mapping[str, Any]]
    """What the person does and holds, by the parameters of the person's unit."""
    receivers: ClassVar[tuple[str, ...]]
    """Who is to have the object after each transfer, `HAND` or `GRIPPER`."""
    failures: ClassVar[int] = 0
    """How many receptions the person is to feign."""

    def build(self, parameters: HandoverParameters, seed: int, fmu: FmuOf) -> System:
        """Wire robot, thrusters, navigation, controllers and person.

        Raises:
            InvalidParameter: the handover place is out of the person's reach, or the hand's track cannot be followed.
        """
        p = parameters
        _check_reach(p.p_WG_handover)
        navigation_seed, person_seed = (int(n) for n in np.random.SeedSequence(seed).generate_state(2) >> 1)
        at = {name: np.array(value) for name, value in paper_values("free_flyer", "handover_place").items()}
        p_WO_0, behaviour = at["p_WO_0"], p.behaviour.item
        robot, model, lag = p.robot, vars(p.model), expected_lag(p.propulsion)
        delay = p.delay + p.navigation_delay
        s = System()
        s.add(
            "decision",
            fmu("decision"),
            task=self.task,
            behaviour=behaviour,
            p_BG=p.model.p_BG,
            p_WG_handover=p.p_WG_handover,
            p_WO_0=p_WO_0,
            p_OG=at["p_OG"],
            gated=p.gated,
            gradual=p.gradual,
            patience=p.patience,
        )
        s.add("impedance", fmu("impedance"), behaviour=behaviour, **model, delay=delay, lag=lag)
        s.add("pose", fmu("pose"), **model, delay=delay, lag=lag)
        step = common_period([s.units[name] for name in self.cycle()])
        s.add("thrusters", fmu("thrusters"), period=step, **thruster_settings(p.propulsion, p.delay, p.stuck_nozzle))
        s.add("robot", fmu("robot"), period=step, **vars(robot), p_WB_0=at["p_WG_0"] - robot.p_BG)
        s.add("navigation", fmu("navigation"), period=step, seed=navigation_seed, delay=p.navigation_delay)
        s.add(
            "person",
            fmu("person"),
            period=step,
            seed=person_seed,
            p_WO_0=p_WO_0,
            angle_0=float(at["angle_0"]),
            **p.traits,
            grip_fades=p.gradual,
            **self.person,
            **_leader(p.hand_track),
        )
        wire_handover(s)
        return s

    def stop_time(self, parameters: HandoverParameters) -> Fraction:
        """Return the robot's patience for each signal, plus time for flying."""
        waits = len(self.receivers) + self.failures
        return Fraction(round(1000 * parameters.patience), 1000) * waits + _FLIGHT

    def evaluator(self, parameters: HandoverParameters) -> HandoverEvaluator:
        """Return the evaluator of one handover."""
        return HandoverEvaluator(parameters, self.receivers, self.failures)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robot's computer: decision and controllers."""
        return ("decision", "impedance", "pose")

    def draw(
        self,
        parameters: HandoverParameters,  # noqa: ARG002
        evaluator: HandoverEvaluator,
        record: Record,
        folder: Path,
    ) -> list[Figure]:
        """Draw the scene at three moments, and the transfers from near."""
        from handover.scenarios.free_flyer.figures import draw_scenes  # matplotlib is slow to import

        return draw_scenes(evaluator, record, folder)

    def time_figures(self, parameters: HandoverParameters, record: Record) -> list[TimeFigure]:
        """Return paths, the gripper, who holds the object, and thrust over time."""
        from handover.scenarios.free_flyer.plots import figures_of_handover

        return figures_of_handover(parameters, record)

    def replay(self, parameters: HandoverParameters, record: Record) -> Replay:  # noqa: ARG002
        """Return robot, hand and object in space."""
        from handover.scenarios.free_flyer.replay import replay_handover

        return replay_handover(record)


def _leader(track: str) -> dict[str, Any]:
    """Return what leads the hand, as the parameters of the person's unit: none of them if it is a simulated person.

    The file's path is absolute, since a unit may run in another folder.

    Raises:
        InvalidParameter: the track cannot be followed.
    """
    if not track:
        return {}
    path = Path(track).absolute()
    try:
        read_track(path, Params().age_max)
    except InvalidTrack as e:
        raise InvalidParameter([f"hand_track: {fault}" for fault in e.faults]) from e
    return {"driven_by": "track", "track": str(path)}


def _check_reach(p_WG: Floats) -> None:
    """Reject a handover place where the person could not reach the object's other end.

    Raises:
        InvalidParameter: it is one.
    """
    person = {name: np.array(value) for name, value in paper_values("free_flyer", "person").items()}
    p_WH = p_WG + person["p_OH"] - person["p_OG"]
    distance, reach = float(np.linalg.norm(p_WH - person["p_WH_0"])), float(person["arm_reach"])
    if distance > reach:
        place = ", ".join(f"{x:g}" for x in p_WG)
        text = f"the hand would be {distance:.2f} m from where it rests, and can be {reach:g} m from it"
        raise InvalidParameter([f"p_WG_handover: [{place}] m is out of the person's reach: {text}"])


class Collaborative(FlyerHandover):
    """The person takes at the robot's first signal and gives at its second."""

    name: ClassVar[str] = "flyer_collaborative"
    title: ClassVar[str] = "a free-flyer gives an object to a person, waits, and takes it back"
    task: ClassVar[str] = "collaborative"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "motion_again": "give", "object_with": "free"}
    receivers: ClassVar[tuple[str, ...]] = ("HAND", "GRIPPER")


class FailedReception(FlyerHandover):
    """The person pushes the gripper first and gives only at the robot's second signal."""

    name: ClassVar[str] = "flyer_failed_reception"
    title: ClassVar[str] = "a free-flyer closes its gripper on nothing, notices, and asks again"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "push", "motion_again": "give", "object_with": "hand"}
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)
    failures: ClassVar[int] = 1


class HumanToRobot(FlyerHandover):
    """The person gives, the robot takes."""

    name: ClassVar[str] = "flyer_human_to_robot"
    title: ClassVar[str] = "a person gives an object to a free-flyer"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "give", "object_with": "hand"}
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)

    def published(self, parameters: HandoverParameters) -> Sequence[PublishedValue]:
        """Return the threshold of sec. 4.1.2."""
        return published_of_receiving(parameters)


class RobotToHuman(FlyerHandover):
    """The robot gives, the person takes."""

    name: ClassVar[str] = "flyer_robot_to_human"
    title: ClassVar[str] = "a free-flyer fetches an object and gives it to a person"
    task: ClassVar[str] = "robot_to_human"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "object_with": "free"}
    receivers: ClassVar[tuple[str, ...]] = ("HAND",)

    def published(self, parameters: HandoverParameters) -> Sequence[PublishedValue]:
        """Return the values of sec. 4.1.2 and 4.3."""
        return published_of_giving(parameters)


_OF_TASK: Mapping[Task, type[FlyerHandover]] = {
    Task.ROBOT_TO_HUMAN: RobotToHuman,
    Task.HUMAN_TO_ROBOT: HumanToRobot,
    Task.FAILED_RECEPTION: FailedReception,
    Task.COLLABORATIVE: Collaborative,
}


class HandoverOfTask(FlyerHandover):
    """One of the four, by the parameter `task`."""

    name: ClassVar[str] = "flyer_handover"
    title: ClassVar[str] = "a free-flyer and a person hand an object over, in one of the four ways"
    parameters_type: ClassVar[type[HandoverParameters]] = TaskParameters

    def build(self, parameters: HandoverParameters, seed: int, fmu: FmuOf) -> System:
        """Wire the task's scenario.

        Raises:
            InvalidParameter: the handover place is out of the person's reach, or the hand's track cannot be followed.
        """
        return _of_task(parameters).build(parameters, seed, fmu)

    def stop_time(self, parameters: HandoverParameters) -> Fraction:
        """Return that of the task's scenario."""
        return _of_task(parameters).stop_time(parameters)

    def evaluator(self, parameters: HandoverParameters) -> HandoverEvaluator:
        """Return that of the task's scenario."""
        return _of_task(parameters).evaluator(parameters)

    def published(self, parameters: HandoverParameters) -> Sequence[PublishedValue]:
        """Return the published values of the task."""
        return _of_task(parameters).published(parameters)


def _of_task(parameters: HandoverParameters) -> FlyerHandover:
    return _OF_TASK[cast(TaskParameters, parameters).task]()
