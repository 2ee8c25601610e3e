"""What became of one robot of a team by ground truth, and why a handover by two failed."""

import enum
from dataclasses import dataclass, field

from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause


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
