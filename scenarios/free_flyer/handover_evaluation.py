"""Evaluates a handover in microgravity by ground truth, which the robot's computer does not see.

A handover has one or two transfers (`Transfer`): the object passes from robot to person, or back.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import HandoverParameters
from handover.scenarios.free_flyer.person_evaluation import Cause, Miss, PersonsDeeds
from handover.scenarios.free_flyer.robot_wiring import stability_metrics


@dataclass
class Transfer:
    """A transfer under way or done.

    Attributes:
        receiver: who is to have the object, `HAND` or `GRIPPER`.
        signalled: when the robot first gave the signal for it, s.
        asked: when it last gave the signal, s; later than `signalled` after a failed reception.
        felt: when, since then, it took the gripper's speed for a pull or a push, s; None before.
        in_vain: times at which it had felt one in receptions that failed, s.
        speed: the gripper's speed when it was felt, m/s.
        fastest: maximum speed while the robot has been waiting since it last asked, m/s.
        at_rest: the same until the person first touches the gripper, or what it holds, since the robot asked, m/s.
        touched: whether the person has, since then.
        farthest: maximum distance of the gripper from its place, from the signal for as long as it yields, m.
        farthest_along: the same along each axis of W.
        hardest: greatest force on the hand, from the signal until the receiver has the object alone, N.
        done: when the receiver had the object alone, s; None before.
    """

    receiver: str
    signalled: float
    asked: float = field(init=False)
    felt: float | None = None
    in_vain: list[float] = field(default_factory=list[float])
    speed: float = 0.0
    fastest: float = 0.0
    at_rest: float = 0.0
    touched: bool = False
    farthest: float = 0.0
    farthest_along: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    hardest: float = 0.0
    done: float | None = None

    def __post_init__(self) -> None:
        self.asked = self.signalled

    def asked_again(self, t: float) -> None:
        """Restart the transfer as the robot signals once more: what it had felt was in vain."""
        if self.felt is not None:
            self.in_vain.append(self.felt)
        self.asked, self.felt, self.fastest, self.touched = t, None, 0.0, False

    def waited(self, speed: float) -> None:
        """Update the maximum speeds by the gripper's, m/s, while the robot waits to be pulled or pushed."""
        self.fastest = max(self.fastest, speed)
        if not self.touched:
            self.at_rest = max(self.at_rest, speed)

    def displaced(self, p_WG: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        """Update the displacement by the gripper's position and its handover place."""
        (x, y, z), (p_x, p_y, p_z), (far_x, far_y, far_z) = p_WG, place, self.farthest_along
        x, y, z = abs(x - p_x), abs(y - p_y), abs(z - p_z)
        self.farthest = max(self.farthest, math.hypot(x, y, z))
        self.farthest_along = [max(far_x, x), max(far_y, y), max(far_z, z)]

    def metrics(self, prefix: str) -> dict[str, Metric]:
        """Return the transfer's metrics, their names with a prefix."""
        whom = "person" if self.receiver == "HAND" else "robot"
        touch = "pull" if self.receiver == "HAND" else "push"
        act = "let go" if self.receiver == "HAND" else "closed"
        metrics = {
            "displacement": Metric(
                self.farthest, "m", f"gripper from its handover place at most, while the {whom} takes the object"
            ),
            **{
                f"displacement_{axis}": Metric(
                    away,
                    "m",
                    f"gripper from its handover place at most along {axis} of W, while the {whom} takes the object",
                )
                for axis, away in zip("xyz", self.farthest_along, strict=True)
            },
            "force": Metric(self.hardest, "N", f"force on the hand at most, until the {whom} has the object"),
            "rest_speed": Metric(
                self.at_rest,
                "m/s",
                "gripper's speed at most, as the robot sees it, while it waits and nobody touches it",
            ),
        }
        if self.felt is not None:
            metrics["speed"] = Metric(self.speed, "m/s", f"gripper's speed when the robot felt the {touch} and {act}")
            since = f"from the last signal until the robot felt the {touch} and {act}"
            metrics["felt_after"] = Metric(self.felt - self.asked, "s", since)
        if self.done is not None:
            since = f"from the {'first ' if self.in_vain else ''}signal until the {whom} has the object"
            metrics["time"] = Metric(self.done - self.signalled, "s", since)
        return {f"{prefix}_{name}": metric for name, metric in metrics.items()}


_SETTLING = 1.0
"""How long the receiver must keep the object when the robot is done, s (assumed)."""

_CLOSING = ("GRASP_OBJECT", "CLOSE_GRIPPER")
"""Phases at whose end the gripper is closed."""

_TOUCH = {"HAND": "pull", "GRIPPER": "push"}
_NOT_YIELDING = ("DEACTIVATE_IMPEDANCE", "RETREAT", "DONE", "GIVEN_UP")
_PEOPLE = {"HAND": "the person", "GRIPPER": "the robot"}


class HandoverEvaluator(Evaluator):
    """Follows one run and decides whether the handover succeeded.

    It is a success when the object reached each receiver in turn "without being supported anywhere else and always in
    contact with at least one of the participants" once it was held at all, [Fernandes2020] sec. 3.1.2, and the robot
    took an empty gripper for a failed reception as often as it had one. A failure has a `Cause`, the metric
    `decided_by`, which is told apart by what the person did (`PersonsDeeds`).

    Attributes:
        phases: phases of the robot and when they began, s, in chronological order; a phase may recur.
        holders: who held the object and since when, likewise.
        transfers: those that the robot signalled for.
    """

    records = (Metric, Transfer, PersonsDeeds, Miss)

    def __init__(self, parameters: HandoverParameters, receivers: Sequence[str], failures: int = 0) -> None:
        self.parameters, self.receivers, self.failures = parameters, tuple(receivers), failures
        self.phases: list[tuple[str, float]] = []
        self.holders: list[tuple[str, float]] = []
        self.transfers: list[Transfer] = []
        x, y, z = parameters.p_WG_handover.tolist()
        self._place = (x, y, z)
        self._t = 0.0
        self._steps = self._saturated = self._failed = 0
        self._codes = (-1, -1)
        self._arrival: tuple[float, float] | None = None
        self._nearest = math.inf
        self._angles: dict[str, float] = {}
        self._unprovoked = 0
        self._lost: tuple[float, str, str] | None = None  # when, who had held it, and the robot's phase
        self._deeds = PersonsDeeds()
        self._empty = 0
        self._stability: dict[str, Metric] = {}

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases, holder and gripper."""
        self._t = t
        self._steps += 1
        self._saturated += bool(signals["thrusters.saturated"])
        codes = (int(signals["decision.phase"]), int(signals["person.holder"]))
        x, y, z = signals["robot.p_WG"].tolist()
        speed = float(signals["decision.speed_G"])
        held_before = self._holder
        if codes != self._codes:
            self._change(t, signals, (x, y, z), speed)
            self._codes = codes
        if self._under_way is not None:
            self._under_way.hardest = max(self._under_way.hardest, math.hypot(*signals["person.f_H"].tolist()))
        if self._lost is None or t < self._lost[0] + _SETTLING:
            self._deeds.follow(t, signals, self._holder, held_before)
        self._nearest = min(self._nearest, math.dist((x, y, z), self._place))
        if self.transfers and self._phase not in _NOT_YIELDING:
            self.transfers[-1].displaced((x, y, z), self._place)
            if self._phase in ("SIGNAL", "CHECK_VELOCITY"):
                pushed = self._holder != "GRIPPER" and bool(signals["person.f_G"].any())
                touches = pushed or self._holder == "BOTH"
                self.transfers[-1].touched |= touches
            if self._phase == "CHECK_VELOCITY":
                self.transfers[-1].waited(speed)

    def _change(self, t: float, signals: Signals, p_WG: tuple[float, float, float], speed: float) -> None:
        """Handle a change of phase or holder."""
        if not self._stability:
            self._stability = stability_metrics(signals, ("impedance", "pose"))
        phase, holder = signals.text("decision.phase"), signals.text("person.holder")
        self._failed = int(signals["decision.failed_receptions"])
        if phase != self._phase:
            left, _ = self.phases[-1] if self.phases else ("", 0.0)
            self.phases.append((phase, t))
            if left in _CLOSING:
                self._closed(float(signals["person.gripper_angle"]), holder)
            self._enter(phase, left, t, p_WG, speed)
        if holder != self._holder:
            self.holders.append((holder, t))
            self._receive(holder, t)

    def _enter(self, phase: str, left: str, t: float, p_WG: tuple[float, float, float], speed: float) -> None:
        if phase == "ACTIVATE_IMPEDANCE" and self._arrival is None:
            self._arrival = (math.dist(p_WG, self._place), speed)
        if phase == "CHECK_ANGLE" and self._holder not in ("GRIPPER", "BOTH"):
            self._empty += 1
        if phase == "SIGNAL":
            self._deeds.signalled()
        if phase == "SIGNAL" and self._under_way is not None:
            self._under_way.asked_again(t)
        elif phase == "SIGNAL" and len(self.transfers) < len(self.receivers):
            self.transfers.append(Transfer(self.receivers[len(self.transfers)], t))
        if left == "CHECK_VELOCITY" and phase != "GIVEN_UP" and self._under_way is not None:
            self._under_way.felt, self._under_way.speed = t, speed
            self._unprovoked += not self._under_way.touched

    def _closed(self, angle: float, holder: str) -> None:
        """Keep the angle of a gripper that has closed, rad: the least one on the object, the greatest on nothing."""
        if holder in ("GRIPPER", "BOTH"):
            self._angles["full"] = min(self._angles.get("full", math.inf), angle)
        else:
            self._angles["empty"] = max(self._angles.get("empty", 0.0), angle)

    def _receive(self, holder: str, t: float) -> None:
        if holder == "FREE" and len(self.holders) > 1 and self._lost is None:
            self._lost = (t, self.holders[-2][0], self._phase)
        if self._under_way is not None and holder == self._under_way.receiver:
            self._under_way.done = t

    @property
    def _under_way(self) -> Transfer | None:
        return self.transfers[-1] if self.transfers and self.transfers[-1].done is None else None

    @property
    def _phase(self) -> str:
        return self.phases[-1][0] if self.phases else ""

    @property
    def _holder(self) -> str:
        return self.holders[-1][0] if self.holders else ""

    @property
    def over(self) -> bool:
        """Whether the robot is done or has given up, or the object is lost."""
        if self._lost is not None and self._t >= self._lost[0] + _SETTLING:
            return True
        return self._phase in ("DONE", "GIVEN_UP") and self._t >= self.phases[-1][1] + _SETTLING

    def outcome(self) -> Outcome:
        """Return whether the object changed hands as it should, why, and the metrics."""
        success = (
            self._lost is None
            and self._phase == "DONE"
            and [t.receiver for t in self.transfers if t.done is not None] == list(self.receivers)
            and self._holder == self.receivers[-1]
            and self._failed == self._empty >= self.failures
        )
        cause, reason = (Cause.NONE, self._success()) if success else self._failure()
        return Outcome(
            success=success, reason=reason + self.parameters.stuck, metrics=self._metrics() | self._causes(cause)
        )

    def _metrics(self) -> dict[str, Metric]:
        metrics: dict[str, Metric] = {}
        for prefix, transfer in zip(("transfer", "return"), self.transfers, strict=False):
            metrics |= transfer.metrics(prefix)
        if "GRIPPER" in self.receivers:
            empty = "receptions after which the robot found its gripper empty"
            metrics["failed_receptions"] = Metric(self._failed, "1", empty)
        if self.transfers:
            alone = "times that the robot let go, or closed, though nobody had touched it since its signal"
            metrics["unprovoked"] = Metric(self._unprovoked, "1", alone)
        if self._arrival is not None:
            metrics["arrival_error"] = Metric(
                self._arrival[0], "m", "gripper to its handover place when it arrived and began to yield"
            )
            metrics["arrival_speed"] = Metric(
                self._arrival[1], "m/s", "gripper's speed when it arrived there and began to yield"
            )
        for state, words in (
            ("full", "least angle of the closed gripper with the object in it"),
            ("empty", "greatest angle of the closed gripper with nothing in it"),
        ):
            if state in self._angles:
                metrics[f"angle_{state}"] = Metric(self._angles[state], "rad", words)
        share = self._saturated / max(self._steps, 1)
        metrics["saturated_share"] = Metric(
            share, "1", "share of the time for which the thrusters were at their limits"
        )
        metrics |= self._stability
        for phase, t in self.phases:
            words = phase.replace("_", " ").lower()
            metrics.setdefault(
                f"phase_{phase.lower()}", Metric(t, "s", f"time at which the robot first entered its phase {words!r}")
            )
        return metrics

    def _causes(self, cause: Cause) -> dict[str, Metric]:
        """Return the metrics that say why a run failed, and what the person did wrong."""
        codes = ", ".join(f"{item.value} {item.words}" for item in Cause)
        metrics = {"decided_by": Metric(int(cause), "1", f"why it failed, by number: {codes}")}
        if "HAND" in self.receivers:
            misses = self._deeds.misses
            metrics["misses"] = Metric(len(misses), "1", "times the person's hand closed beside the object")
            if misses:
                depth, aside = max(abs(m.depth) for m in misses), max(m.aside for m in misses)
                metrics["miss_depth"] = Metric(depth, "m", "object's end from a hand that missed it, along its sight")
                metrics["miss_aside"] = Metric(aside, "m", "object's end from a hand that missed it, across its sight")
        return metrics

    def _success(self) -> str:
        received = [f"{_PEOPLE[t.receiver]} had the object at {t.done:.1f} s" for t in self.transfers]
        again = f" after {self._failed} failed reception{'s' * (self._failed > 1)}" if self._failed else ""
        return " and ".join(received) + again + ", and it was never out of both hands"

    def _failure(self) -> tuple[Cause, str]:
        """Return why the object was lost, or the robot did not finish, or finished otherwise than it should."""
        if self._lost is not None:
            return self._loss(*self._lost)
        if self._phase not in ("DONE", "GIVEN_UP"):
            text = f"stopped at {self._t:.1f} s in phase {self._phase}, before the handover was done; {self._where}"
            return Cause.OUT_OF_TIME, text
        if self._phase == "GIVEN_UP":
            cause, text = self._given_up(self.phases[-2][0] if len(self.phases) > 1 else "")
            return cause, f"{text}; {self._where}"
        if self._failed < self._empty:
            text = "the robot took its gripper for full, by its angle, from which the object had slipped"
            return Cause.SLIPPED, f"{text}; {self._where}"
        if self._failed > self._empty:
            return Cause.OTHER, f"the robot took its gripper for empty, which held the object; {self._where}"
        if self._failed < self.failures:
            text = f"{self._failed} failed receptions where {self.failures} was staged; {self._where}"
            return Cause.OTHER, text
        return Cause.OTHER, f"the robot was done, but the object did not go where it should; {self._where}"

    def _loss(self, t: float, holder: str, phase: str) -> tuple[Cause, str]:
        """Return why the object was lost at t by a holder in a phase of the robot."""
        opens = phase in ("RELEASE_OBJECT", "DEACTIVATE_IMPEDANCE", "ACTIVATE_IMPEDANCE", "OPEN_GRIPPER")
        if holder == "GRIPPER" and opens:
            return self._deeds.released(t)
        if holder == "HAND":
            return self._deeds.dropped(t)
        before = _PEOPLE.get(holder, "both")
        return Cause.SLIPPED, f"the object was lost at {t:.1f} s in phase {phase}; {before} had held it"

    def _given_up(self, before: str) -> tuple[Cause, str]:
        """Return why the robot gave up in a phase."""
        transfer = self._under_way
        if before == "CHECK_VELOCITY" and transfer is not None:
            waited, touch = self.phases[-1][1] - transfer.asked, _TOUCH[transfer.receiver]
            cause, why = self._deeds.unfelt(touch, transfer.fastest, self._threshold(transfer.receiver))
            return cause, f"the robot never felt a {touch} within {waited:.0f} s of its signal: {why}"
        if before == "CHECK_ANGLE":
            text = f"the robot gave up after {self._failed} failed receptions{self._deeds.receptions()}"
            return Cause.RECEPTIONS_FAILED, text
        if before == "GRASP_OBJECT":
            return Cause.NOT_FETCHED, "the robot closed its gripper and found nothing in it"
        if before == "MOVE_TO_HANDOVER":
            place = "(" + ", ".join(f"{x:.2f}" for x in self._place) + ")"
            nearest = f"the gripper came no nearer than {self._nearest:.2f} m to its place at {place} m"
            return Cause.OUT_OF_REACH, f"out of reach, or not at rest in time: {nearest}"
        return Cause.OTHER, f"the robot gave up in phase {before}"

    def _threshold(self, receiver: str) -> float:
        """Return the speed above which the robot feels a receiver's pull or push, as published, m/s."""
        return float(paper_values("free_flyer", "published")[f"velocity_{receiver.lower()}"][self.parameters.behaviour])

    @property
    def _where(self) -> str:
        return {"BOTH": "both hold it", "FREE": "nobody holds it"}.get(
            self._holder, f"{_PEOPLE.get(self._holder, 'nobody')} holds it"
        )
