"""Evaluates a handover between two robots and a person by ground truth, which the robots' computers do not see.

What became of each robot, `OneRobot`, and why a handover by two failed, `TeamCause`.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    Vector,
    angle_between,
    dot,
    inverse_rotate,
    norm,
    quaternion,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.robots.free_flyer.handover.handover_evaluation import (
    counted_failures,
    not_over,
    within_patience,
)
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.model_mismatch import model_mismatch
from handover.scenarios.robots.free_flyer.parameters import ROBOTS, TeamParameters, TeamTask
from handover.scenarios.robots.free_flyer.penetration import HandInCube


class TeamCause(enum.IntEnum):
    """Why a handover by two robots failed, for counting; the reason says it in words.

    Causes that a handover by one robot has, too, have its numbers; the others have numbers above all of its.
    """

    NONE = Cause.NONE
    NOT_FETCHED = Cause.NOT_FETCHED
    OUT_OF_REACH = Cause.OUT_OF_REACH
    NOT_FELT = Cause.NOT_FELT
    RELEASED_UNHELD = Cause.RELEASED_UNHELD
    LET_GO_EARLY = Cause.LET_GO_EARLY
    RECEPTIONS_FAILED = Cause.RECEPTIONS_FAILED
    DELIVERIES_FAILED = Cause.DELIVERIES_FAILED
    OUT_OF_TIME = Cause.OUT_OF_TIME
    OTHER = Cause.OTHER
    TORN_OUT = Cause.TORN_OUT
    ONE_HAND_HELD = 101
    ONE_LET_GO_ALONE = 102
    ONE_RECEIVED_ALONE = 103
    RAN_INTO_IT = 105

    @property
    def words(self) -> str:
        """The cause in plain words."""
        return self.name.lower().replace("_", " ")


@dataclass
class OneRobot:
    """What became of one robot of the team.

    Attributes:
        phases: its phases and when they began, s.
        signalled: when it first gave its signal, s; None before.
        asked: when it last did, s; later than `signalled` after a failed reception or delivery.
        felt: when it felt a person's pull or push since it last signalled, s; None before.
        fastest: greatest speed by which it judges, while it waits for one, m/s.
        holds: whether its gripper holds the object.
        took: when it last began to, s; None before.
        let_go: when it last ceased to, s; None before and while it holds it.
        torn: when it first ceased to though its gripper was to be closed, s; None: never.
        farthest: greatest distance of the gripper from its handover place while it yields, m.
        failed_deliveries: how many it has counted.
        full: how many there were: times that it had closed again on what it had released.
        undelivered: whether it gave up when it counted one.
        gave_up_from: distance of the gripper from its handover place when it gave up, m; None before.
    """

    phases: list[tuple[str, float]] = field(default_factory=list[tuple[str, float]])
    signalled: float | None = None
    asked: float | None = None
    felt: float | None = None
    fastest: float = 0.0
    holds: bool = False
    took: float | None = None
    let_go: float | None = None
    torn: float | None = None
    farthest: float = 0.0
    failed_deliveries: int = 0
    full: int = 0
    undelivered: bool = False
    gave_up_from: float | None = None

    @property
    def phase(self) -> str:
        """Its phase."""
        return self.phases[-1][0] if self.phases else ""

    def enter(self, phase: str, t: float) -> None:
        """Begin a phase."""
        if phase == "SIGNAL":
            self.signalled, self.asked = t if self.signalled is None else self.signalled, t
            self.felt, self.fastest = None, 0.0
        if self.phase == "CHECK_VELOCITY" and phase != "GIVEN_UP":
            self.felt = t
        self.phases.append((phase, t))

    def hold(self, holds: bool, commanded: bool, t: float) -> None:
        """Take in whether the gripper holds the object, and is commanded to."""
        if self.holds and not holds:
            self.let_go = t
            if commanded and self.torn is None:
                self.torn = t
        elif holds and not self.holds:
            self.took, self.let_go = t, None
        self.holds = holds


_SETTLING = 1.0
"""How long the receiver must keep the object when the robots are done, s (assumed)."""
_ALONE = 0.5
"""Time for which one gripper may still hold the object after the other has let go, s (assumed)."""
_JAW = 0.03
"""How far the gripper's jaws reach before its G, m, as they are drawn."""
_ENDS = ("DONE", "GIVEN_UP")
_YIELDING = ("SIGNAL", "CHECK_VELOCITY", "RELEASE_OBJECT", "VERIFY_RELEASE", "CLOSE_GRIPPER", "CHECK_ANGLE")


class TeamEvaluator(Evaluator):
    """Follows one run and decides whether the object went from the robots to the person, or back.

    It is a success when at the end all grippers or all of the person's hands hold the object, and no others, when
    somebody held it all the time since somebody first did, and when no gripper kept it for longer than half a second
    after the other let go: an object that hangs at one robot swings about it. It must not have been torn out of a
    closed gripper, even if that caught it again, nor a hand have been in a robot (`HandInCube`). Where a gripper closes
    again on an object that was released and floats, the delivery has failed, not yet the handover; the robots must have
    noticed as often. Nor may a robot that has let go run into the box, which nothing simulates: `clearance` is the
    least gap between jaws and box from then on.

    Attributes:
        robots: what became of each.
        done: when the receiver had the object alone, s; None before.
    """

    records = (Metric, OneRobot, Box, HandInCube)

    def __init__(self, parameters: TeamParameters) -> None:
        self.parameters = parameters
        self.robots = [OneRobot(), OneRobot()]
        self.done: float | None = None
        large = vars(LargeObjectParams())
        half = 0.5 * float(large["grip_spacing"])
        x, y, z = parameters.p_WG_handover.tolist()
        self._places = [(x, y + half, z), (x, y - half, z)]
        self._wanted = 2 ** len(parameters.hand_numbers) - 1
        self._t, self._steps, self._saturated = 0.0, 0, 0
        self._codes = (-1, -1, -1, -1)
        self._grippers = self._hands = 0
        self._most_hands = 0
        self._held = False
        self._lost: tuple[float, int, int] | None = None  # when, which grippers and hands had held it
        self._q_WO: tuple[float, float, float, float] | None = None
        self._internal = self._turn = self._force = 0.0
        self._gap, self._clearance = 0.0, math.inf
        self._box = Box(scale(0.5, vector(np.array(large["object_size"]))))
        self._failed = 0
        self._in_cube = HandInCube()
        self._mismatch = ""

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep what the controllers do not know of the robot."""
        self._mismatch = model_mismatch(units)

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases, who holds the object, forces and turns."""
        self._t, self._steps = t, self._steps + 1
        self._saturated += any(bool(signals[f"thrusters_{i}.saturated"]) for i in (1, 2))
        codes = (
            int(signals["decision.phase_1"]),
            int(signals["decision.phase_2"]),
            int(signals["person.grippers_holding"]),
            int(signals["person.hands_holding"]),
        )
        if codes != self._codes:
            self._change(t, signals, codes)
            self._codes = codes
        self._follow_grippers(t, signals)
        for r, hand in product(ROBOTS, self.parameters.hand_numbers):
            self._in_cube.follow(t, signals, f"robot_{r}", f"person.p_WH_{hand}")
        if self._grippers == 3:
            self._internal = max(self._internal, abs(_internal_force(signals)))
        if self._signalled and (self.done is None or t < self.done + _SETTLING):
            self._follow_object(signals)

    def _change(self, t: float, signals: Signals, codes: tuple[int, int, int, int]) -> None:
        for i, robot in enumerate(self.robots, 1):
            phase = signals.text(f"decision.phase_{i}")
            if phase != robot.phase:
                self._closed_again(robot, codes[2], i)
                self._count_delivery(robot, phase, signals, i)
                if phase == "GIVEN_UP":
                    robot.gave_up_from = self._from_place(i, signals)
                robot.enter(phase, t)
            robot.hold(bool(codes[2] & i), float(signals[f"decision.closure_{i}"]) > 0.5, t)
        before = self._grippers, self._hands
        self._grippers, self._hands = codes[2:]
        self._most_hands |= self._hands
        self._failed = max(int(signals[f"decision.failed_receptions_{i}"]) for i in (1, 2))
        if self._held and self._lost is None and not (self._grippers or self._hands):
            self._lost = (t, *before)
        if self._grippers and self._verifies:
            self._lost = None
        self._held = self._held or bool(self._grippers or self._hands)
        received = (self._grippers, self._hands) == self._receivers
        if received and self._signalled and self.done is None:
            self.done = t

    def _closed_again(self, robot: OneRobot, grippers: int, i: int) -> None:
        """Count a delivery that has failed, as the robot leaves its phase."""
        if robot.phase == "VERIFY_RELEASE" and (grippers if self.parameters.together else grippers & i):
            robot.full += 1
            self.done = None

    def _count_delivery(self, robot: OneRobot, phase: str, signals: Signals, i: int) -> None:
        """Take over how many failed deliveries a robot has counted as it enters a phase."""
        name = f"decision.failed_deliveries_{i}"
        failed = int(signals[name]) if name in signals else 0
        robot.undelivered |= phase == "GIVEN_UP" and failed > robot.failed_deliveries
        robot.failed_deliveries = failed

    def _follow_grippers(self, t: float, signals: Signals) -> None:
        for i, robot in enumerate(self.robots, 1):
            if robot.signalled is not None and robot.phase in _YIELDING:
                robot.farthest = max(robot.farthest, self._from_place(i, signals))
            if robot.let_go is not None:
                self._clearance = min(self._clearance, self._from_box(i, signals))
            if robot.phase == "CHECK_VELOCITY":
                robot.fastest = max(robot.fastest, float(signals[f"decision.speed_{i}"]))
        first, second = self.robots
        if first.holds != second.holds and self.parameters.task is TeamTask.ROBOTS_TO_HUMAN and self._signalled:
            other, gone = (first, second.let_go) if first.holds else (second, first.let_go)
            if gone is not None and other.took is not None and other.took <= gone:
                self._gap = max(self._gap, t - gone)

    def _follow_object(self, signals: Signals) -> None:
        q_WO = quaternion(signals["person.q_WO"])
        self._q_WO = self._q_WO or q_WO
        self._turn = max(self._turn, angle_between(self._q_WO, q_WO))
        forces = (norm(vector(signals[f"person.f_H_{i}"])) for i in (1, 2))
        self._force = max(self._force, *forces)

    def _from_place(self, i: int, signals: Signals) -> float:
        """Return the distance of a gripper from its handover place, m."""
        return math.dist(signals[f"robot_{i}.p_WG"].tolist(), self._places[i - 1])

    def _from_box(self, i: int, signals: Signals) -> float:
        """Return the gap between a gripper's jaws and the object, m."""
        R_WO = rotation_matrix(quaternion(signals["person.q_WO"]))
        apart = subtract(vector(signals[f"robot_{i}.p_WG"]), vector(signals["person.p_WO"]))
        return self._box.distance(inverse_rotate(R_WO, apart)) - _JAW

    @property
    def _receivers(self) -> tuple[int, int]:
        """Which grippers and hands are to hold the object at the end, as bit masks."""
        return (0, self._wanted) if self.parameters.task is TeamTask.ROBOTS_TO_HUMAN else (3, 0)

    @property
    def _signalled(self) -> bool:
        return all(robot.signalled is not None for robot in self.robots)

    @property
    def _verifies(self) -> bool:
        return any(robot.phase == "VERIFY_RELEASE" for robot in self.robots)

    @property
    def _failed_deliveries(self) -> int:
        return max(robot.failed_deliveries for robot in self.robots)

    @property
    def over(self) -> bool:
        """Whether both robots are done or have given up, or the object is lost."""
        if self._lost is not None and self._t >= self._lost[0] + _SETTLING and not self._verifies:
            return True
        ends = [robot.phases[-1][1] for robot in self.robots if robot.phase in _ENDS]
        return len(ends) == len(self.robots) and self._t >= max(ends) + _SETTLING

    def outcome(self) -> Outcome:
        """Return whether the object changed hands as it should, why, and the metrics."""
        success = (
            self._lost is None
            and all(robot.phase == "DONE" and robot.failed_deliveries == robot.full for robot in self.robots)
            and (self._grippers, self._hands) == self._receivers
            and self._gap <= _ALONE
            and all(robot.torn is None for robot in self.robots)
            and self._clearance > 0.0
        )
        cause, reason = (TeamCause.NONE, self._success()) if success else self._failure()
        codes = ", ".join(f"{item.value} {item.words}" for item in TeamCause)
        metrics = (
            self._metrics()
            | self._in_cube.metrics()
            | {
                "decided_by": Metric(int(cause), "1", f"why it failed, by number: {codes}"),
            }
        )
        return Outcome(success=success, reason=reason + self._mismatch + self._in_cube.note, metrics=metrics)

    def _success(self) -> str:
        whom = "the person" if self.parameters.task is TeamTask.ROBOTS_TO_HUMAN else "both robots"
        again = f" after {counted_failures(self._failed, 'reception')}" if self._failed else ""
        never = "never out of all hands"
        if self._failed_deliveries:
            again, never = f" after {counted_failures(self._failed_deliveries, 'delivery')}", "never lost"
        return f"{whom} had the object at {self.done:.1f} s{again}, and it was {never}"

    def _metrics(self) -> dict[str, Metric]:
        gives = self.parameters.task is TeamTask.ROBOTS_TO_HUMAN
        touch = "pull" if gives else "push"
        metrics = {
            "squeeze": Metric(
                self._internal,
                "N",
                "internal force in the object at most: part of both grippers' forces that cancels along their line",
            ),
            "saturated_share": Metric(
                self._saturated / max(self._steps, 1),
                "1",
                "share of the time for which more was commanded than the thrusters of either robot give",
            ),
        }
        if self._signalled:
            text = "object from its orientation at the signal at most, until it is received"
            metrics["turn"] = Metric(self._turn, "rad", text)
            text = "force on either hand at most, from the signal until it is received"
            metrics["force"] = Metric(self._force, "N", text)
        for i, robot in enumerate(self.robots, 1):
            if robot.signalled is not None:
                metrics[f"displacement_{i}"] = Metric(
                    robot.farthest, "m", f"gripper {i} from its handover place at most, from the signal while it yields"
                )
            metrics[f"fastest_{i}"] = Metric(
                robot.fastest, "m/s", f"speed at most by which robot {i} judges whether there is a {touch}"
            )
        felt = [robot.felt for robot in self.robots if robot.felt is not None]
        signalled = [robot.signalled for robot in self.robots if robot.signalled is not None]
        asked = [robot.asked for robot in self.robots if robot.asked is not None and felt and robot.asked <= min(felt)]
        if felt and asked:
            metrics["time_to_release" if gives else "time_to_close"] = Metric(
                min(felt) - max(asked), "s", f"from the last signal until the first robot took a motion for a {touch}"
            )
        if math.isfinite(self._clearance):
            metrics["clearance"] = Metric(
                self._clearance, "m", "jaws of a robot that has let go from the object at least; below 0 in it"
            )
        if gives and felt:
            metrics["release_gap"] = Metric(
                self._gap, "s", "for how long one gripper held the object at most after the other had let go"
            )
        if gives:
            text = "deliveries after which a gripper still held the object, or it was gone unreleased"
            metrics["failed_deliveries"] = Metric(self._failed_deliveries, "1", text)
        else:
            metrics["failed_receptions"] = Metric(self._failed, "1", "receptions after which a gripper was found empty")
        if self.done is not None and signalled:
            metrics["transfer_time"] = Metric(
                self.done - max(signalled), "s", "from the first signal until the receiver had the object alone"
            )
        return metrics

    def _failure(self) -> tuple[TeamCause, str]:
        for i, robot in enumerate(self.robots, 1):
            if robot.torn is not None:
                text = f"the object was torn out of closed gripper {i} at {robot.torn:.1f} s; {self._where}"
                return TeamCause.TORN_OUT, text
        if self._gap > _ALONE:
            return TeamCause.ONE_LET_GO_ALONE, self._alone()
        if self._lost is not None:
            return self._loss(*self._lost)
        if self._clearance <= 0.0:
            return TeamCause.RAN_INTO_IT, f"a robot that had let go ran into the object; {self._where}"
        gives = self.parameters.task is TeamTask.ROBOTS_TO_HUMAN
        if not gives and self._grippers in (1, 2) and any(robot.phase == "GIVEN_UP" for robot in self.robots):
            return TeamCause.ONE_RECEIVED_ALONE, f"gripper {self._grippers} took the object alone; {self._where}"
        given_up = [robot for robot in self.robots if robot.phase == "GIVEN_UP"]
        if any(robot.undelivered for robot in given_up):
            often = counted_failures(self._failed_deliveries, "delivery")
            return TeamCause.DELIVERIES_FAILED, f"the robots gave up after {often}; {self._where}"
        if given_up:
            return self._given_up(given_up[0])
        if any(robot.failed_deliveries != robot.full for robot in self.robots):
            return TeamCause.OTHER, f"the robots misjudged whether a released object was gone; {self._where}"
        if not all(robot.phase == "DONE" for robot in self.robots):
            phases = " and ".join(robot.phase for robot in self.robots)
            return TeamCause.OUT_OF_TIME, f"stopped at {self._t:.1f} s in phases {phases}; {self._where}"
        if gives and 0 < self._hands != self._wanted:
            return TeamCause.ONE_HAND_HELD, f"only one hand held the object when the robots let go; {self._where}"
        return TeamCause.OTHER, f"the robots were done, but the object did not go where it should; {self._where}"

    def _alone(self) -> str:
        first, second = self.robots
        i, j, t = (1, 2, first.let_go) if first.let_go is not None else (2, 1, second.let_go)
        if first.let_go is not None and second.let_go is not None and second.let_go < first.let_go:
            i, j, t = 2, 1, second.let_go
        return f"gripper {i} let go alone at {t:.1f} s, and gripper {j} held on for {self._gap:.1f} s; {self._where}"

    def _loss(self, t: float, grippers: int, hands: int) -> tuple[TeamCause, str]:
        if grippers:
            most = self._most_hands
            held = "the person had let go of it" if most == self._wanted else f"only {_which(most, 'hand')} had held it"
            only = f": {held if most else 'no hand had held it'}"
            text = f"the robots opened their grippers though the person did not hold the object, lost at {t:.1f} s"
            return TeamCause.RELEASED_UNHELD, text + only
        return (
            TeamCause.LET_GO_EARLY,
            f"{_which(hands, 'hand')} let go of the object at {t:.1f} s, and no gripper held it",
        )

    def _given_up(self, robot: OneRobot) -> tuple[TeamCause, str]:
        before = robot.phases[-2][0] if len(robot.phases) > 1 else ""
        within = within_patience(robot.phases, self.parameters.patience)
        if before == "CHECK_VELOCITY":
            gives = self.parameters.task is TeamTask.ROBOTS_TO_HUMAN
            if gives and 0 < self._most_hands != self._wanted:
                return TeamCause.ONE_HAND_HELD, f"only {_which(self._most_hands, 'hand')} ever held it; {self._where}"
            touch, threshold = ("pull" if gives else "push"), self.parameters.threshold("HAND" if gives else "GRIPPER")
            text = f"the {touch} stayed below the threshold: {robot.fastest:.3f} of {threshold:.3f} m/s"
            return TeamCause.NOT_FELT, f"the robots never felt a {touch}{within}: {text}; {self._where}"
        if before == "CHECK_ANGLE":
            often = counted_failures(self._failed, "reception")
            return TeamCause.RECEPTIONS_FAILED, f"they gave up after {often}; {self._where}"
        if before == "GRASP_OBJECT":
            without = _which(3 & ~self._grippers, "gripper")
            text = f"they closed their grippers, and {without} got nothing" if without else "they had the object"
            return TeamCause.NOT_FETCHED, f"{text}; {self._where}"
        if before == "MOVE_TO_HANDOVER":
            text = f"they did not come to rest at their places{within or ' in time'}"
            return TeamCause.OUT_OF_REACH, f"{text}: {self._gave_up_from}; {self._where}"
        return TeamCause.OTHER, f"they gave up in phase {before}{not_over(within)}; {self._where}"

    @property
    def _gave_up_from(self) -> str:
        """How far the grippers of robots that gave up were from their places, in words."""
        away = [(i, robot.gave_up_from) for i, robot in enumerate(self.robots, 1) if robot.gave_up_from is not None]
        return ", ".join(f"gripper {i} was {1e3 * a:.0f} mm from its place" for i, a in away)

    @property
    def _where(self) -> str:
        who = [_which(self._grippers, "gripper"), _which(self._hands, "hand")]
        held = [name for name in who if name]
        if not held:
            return "nobody holds it"
        many = len(held) > 1 or 3 in (self._grippers, self._hands)
        return f"{' and '.join(held)} hold{'' if many else 's'} it"


def _which(mask: int, what: str) -> str:
    """Return which of two of a kind a bit mask names, empty for none."""
    return {0: "", 3: f"both {what}s"}.get(mask, f"{what} {mask}")


def internal_force(f_1: Vector, f_2: Vector, p_1: Vector, p_2: Vector) -> float:
    """Return the part, N, of the forces on two grippers at p_1 and p_2 that cancels along the line between them.

    They press what they hold where it is above 0, and draw it apart below.
    """
    apart = subtract(p_1, p_2)
    n = scale(1.0 / max(norm(apart), 1e-9), apart)
    first, second = dot(f_1, n), dot(f_2, n)
    return math.copysign(min(abs(first), abs(second)), first) if first * second < 0.0 else 0.0


def _internal_force(signals: Signals) -> float:
    names = ("person.f_G_1", "person.f_G_2", "robot_1.p_WG", "robot_2.p_WG")
    f_1, f_2, p_1, p_2 = (vector(signals[name]) for name in names)
    return internal_force(f_1, f_2, p_1, p_2)
