"""Two free-flyers and a person with two hands hand a large object over, proposed by [Fernandes2020] sec. 6.3."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.cosim.record.reader import Record
from handover.cosim.system.system import System
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.free_flyer.parameters import ROBOTS, Hand, Hands, TeamParameters, TeamTask
from handover.scenarios.robots.free_flyer.penetration import start_faults
from handover.scenarios.robots.free_flyer.places import PLACES_OF_TEAM
from handover.scenarios.robots.free_flyer.robot_wiring import (
    PUSHES_OF_TEAM,
    add_controllers,
    add_robot,
    check_reach,
    common_period,
    decision_settings,
    idle_values,
    undriven_joints,
    wire_handover,
)
from handover.scenarios.robots.free_flyer.two_robots.team_evaluation import TeamEvaluator

_FLIGHT = 150
"""Time for flying, fetching and retreating, without the waiting for the person, s (assumed)."""
_TASKS: Mapping[TeamTask, tuple[str, Mapping[str, Any]]] = {
    TeamTask.ROBOTS_TO_HUMAN: ("robot_to_human", {"motion": "take", "object_with": "free"}),
    TeamTask.HUMAN_TO_ROBOTS: ("human_to_robot", {"motion": "give", "object_with": "hand"}),
}
"""The robots' task, and what the person does and holds."""


class TwoRobots(Experiment[TeamEvaluator]):
    """The robots fetch the object together, or take it from the person; each has its own navigation and controllers."""

    name: ClassVar[str] = "flyer_two_robots"
    title: ClassVar[str] = "two free-flyers and a person with two hands hand a large object over"
    parameters_type: ClassVar[type[TeamParameters]] = TeamParameters
    units: ClassVar[Mapping[str, str]] = {
        "decision": "HandoverTeam",
        **{f"impedance_{r}": "ImpedanceController" for r in ROBOTS},
        **{f"pose_{r}": "PoseController" for r in ROBOTS},
        **{f"thrusters_{r}": "Thrusters" for r in ROBOTS},
        "person": "LargeObjectAndHands",
        **{f"robot_{r}": "FreeFlyer" for r in ROBOTS},
        **{f"navigation_{r}": "Navigation" for r in ROBOTS},
    }
    places: ClassVar[Mapping[str, Place]] = PLACES_OF_TEAM
    headline: ClassVar[tuple[str, ...]] = (
        "time_to_release",
        "release_gap",
        "squeeze",
        "turn",
        "displacement_1",
        "displacement_2",
        "clearance",
        "transfer_time",
        "force",
        "failed_receptions",
        "failed_deliveries",
        "saturated_share",
        "cpu_per_cycle",
    )

    def build(self, parameters: TeamParameters, seed: int, fmu: FmuOf) -> System:
        """Wire both robots, their thrusters, navigations and controllers, the team's decision, and the person.

        Raises:
            InvalidParameter: the handover place is out of the person's reach, or a track is to lead the hands.
        """
        p, large = parameters, vars(LargeObjectParams())
        check_reach(p.p_WG_handover, {**large, "p_OH": _hold(p)["p_OH"]})
        if p.hand_track:
            raise InvalidParameter(["hand_track: a track leads one hand; here the person is simulated, leave it empty"])
        if p.hand is Hand.OUTSIDE:
            raise InvalidParameter(["hand: here the person is simulated and has two hands, leave it at simulated"])
        *navigation_seeds, person_seed = (int(n) for n in np.random.SeedSequence(seed).generate_state(3) >> 1)
        at = {name: np.array(value) for name, value in paper_values("free_flyer", "team_place").items()}
        task, motion = _TASKS[p.task]
        grips = {"p_OG": np.array(large["p_OG"]), "grip_spacing": float(large["grip_spacing"])}
        s = System()
        s.add(
            "decision",
            fmu("decision"),
            task=task,
            p_WO_0=at["p_WO_0"],
            **grips,
            **decision_settings(p),
        )
        for r in ROBOTS:
            add_controllers(s, fmu, p, f"_{r}")
        step = common_period([s.units[name] for name in self.cycle()])
        for r, navigation_seed in zip(ROBOTS, navigation_seeds, strict=True):
            add_robot(s, fmu, p, at[f"p_WG_0_{r}"], period=step, seed=navigation_seed, suffix=f"_{r}")
        s.add(
            "person",
            fmu("person"),
            period=step,
            seed=person_seed,
            p_WO_0=at["p_WO_0"],
            angle_0=float(at["angle_0"]),
            **p.traits,
            **grips,
            **motion,
            **_hold(p),
        )
        for r in ROBOTS:
            wire_handover(s, f"_{r}")
        return s

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject starts in each other, an arm that nothing drives, and values without effect.

        Raises:
            InvalidParameter: with all such values.
        """
        if faults := undriven_joints(system) + idle_values(system, given) + start_faults(system.units):
            raise InvalidParameter(faults)

    def stop_time(self, parameters: TeamParameters) -> Fraction:
        """Return the robots' patience for each signal that may be needed, plus time for flying."""
        repeats = parameters.verify or parameters.task is TeamTask.HUMAN_TO_ROBOTS
        waits = int(DecisionParams().attempts) if repeats else 1
        return Fraction(round(1000 * parameters.patience), 1000) * waits + _FLIGHT

    def evaluator(self, parameters: TeamParameters) -> TeamEvaluator:
        """Return the evaluator of one handover."""
        return TeamEvaluator(parameters)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robots' computers: decision and controllers."""
        return ("decision", *(f"{what}_{r}" for r in ROBOTS for what in ("impedance", "pose")))

    def draw(self, parameters: TeamParameters, evaluator: TeamEvaluator, record: Record, folder: Path) -> list[Figure]:
        """Draw the scene at the start, the signal, the transfer and the end."""
        from handover.scenarios.robots.free_flyer.two_robots.team_plots import draw_team  # matplotlib is slow to import

        return draw_team(parameters, evaluator, record, folder)

    def time_figures(self, parameters: TeamParameters, record: Record) -> list[TimeFigure]:
        """Return paths, forces, who holds the object, grippers, speeds, and thrust over time."""
        from handover.scenarios.robots.free_flyer.two_robots.team_plots import figures_of_team

        return figures_of_team(parameters, record)

    def pushes(self, parameters: TeamParameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return both robots."""
        return PUSHES_OF_TEAM

    def replay(self, parameters: TeamParameters, record: Record) -> Replay:
        """Return robots, hands and object in space."""
        from handover.scenarios.robots.free_flyer.replay import replay_team

        return replay_team(parameters, record)


def _hold(p: TeamParameters) -> dict[str, Any]:
    """Return with how many hands the person holds the object, and where, as parameters of the person's unit."""
    large = vars(LargeObjectParams())
    p_OH = np.array(large["p_OH"])
    if p.hands is Hands.TWO:
        return {"hands": 2, "p_OH": p_OH}
    end = np.array([0.0, 0.5 * float(large["hand_spacing"]), 0.0])
    return {"hands": 1, "p_OH": p_OH + end if p.hands is Hands.ONE_AT_END else p_OH}
