"""Parameters of the free-flyer's handovers, and of a push against its gripper."""

import enum
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any

import numpy as np

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.controllers.free_flyer.handover_team import Params as TeamDecisionParams
from handover.cosim.blocks.origins import Origin, assumed, derived, stated
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.units import Newton, NewtonMetre, Number, Second
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.plants.free_flyer.robot.free_flyer import Params as RobotParams
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.plants.free_flyer.robot.push import Params as PushParams
from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.needs import any_of, being, parameter
from handover.scenarios.experiment.paper import paper_values

ROBOTS = ("1", "2")
"""Numbers of two robots, by which the names of their units and ports end."""

_UNSKILLED_ERRORS = 8.0
"""Errors of sight, timing and effort at skill 0, over those at skill 1 (assumed)."""
_HASTE = 0.3
"""Share of attempts at skill 0 in which the person does not wait for the gripper (assumed)."""
_YIELDING = 1.5
"""Force at which the person's arm yields, over the strength of a pull (assumed)."""
_SCALED = ("timing_error", "effort_spread", "reaction_time")


class _OfUnit(enum.IntEnum):
    """An enumeration whose items have, in texts and in the units, names in lower case."""

    @property
    def item(self) -> str:
        """The item's name in the units' enumerations."""
        return self.name.lower()


class Behaviour(_OfUnit):
    """Settings of the impedance controller: how the robot yields to a push. [Fernandes2020] table 4.1."""

    RIGID = 0
    COMPLIANT = 1


class Propulsion(_OfUnit):
    """How the thrusters follow their commands: ideal ones have neither limits nor lag, nozzles share what there is."""

    IDEAL = 0
    LIMITED = 1
    NOZZLES = 2


class Hand(_OfUnit):
    """Who moves the person's hand: a simulated person, or somebody outside the simulation, such as its watcher."""

    SIMULATED = 0
    OUTSIDE = 1


_SIMULATED_PERSON = (being("hand", Hand.SIMULATED), being("hand_track", ""))
"""What a person's skill and senses need; strength is also the force at which any arm yields."""


@dataclass(frozen=True)
class Body:
    """Mass, kg, inertia about the centre of mass, (3, 3), kg m^2, and gripper seen from it, m, both in B."""

    mass: float
    I_B: Floats
    p_BG: Floats


def _factor(of_what: str, origin: Origin) -> float:
    return parameter(1.0, f"{of_what}, times the public value", minimum=0.2, maximum=5.0, origin=origin)


def _of_each(path: str) -> tuple[str, ...]:
    """Return the path of a robot's unit, and those of two robots' units."""
    unit, _, name = path.partition(".")
    return (path, *(f"{unit}_{r}.{name}" for r in ROBOTS))


_AS_PUBLISHED = assumed("the robot is as published")
_READ_BY_THE_CONTROLLER = assumed("sec. 4.1.2: the controller reads mass and inertia from the robot's own topic")


@dataclass(frozen=True, kw_only=True)
class RobotAndModel:
    """What the robot is, and what its controllers take it for: each times the public values."""

    mass_factor: Number = _factor("robot's mass", _AS_PUBLISHED)
    inertia_factor: Number = _factor("robot's inertia", _AS_PUBLISHED)
    arm_factor: Number = _factor("length of the robot's arm", assumed("the arm is as long as assumed"))
    model_mass_factor: Number = _factor("mass that the robot's controllers assume", _READ_BY_THE_CONTROLLER)
    model_inertia_factor: Number = _factor("inertia that the robot's controllers assume", _READ_BY_THE_CONTROLLER)
    model_arm_factor: Number = _factor("length of the arm that the robot's controllers assume", _READ_BY_THE_CONTROLLER)
    stuck_nozzle: int = parameter(
        0,
        "which of twelve nozzles is stuck closed, unknown to the robot; 0: none",
        minimum=0,
        maximum=12,
        origin=assumed("all nozzles are whole"),
        needs=(being("propulsion", Propulsion.NOZZLES),),
    )

    @property
    def robot(self) -> Body:
        """The robot as it is."""
        return _body(self.mass_factor, self.inertia_factor, self.arm_factor)

    @property
    def model(self) -> Body:
        """The robot as its controllers assume it to be."""
        return _body(self.model_mass_factor, self.model_inertia_factor, self.model_arm_factor)

    @property
    def is_published(self) -> bool:
        """Whether robot and model are as published."""
        return all(getattr(self, f.name) == f.default for f in fields(RobotAndModel))


def _body(mass: float, inertia: float, arm: float) -> Body:
    public = vars(RobotParams())
    return Body(mass * float(public["mass"]), inertia * np.array(public["I_B"]), arm * np.array(public["p_BG"]))


@dataclass(frozen=True, kw_only=True)
class HandoverParameters(RobotAndModel):
    """One handover. Bounds of the place keep it within the person's and the robot's part of the cabin (assumed)."""

    behaviour: Behaviour = parameter(
        Behaviour.RIGID, "setting of the impedance controller, [Fernandes2020] table 4.1", origin=stated("table 4.1")
    )
    p_WG_handover: Floats = expose(
        DecisionParams,
        "decision.p_WG_handover",
        minimum=-1.0,
        maximum=1.0,
        description="where the gripper waits for the person, in W",
    )
    strength: Newton = parameter(
        4.0,
        "force with which the person pulls; with half of it, pushes",
        minimum=0.1,
        maximum=20.0,
        origin=assumed(
            "not given: with ideal thrust it moves the rigid robot by about the 40 mm of sec. 4.3.1, "
            "which it was chosen for"
        ),
    )
    hand: Hand = parameter(
        Hand.SIMULATED,
        "who moves the person's hand: a simulated person, or inputs from outside, as of the page of --live",
        origin=assumed("sec. 4.2: hands of users lead it; without one at hand, a simulated person"),
    )
    hand_track: str = parameter(
        "",
        "file of a recorded track that leads the hand, of `handover flyer-track`; empty: a simulated person. A track "
        "reacts to nothing, neither to the light nor to the robot",
        origin=assumed("sec. 4.2: hands of users lead it, whose tracks are not given"),
    )
    skill: Number = parameter(
        1.0,
        "the person's skill. At 0, errors of sight, timing and effort are eight times as large. Reactions take "
        "twice the time; the person does not wait for the gripper in three of ten attempts",
        minimum=0.0,
        maximum=1.0,
        origin=assumed(
            "not given; the participants had little or no practice (sec. 5.4) and failed in 0 to 15 of 100 (sec. 5.8)"
        ),
        needs=_SIMULATED_PERSON,
    )
    sight_error: float = expose(PersonParams, "person.sight_error", maximum=0.1, needs=_SIMULATED_PERSON)
    depth_error: float = expose(PersonParams, "person.depth_error", maximum=0.1, needs=_SIMULATED_PERSON)
    interface_delay: float = expose(PersonParams, "person.interface_delay", maximum=2.0, needs=_SIMULATED_PERSON)
    propulsion: Propulsion = parameter(
        Propulsion.LIMITED,
        "what the thrusters are like",
        origin=assumed("the handovers are possible within Astrobee's limits"),
    )
    delay: float = expose(ThrustersParams, *_of_each("thrusters.delay"), maximum=0.2)
    gradual: bool = expose(
        DecisionParams,
        "decision.gradual",
        "person.grip_fades",
        description="whether the fingers follow pull and push, and their grip fades as they open",
    )
    verify: bool = expose(DecisionParams, "decision.verify")
    navigation_delay: float = expose(
        NavigationParams,
        *_of_each("navigation.delay"),
        maximum=0.2,
        description="age of the estimate of the robot's pose and velocities. Controllers know it, and refuse one with "
        "which they would be unstable; for one that they do not know, set navigation.delay",
    )
    gated: bool = expose(DecisionParams, "decision.gated")
    patience: float = expose(DecisionParams, "decision.patience", minimum=1.0, maximum=600.0)

    @property
    def is_led(self) -> bool:
        """Whether a track or inputs from outside lead the hand, whose wishes nobody can know but from its poses."""
        return bool(self.hand_track) or self.hand is Hand.OUTSIDE

    def threshold(self, receiver: str) -> float:
        """Return the speed above which the robot feels a pull by a `HAND`, or a push at its `GRIPPER`, m/s."""
        return float(paper_values("free_flyer", "published")[f"velocity_{receiver.lower()}"][self.behaviour])

    @property
    def traits(self) -> dict[str, Any]:
        """Parameters of the person's unit that follow from strength and skill (assumed)."""
        worse = _UNSKILLED_ERRORS + (1.0 - _UNSKILLED_ERRORS) * self.skill
        skilled = {name: float(value) for name, value in vars(PersonParams()).items() if name in _SCALED}
        return {
            "effort": self.strength,
            "arm_force_max": _YIELDING * self.strength,
            "sight_error": worse * self.sight_error,
            "depth_error": worse * self.depth_error,
            "timing_error": worse * skilled["timing_error"],
            "effort_spread": worse * skilled["effort_spread"],
            "haste": _HASTE * (1.0 - self.skill),
            "reaction_time": (2.0 - self.skill) * skilled["reaction_time"],
        }


class Task(_OfUnit):
    """The four handovers."""

    ROBOT_TO_HUMAN = 0
    HUMAN_TO_ROBOT = 1
    FAILED_RECEPTION = 2
    COLLABORATIVE = 3


@dataclass(frozen=True, kw_only=True)
class TaskParameters(HandoverParameters):
    """One handover of any kind."""

    task: Task = parameter(
        Task.ROBOT_TO_HUMAN,
        "which of the four handovers",
        origin=assumed("not given: the first of the handovers of sec. 4.3"),
    )


class TeamTask(_OfUnit):
    """The two handovers of two robots."""

    ROBOTS_TO_HUMAN = 0
    HUMAN_TO_ROBOTS = 1


class Hands(_OfUnit):
    """With which hands the person holds a large object, and where."""

    TWO = 0
    ONE_AT_MIDDLE = 1
    ONE_AT_END = 2


@dataclass(frozen=True, kw_only=True)
class TeamParameters(HandoverParameters):
    """One handover of a large object by two robots, which are alike."""

    task: TeamTask = parameter(
        TeamTask.ROBOTS_TO_HUMAN, "who gives the object to whom", origin=assumed("sec. 4.3.1: the first of the two")
    )
    p_WG_handover: Floats = expose(
        TeamDecisionParams,
        "decision.p_WG_handover",
        minimum=-1.0,
        maximum=1.0,
        description="where the middle between the grippers waits for the person, in W",
    )
    strength: float = expose(
        HandoverParameters,
        "strength",
        description="force with which each hand of the person pulls; with half of it, pushes",
    )
    hand: Hand = expose(
        HandoverParameters, "hand", description="who moves the person's hands: here a simulated person alone"
    )
    hand_track: str = expose(HandoverParameters, "hand_track", description="always empty here: a track leads one hand")
    hands: Hands = parameter(
        Hands.TWO, "with which hands the person holds the object, and where", origin=derived("sec. 6.3: both hands")
    )
    hand_delay: float = expose(LargeObjectParams, "person.hand_delay", maximum=5.0, needs=(being("hands", Hands.TWO),))
    together: bool = expose(TeamDecisionParams, "decision.together")
    object_mass: float = expose(LargeObjectParams, "person.object_mass", minimum=0.1, maximum=50.0)

    @property
    def hand_numbers(self) -> tuple[str, ...]:
        """Numbers of the hands that the person uses, by which the names of their signals end."""
        return ("1", "2") if self.hands is Hands.TWO else ("1",)


class Axis(enum.IntEnum):
    """The axis of W along or about which the gripper is pushed."""

    X = 0
    Y = 1
    Z = 2


class Wrench(enum.IntEnum):
    """Whether the gripper is pushed along an axis or twisted about it."""

    FORCE = 0
    TORQUE = 1


@dataclass(frozen=True, kw_only=True)
class ImpedanceParameters(RobotAndModel):
    """One push."""

    behaviour: Behaviour = expose(HandoverParameters, "behaviour")
    kind: Wrench = parameter(
        Wrench.FORCE, "whether the gripper is pushed or twisted", origin=stated("sec. 4.1.3: forces and torques")
    )
    axis: Axis = parameter(Axis.X, "axis of W of the push", origin=stated("figs. 4.5-4.16: each axis"))
    force: float = expose(PushParams, "push.force", minimum=-50.0, maximum=50.0, needs=(being("kind", Wrench.FORCE),))
    torque: NewtonMetre = parameter(
        3.0,
        "torque of a twist",
        minimum=-10.0,
        maximum=10.0,
        origin=stated("figs. 4.8-4.10, 4.14-4.16"),
        needs=(being("kind", Wrench.TORQUE),),
    )
    begin: float = expose(PushParams, "push.start", maximum=60.0)
    duration: float = expose(PushParams, "push.duration", maximum=60.0)
    propulsion: Propulsion = expose(
        HandoverParameters,
        "propulsion",
        start=Propulsion.IDEAL,
        description="what the thrusters are like; the published plots need ideal ones",
        origin=derived("from the plots of sec. 4.1.3: with Astrobee's limits the robot tumbles at 3 N m"),
    )
    delay: float = expose(HandoverParameters, "delay")
    navigation_delay: float = expose(
        HandoverParameters,
        "navigation_delay",
        description="age of the estimate of the robot's pose and velocities, which the controller expects if "
        "delay_known",
    )
    delay_known: bool = parameter(
        True,
        "whether the controller knows both delays, and rejects ones it is unstable with",
        origin=assumed("delays that are known are part of the controller's stability check"),
        needs=(any_of("delay", "navigation_delay"),),
    )
    patience: float = expose(
        HandoverParameters, "patience", description="time after the push by which the robot must rest"
    )
    parallel_step: Second = parameter(
        0.002,
        "communication step in a host that steps all units in parallel (Jacobi)",
        minimum=0.0005,
        maximum=0.016,
        origin=assumed("numerical: both behaviours are stable with the three delays by it that parallel steps bring"),
    )

    @property
    def end(self) -> float:
        """Time at which the push ends, s."""
        return self.begin + self.duration

    @property
    def step_in_parallel(self) -> Fraction:
        """The communication step where all units step in parallel, exactly as it is printed, s."""
        return Fraction(repr(self.parallel_step))

    @property
    def stop(self) -> Fraction:
        """Time at which a run ends at the latest, in seconds."""
        return Fraction(round((self.end + self.patience) * 1000), 1000)
