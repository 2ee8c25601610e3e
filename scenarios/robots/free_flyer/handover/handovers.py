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

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.system import PortName, System
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.live_inputs import HandHint, LedHand, Pushable
from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.free_flyer.handover.handover_evaluation import HandoverEvaluator
from handover.scenarios.robots.free_flyer.handover.led_hand import faults_of_person, leader
from handover.scenarios.robots.free_flyer.parameters import Hand, HandoverParameters, Task, TaskParameters
from handover.scenarios.robots.free_flyer.penetration import start_faults
from handover.scenarios.robots.free_flyer.places import PLACES_OF_HANDOVER
from handover.scenarios.robots.free_flyer.published import published_of_giving, published_of_receiving
from handover.scenarios.robots.free_flyer.robot_wiring import (
    PUSHES,
    add_controllers,
    add_robot,
    check_reach,
    common_period,
    decision_settings,
    idle_values,
    undriven_joints,
    wire_handover,
)

_HOLD = np.array([0.0, 0.045, 0.0])
"""Where the middle of a hand that takes the object is best, seen from its centre, m: its fingers close on it there from
3 cm around (tried: 30 mm across the object to all sides, 55 mm and 25 mm along it)."""
_AROUND, _ALONG = 0.028, 0.024
_NEAR = 0.5
"""Distance from where the hand is to be, m, from which on its direction is shown."""
_NEEDED = (
    "person.holder",
    "person.p_WH",
    "person.p_WO",
    "person.q_WO",
    "person.closed_goal",
    "robot.p_WG",
    "robot.q_WG",
)


def hand_hint(record: Record, receivers: Sequence[str], thresholds: Mapping[str, float]) -> HandHint | None:
    """Return what helps in the last row of a record; None where it lacks outputs that this is made of.

    Args:
        record: of a handover.
        receivers: who is to have the object in turn, `HAND` or `GRIPPER`.
        thresholds: speed of the gripper from which the robot feels a pull or a push, by receiver, m/s.
    """
    if not all(name in record for name in _NEEDED):
        return None
    holder = record.items("person.holder").get(int(record["person.holder"][-1]), "")
    p_WH, closed = record["person.p_WH"][-1], bool(record["person.closed_goal"][-1])
    if receivers[0] == "HAND" and holder in ("GRIPPER", "BOTH"):
        return _taking(record, p_WH, holder, _felt(record, thresholds["HAND"]), closed=closed)
    if receivers[-1] == "GRIPPER" and holder in ("HAND", "BOTH"):
        return _giving(record, p_WH, holder, _felt(record, thresholds["GRIPPER"]))
    if holder == "HAND":
        return HandHint(p_WH, None, holds=True, advice="You have it: draw your hand back.")
    if holder == "GRIPPER":
        return HandHint(p_WH, None, advice="The gripper has it: open your hand, and draw it back.")
    return HandHint(p_WH, None, advice="The robot fetches the object." if receivers[0] == "HAND" else "")


def _felt(record: Record, threshold: float) -> str:
    """Return how fast the robot sees its gripper move, of what it needs to feel a pull or a push."""
    if "decision.speed_G" not in record:
        return ""
    return f": it moves at {float(record['decision.speed_G'][-1]):.3f} of {threshold:.3f} m/s"


def _taking(record: Record, p_WH: Floats, holder: str, felt: str, *, closed: bool) -> HandHint | None:
    if holder == "BOTH":
        return HandHint(p_WH, None, holds=True, advice=f"You hold it: pull until the gripper opens{felt}.")
    R_WO, p_WO = rotation_of(record["person.q_WO"][-1]), record["person.p_WO"][-1]
    goal = p_WO + R_WO @ _HOLD
    p_goal_H_O: Floats = (p_WH - goal) @ R_WO
    within = bool(np.hypot(p_goal_H_O[0], p_goal_H_O[2]) <= _AROUND and abs(p_goal_H_O[1]) <= _ALONG)
    if float(np.linalg.norm(goal - p_WH)) > _NEAR:
        return HandHint(p_WH, None, advice="The robot brings the object: once it waits, lead your hand there.")
    if closed:
        return HandHint(p_WH, goal, advice="Your hand closed on nothing: open it.")
    advice = "Within reach: after the yellow flash, close the hand." if within else "Lead your hand to the ring."
    return HandHint(p_WH, goal, within_reach=within, advice=advice)


def _giving(record: Record, p_WH: Floats, holder: str, felt: str) -> HandHint:
    if holder == "BOTH":
        return HandHint(p_WH, None, holds=True, advice="The gripper has it, too: open your hand.")
    person = PersonParams()
    half = 0.5 * float(np.array(person.object_size)[1])
    axis, p_WG = rotation_of(record["person.q_WO"][-1])[:, 1], record["robot.p_WG"][-1]
    p_WO = record["person.p_WO"][-1]
    to_gripper = p_WG - p_WO
    to_gripper -= float(np.clip(axis @ to_gripper, -half, half)) * axis  # from the nearest point of its centre line
    to_gripper_G: Floats = to_gripper @ rotation_of(record["robot.q_WG"][-1])
    within = bool(abs(to_gripper_G[0]) <= person.capture_axial and abs(to_gripper_G[2]) <= person.capture_lateral)
    if float(np.linalg.norm(to_gripper)) > _NEAR:
        return HandHint(p_WH, None, holds=True, advice="You hold the object: the robot comes to take it.")
    here, there = (
        f"Between the fingers: press it against the gripper{felt}.",
        "After the yellow flash, lead it to the ring.",
    )
    return HandHint(p_WH, p_WH + to_gripper, within_reach=within, holds=True, advice=here if within else there)


_FLIGHT = 120
"""Time for flying, fetching and retreating, without the waiting for the person, s (assumed)."""
_TAKE = (
    "The robot fetches an object and holds it out to you. Once its signal light has flashed yellow, close your hand on "
    "the object and pull until the gripper opens. "
)
_FLASH = "You hold an object, and the robot comes to take it. Once its signal light has flashed yellow, "
_GIVE = (
    "put the object between its fingers and press it against the gripper until that closes. Then open your hand and "
    "draw it back."
)


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
        "failed_deliveries",
        "arrival_error",
        "saturated_share",
        "pole_margin_impedance",
        "damping_ratio_impedance",
        "damping_ratio_pose",
        "cpu_per_cycle",
    )
    task: ClassVar[str]
    """The robot's task, an item of the decision unit's parameter."""
    person: ClassVar[Mapping[str, Any]]
    """What the person does and holds, by the parameters of the person's unit."""
    receivers: ClassVar[tuple[str, ...]]
    """Who is to have the object after each transfer, `HAND` or `GRIPPER`."""
    asked: ClassVar[str]
    """What is asked of who leads the hand."""
    failures: ClassVar[int] = 0
    """How many receptions the person is to feign."""

    def build(self, parameters: HandoverParameters, seed: int, fmu: FmuOf) -> System:
        """Wire robot, thrusters, navigation, controllers and person.

        Raises:
            InvalidParameter: the handover place is out of the person's reach, or the hand's track cannot be followed.
        """
        p = parameters
        check_reach(p.p_WG_handover, vars(PersonParams()))
        navigation_seed, person_seed = (int(n) for n in np.random.SeedSequence(seed).generate_state(2) >> 1)
        at = {name: np.array(value) for name, value in paper_values("free_flyer", "handover_place").items()}
        p_WO_0 = at["p_WO_0"]
        s = System()
        decision = decision_settings(p)
        s.add("decision", fmu("decision"), task=self.task, p_WO_0=p_WO_0, p_OG=at["p_OG"], **decision)
        add_controllers(s, fmu, p)
        step = common_period([s.units[name] for name in self.cycle()])
        add_robot(s, fmu, p, at["p_WG_0"], period=step, seed=navigation_seed)
        s.add(
            "person",
            fmu("person"),
            period=step,
            seed=person_seed,
            p_WO_0=p_WO_0,
            angle_0=float(at["angle_0"]),
            **p.traits,
            **self.person,
            **leader(p, float(self.stop_time(p))),
        )
        wire_handover(s)
        if led := self.led_hand(p):
            for name in (*led.inputs, led.age):
                s.external(PortName(*name.split(".")))
        return s

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject starts in each other, an arm that nothing drives, values without effect, and traits of no person.

        Raises:
            InvalidParameter: with all such values.
        """
        faults = undriven_joints(system) + idle_values(system, given) + faults_of_person(system, given)
        if faults := faults + start_faults(system.units):
            raise InvalidParameter(faults)

    def stop_time(self, parameters: HandoverParameters) -> Fraction:
        """Return the robot's patience for each signal that may be needed, plus time for flying."""
        waits = len(self.receivers) + self.failures
        if parameters.verify:  # a delivery that failed is repeated
            waits += int(DecisionParams().attempts) - 1
        return Fraction(round(1000 * parameters.patience), 1000) * waits + _FLIGHT

    def led_hand(self, parameters: HandoverParameters) -> LedHand | None:
        """Return the person's hand, if it comes from outside."""
        if parameters.hand is not Hand.OUTSIDE:
            return None
        person = vars(PersonParams())
        x, y, z = (float(n) for n in person["p_WH_0"])
        return LedHand("person", (x, y, z), float(person["arm_reach"]), self.asked)

    def hand_hint(self, parameters: HandoverParameters, record: Record) -> HandHint | None:
        """Return where the hand is to be, and what is to be done there."""
        return hand_hint(record, self.receivers, {name: parameters.threshold(name) for name in ("HAND", "GRIPPER")})

    def parameter_files(self, parameters: HandoverParameters) -> Mapping[str, Path]:
        """Return the track that leads the hand."""
        return {"hand_track": Path(parameters.hand_track)} if parameters.hand_track else {}

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
        from handover.scenarios.robots.free_flyer.figures import draw_scenes  # matplotlib is slow to import

        return draw_scenes(evaluator, record, folder)

    def time_figures(self, parameters: HandoverParameters, record: Record) -> list[TimeFigure]:
        """Return paths, the gripper, who holds the object, and thrust over time."""
        from handover.scenarios.robots.free_flyer.handover.handover_plots import figures_of_handover

        return figures_of_handover(parameters, record)

    def pushes(self, parameters: HandoverParameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return the robot."""
        return PUSHES

    def replay(self, parameters: HandoverParameters, record: Record) -> Replay:  # noqa: ARG002
        """Return robot, hand and object in space."""
        from handover.scenarios.robots.free_flyer.replay import replay_handover

        return replay_handover(record)


class Collaborative(FlyerHandover):
    """The person takes at the robot's first signal and gives at its second."""

    name: ClassVar[str] = "flyer_collaborative"
    title: ClassVar[str] = "a free-flyer gives an object to a person, waits, and takes it back"
    task: ClassVar[str] = "collaborative"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "motion_again": "give", "object_with": "free"}
    asked: ClassVar[str] = f"{_TAKE}The robot waits. Once its light has flashed again, {_GIVE}"
    receivers: ClassVar[tuple[str, ...]] = ("HAND", "GRIPPER")


class FailedReception(FlyerHandover):
    """The person pushes the gripper first and gives only at the robot's second signal."""

    name: ClassVar[str] = "flyer_failed_reception"
    title: ClassVar[str] = "a free-flyer closes its gripper on nothing, notices, and asks again"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "push", "motion_again": "give", "object_with": "hand"}
    asked: ClassVar[str] = (
        f"{_FLASH}push its gripper without the object between its fingers: it closes on nothing. Once the light has "
        f"flashed again, {_GIVE}"
    )
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)
    failures: ClassVar[int] = 1


class HumanToRobot(FlyerHandover):
    """The robot signals at the handover place, and closes its gripper as it feels the person push."""

    name: ClassVar[str] = "flyer_human_to_robot"
    title: ClassVar[str] = "a person gives an object to a free-flyer"
    task: ClassVar[str] = "human_to_robot"
    person: ClassVar[Mapping[str, Any]] = {"motion": "give", "object_with": "hand"}
    asked: ClassVar[str] = f"{_FLASH}{_GIVE}"
    receivers: ClassVar[tuple[str, ...]] = ("GRIPPER",)

    def published(self, parameters: HandoverParameters) -> Sequence[PublishedValue]:
        """Return the threshold of sec. 4.1.2."""
        return published_of_receiving(parameters)


class RobotToHuman(FlyerHandover):
    """The robot signals at the handover place, and opens its gripper as it feels the person pull."""

    name: ClassVar[str] = "flyer_robot_to_human"
    title: ClassVar[str] = "a free-flyer fetches an object and gives it to a person"
    task: ClassVar[str] = "robot_to_human"
    person: ClassVar[Mapping[str, Any]] = {"motion": "take", "motion_again": "take", "object_with": "free"}
    asked: ClassVar[str] = f"{_TAKE}Then draw your hand back with the object."
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
    """The parameter `task` chooses the way; each is a scenario of its own, too."""

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

    def led_hand(self, parameters: HandoverParameters) -> LedHand | None:
        """Return that of the task's scenario."""
        return _of_task(parameters).led_hand(parameters)

    def hand_hint(self, parameters: HandoverParameters, record: Record) -> HandHint | None:
        """Return that of the task's scenario."""
        return _of_task(parameters).hand_hint(parameters, record)

    def evaluator(self, parameters: HandoverParameters) -> HandoverEvaluator:
        """Return that of the task's scenario."""
        return _of_task(parameters).evaluator(parameters)

    def published(self, parameters: HandoverParameters) -> Sequence[PublishedValue]:
        """Return the published values of the task."""
        return _of_task(parameters).published(parameters)


def _of_task(parameters: HandoverParameters) -> FlyerHandover:
    return _OF_TASK[cast(TaskParameters, parameters).task]()
