"""Evaluates a handover in microgravity by ground truth, which the robot's computer does not see.

A handover has one or two transfers (`Transfer`): the object passes from robot to person, or back.
"""

import math
from collections.abc import Mapping, Sequence

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.cosim.exceptions import counted
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.robots.free_flyer.handover.led_hand import end_of_track
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause, Miss, PersonsDeeds
from handover.scenarios.robots.free_flyer.handover.transfer import Approach, Transfer
from handover.scenarios.robots.free_flyer.model_mismatch import model_mismatch
from handover.scenarios.robots.free_flyer.parameters import HandoverParameters
from handover.scenarios.robots.free_flyer.penetration import HandInCube
from handover.scenarios.robots.free_flyer.robot_wiring import SATURATED_SHARE, stability_metrics

_GATE = ("gate_error", "tolerance", "gate_speed")
"""Parameters of the unit that decides: how near its place the gripper is there, m, when it is to yield, and otherwise;
and below which speed it is at rest, m/s."""
_SETTLING = 1.0
"""How long the receiver must keep the object when the robot is done, s (assumed)."""
_LINGERING = 3.0
"""Seconds after the end of a hand's track in which it may still come to rest, and the robot be touched (assumed)."""
_CLOSING = ("GRASP_OBJECT", "CLOSE_GRIPPER")
"""Phases at whose end the gripper is closed."""

_SAMPLES = 0.1
"""Seconds by which a phase may be shorter than the robot's patience that ended it: a few of its samples."""
_TOUCH = {"HAND": "pull", "GRIPPER": "push"}
_ARRIVING = ("MOVE_TO_OBJECT", "MOVE_TO_HANDOVER", "ACTIVATE_IMPEDANCE", "OPEN_GRIPPER", "RETREAT")
"""Phases that end when the gripper is at rest in its place."""
_NOT_YIELDING = ("DEACTIVATE_IMPEDANCE", "RETREAT", "DONE", "GIVEN_UP")
_OPENING = ("RELEASE_OBJECT", "VERIFY_RELEASE", "DEACTIVATE_IMPEDANCE", "ACTIVATE_IMPEDANCE", "OPEN_GRIPPER")
_PLURALS = {"delivery": "deliveries", "reception": "receptions"}
_PEOPLE = {"HAND": "the person", "GRIPPER": "the robot"}


def counted_failures(failed: int, what: str) -> str:
    """Return how many deliveries or receptions failed, in words."""
    return counted(failed, f"failed {what}", f"failed {_PLURALS[what]}")


def within_patience(phases: Sequence[tuple[str, float]], patience: float) -> str:
    """Return " within the patience of ... s" if the phase before a robot gave up had lasted so long, else "".

    Args:
        phases: the robot's phases with the times at which they began, s, GIVEN_UP the last.
        patience: the scenario's parameter, s.
    """
    if len(phases) < 2 or phases[-1][1] - phases[-2][1] < patience - _SAMPLES:
        return ""
    return f" within the patience of {patience:g} s"


def not_over(within: str) -> str:
    """Return that a phase was not over within a time, as `within_patience` says it; "" for none."""
    return f", which was not over{within}" if within else ""


class HandoverEvaluator(Evaluator):
    """Follows one run and decides whether the handover succeeded.

    It is a success when the object reached each receiver in turn "without being supported anywhere else and always in
    contact with at least one of the participants" once it was held at all, [Fernandes2020] sec. 3.1.2, and the robot
    took an empty gripper for a failed reception, and a full one that had opened for a failed delivery, as often as it
    had one. Where it closes on an object that it had released and that floats, before the object is lost for good, the
    delivery has failed, not yet the handover. It must not have been torn out of the closed gripper, even if that caught
    it again, nor the hand have been in the robot (`HandInCube`).

    A failure has a `Cause`, the metric `decided_by`, by what the person did (`PersonsDeeds`). A robot that gives up
    after the last transfer, on its way back, has handed the object over, but not ended the handover: see the metric
    `handed_over`.

    Attributes:
        phases: phases of the robot and when they began, s, in chronological order; a phase may recur.
        holders: who held the object and since when, likewise.
        transfers: those that the robot signalled for.
    """

    records = (Metric, Transfer, Approach, PersonsDeeds, Miss, HandInCube)

    def __init__(self, parameters: HandoverParameters, receivers: Sequence[str], failures: int = 0) -> None:
        self.parameters, self.receivers, self.failures = parameters, tuple(receivers), failures
        self.phases: list[tuple[str, float]] = []
        self.holders: list[tuple[str, float]] = []
        self.transfers: list[Transfer] = []
        x, y, z = parameters.p_WG_handover.tolist()
        self._place = (x, y, z)
        self._t = 0.0
        self._steps = self._saturated = self._failed = self._failed_deliveries = 0
        self._codes = (-1, -1)
        self._arrival: tuple[float, float] | None = None
        self._approach: Approach | None = None  # of the phase under way, where it has a place to come to
        self._gate = tuple(float(vars(DecisionParams())[name]) for name in _GATE)
        self._angles: dict[str, float] = {}
        self._unprovoked = 0
        self._lost: tuple[float, str, str] | None = None  # when, who had held it, and the robot's phase
        self._track_end = end_of_track(parameters.hand_track)
        self._deeds = PersonsDeeds(led=parameters.is_led, by_track=bool(parameters.hand_track))
        self._off: float | None = None  # of the object from the fingers that last closed on nothing, m
        self._torn: float | None = None
        self._in_cube = HandInCube()
        self._undelivered = False
        self._empty = self._full = self._disturbed = 0
        self._stability, self._mismatch = dict[str, Metric](), ""

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Read the limits of arrival of the unit that decides; one that has none keeps the shipped unit's."""
        self._mismatch = model_mismatch(units)
        if "decision" in units:
            start = units["decision"].start
            self._gate = tuple(float(start.get(name, x)) for name, x in zip(_GATE, self._gate, strict=True))

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases, holder and gripper."""
        self._t = t
        self._steps += 1
        plain = signals.plain
        self._saturated += bool(plain("thrusters.saturated"))
        codes = (plain("decision.phase"), plain("person.holder"))
        x, y, z = plain("robot.p_WG")
        held_before = self._holder
        if codes != self._codes:
            self._change(t, signals, (x, y, z))
            self._codes = codes
        self._in_cube.follow(t, signals, "robot", "person.p_WH")
        phase, holder, transfer = self._phase, self._holder, self._under_way
        if transfer is not None:
            transfer.hardest = max(transfer.hardest, math.hypot(*plain("person.f_H")))
        if self._lost is None or t < self._lost[0] + _SETTLING:
            self._deeds.follow(t, signals, holder, held_before)
        if phase in _ARRIVING:
            self._approached(phase, (x, y, z), plain("decision.p_WG_goal"), plain("decision.speed_G"))
        if self.transfers and phase not in _NOT_YIELDING:
            self.transfers[-1].displaced((x, y, z), self._place)
            if phase in ("SIGNAL", "CHECK_VELOCITY"):
                # an object in the gripper pulls at it by its own inertia, too: there the hand tells a touch
                felt = plain("person.f_H" if holder == "GRIPPER" else "person.f_G")
                self.transfers[-1].touched |= holder == "BOTH" or any(felt) or self.last_pushed == t
            if phase == "CHECK_VELOCITY":
                self.transfers[-1].waited(plain("decision.speed_G"))

    def _approached(
        self, phase: str, p_WG: tuple[float, float, float], goal: tuple[float, float, float], speed: float
    ) -> None:
        """Follow the gripper's way to a goal, m, from a new goal on anew."""
        if self._approach is None or self._approach.p_WG_goal != goal:
            gate_error, tolerance, _ = self._gate
            self._approach = Approach(goal, gate_error if phase == "MOVE_TO_HANDOVER" else tolerance)
        self._approach.moved(p_WG, speed)

    def _change(self, t: float, signals: Signals, p_WG: tuple[float, float, float]) -> None:
        """Handle a change of phase or holder."""
        if not self._stability:
            self._stability = stability_metrics(signals, ("impedance", "pose"))
        phase, holder = signals.text("decision.phase"), signals.text("person.holder")
        self._failed = int(signals["decision.failed_receptions"])
        failed = int(signals["decision.failed_deliveries"]) if "decision.failed_deliveries" in signals else 0
        self._undelivered |= phase == "GIVEN_UP" and failed > self._failed_deliveries
        self._failed_deliveries = failed
        if phase != self._phase:
            left, _ = self.phases[-1] if self.phases else ("", 0.0)
            self.phases.append((phase, t))
            if left in _CLOSING:
                self._closed(float(signals["person.gripper_angle"]), holder)
                self._off = self._deeds.from_fingers(signals)
            self._enter(phase, left, t, p_WG, signals)
        if holder != self._holder:
            self._follow_tear(t, holder, signals)
            self.holders.append((holder, t))
            self._receive(holder, t)

    def _enter(self, phase: str, left: str, t: float, p_WG: tuple[float, float, float], signals: Signals) -> None:
        speed = signals.plain("decision.speed_G")
        if phase in _ARRIVING:
            self._approach = None
        if phase == "ACTIVATE_IMPEDANCE" and self._arrival is None:
            self._arrival = (math.dist(p_WG, self._place), speed)
        if phase == "CHECK_ANGLE" and self._holder not in ("GRIPPER", "BOTH"):
            self._empty += 1
        if left == "VERIFY_RELEASE" and self._holder in ("GRIPPER", "BOTH"):
            self._full += 1
            self._disturbed += self._holder == "BOTH"
            if self.transfers:
                self.transfers[-1].done = None
        if phase == "SIGNAL":
            self._deeds.signalled()
        if phase == "SIGNAL" and self._under_way is not None:
            self._under_way.asked_again(t)
        elif phase == "SIGNAL" and len(self.transfers) < len(self.receivers):
            self.transfers.append(Transfer(self.receivers[len(self.transfers)], t))
        if left == "CHECK_VELOCITY" and phase != "GIVEN_UP" and self._under_way is not None:
            self._under_way.felt, self._under_way.speed = t, speed
            self._under_way.true_speed = math.hypot(*signals.plain("robot.v_WG"))
            self._unprovoked += not self._under_way.touched

    def _closed(self, angle: float, holder: str) -> None:
        """Keep the angle of a gripper that has closed, rad: the least one on the object, the greatest on nothing."""
        if holder in ("GRIPPER", "BOTH"):
            self._angles["full"] = min(self._angles.get("full", math.inf), angle)
        else:
            self._angles["empty"] = max(self._angles.get("empty", 0.0), angle)

    def _follow_tear(self, t: float, holder: str, signals: Signals) -> None:
        """Keep when a gripper that is to be closed first lost to the hand what it held, even if it catches it again."""
        to_hand = holder == "HAND" if self._holder == "GRIPPER" else holder in ("HAND", "FREE")
        if self._torn is None and self._holder in ("GRIPPER", "BOTH") and to_hand:
            is_closed = "decision.closure" in signals and signals.plain("decision.closure") > 0.5
            self._torn = t if is_closed else None

    def _receive(self, holder: str, t: float) -> None:
        if holder == "FREE" and len(self.holders) > 1 and self._lost is None:
            self._lost = (t, self.holders[-2][0], self._phase)
        if holder == "GRIPPER" and self._phase == "VERIFY_RELEASE":
            self._lost = None
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
        """Whether the robot is done or has given up, the object is lost, or a recorded hand has ended before its part.

        That hand stays where it is, and the robot, at rest in its place, would wait for it until its patience ends.
        """
        if self._is_forsaken:
            return True
        if self._lost is not None and self._t >= self._lost[0] + _SETTLING and self._phase != "VERIFY_RELEASE":
            return True
        return self._phase in ("DONE", "GIVEN_UP") and self._t >= self.phases[-1][1] + _SETTLING

    @property
    def _handed_over(self) -> bool:
        """Whether each receiver has had the object in turn, and the last one has it, never out of both hands."""
        received = [t.receiver for t in self.transfers if t.done is not None]
        return self._lost is None and received == list(self.receivers) and self._holder == self.receivers[-1]

    @property
    def _is_forsaken(self) -> bool:
        """Whether the robot waits for a pull or push, and the track that leads the hand ended a while ago."""
        transfer, end = self._under_way, self._track_end
        if end is None or transfer is None or self._phase != "CHECK_VELOCITY" or transfer.touched:
            return False
        return self._lost is None and self._t >= max(end, transfer.asked) + _LINGERING

    def outcome(self) -> Outcome:
        """Return whether the object changed hands as it should, why, and the metrics."""
        success = (
            self._torn is None
            and self._handed_over
            and self._phase == "DONE"
            and self._failed == self._empty >= self.failures
            and self._failed_deliveries == self._full
        )
        cause, reason = (Cause.NONE, self._success()) if success else self._failure()
        metrics = self._metrics() | self._in_cube.metrics() | self._causes(cause)
        return Outcome(success=success, reason=reason + self._mismatch + self._in_cube.note, metrics=metrics)

    def _metrics(self) -> dict[str, Metric]:
        handed = "1 if each receiver got the object in turn, never out of both hands, whatever the robot did after it"
        metrics = {"handed_over": Metric(float(self._handed_over), "1", handed)}
        for prefix, transfer in zip(("transfer", "return"), self.transfers, strict=False):
            metrics |= transfer.metrics(prefix)
        if "GRIPPER" in self.receivers:
            empty = "receptions after which the robot found its gripper empty"
            metrics["failed_receptions"] = Metric(self._failed, "1", empty)
        if "HAND" in self.receivers:
            full = "deliveries after which the robot found the object still between its fingers, or gone unreleased"
            metrics["failed_deliveries"] = Metric(self._failed_deliveries, "1", full)
            both = "times that the robot looked whether the object was gone, and closed on it in the person's hand"
            metrics["disturbed_deliveries"] = Metric(self._disturbed, "1", both)
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
        metrics["saturated_share"] = Metric(share, "1", SATURATED_SHARE)
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
        counts = {"delivery": self._failed_deliveries, "reception": self._failed}
        failed = [counted_failures(n, what) for what, n in counts.items() if n]
        after = f" after {' and '.join(failed)}" if failed else ""
        never = "never lost" if self._failed_deliveries else "never out of both hands"
        return " and ".join(received) + after + f", and it was {never}"

    def _failure(self) -> tuple[Cause, str]:
        """Return why the object was lost, or the robot did not finish, or finished otherwise than it should."""
        if self._torn is not None:
            text = f"the object was torn out of the closed gripper at {self._torn:.1f} s"
            return Cause.TORN_OUT, f"{text}; {self._where}"
        if self._lost is not None:
            return self._loss(*self._lost)
        if self._is_forsaken and self._under_way is not None:
            transfer, end = self._under_way, self._track_end
            cause, why = self._deeds.untouched(_TOUCH[transfer.receiver], transfer.asked, end)
            after = f", until the track ended at {end:.1f} s" if end is not None and end >= transfer.asked else ""
            return cause, f"nobody answered the robot's signal of {transfer.asked:.1f} s: {why}{after}; {self._where}"
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
        if self._failed_deliveries < self._full:
            text = "the robot took its gripper for empty, which had closed on the object that it had released"
            return Cause.OTHER, f"{text}; {self._where}"
        if self._failed < self.failures:
            whose = "was asked of the hand that is led" if self.parameters.is_led else "was staged"
            text = f"{self._failed} failed receptions where {self.failures} {whose}; {self._where}"
            return Cause.OTHER, text
        return Cause.OTHER, f"the robot was done, but the object did not go where it should; {self._where}"

    def _loss(self, t: float, holder: str, phase: str) -> tuple[Cause, str]:
        """Return why the object was lost at t by a holder in a phase of the robot."""
        if holder == "GRIPPER" and phase in _OPENING:
            return self._deeds.released(t, self.transfers[-1].seen if self.transfers else "", self.last_pushed)
        if holder == "HAND":
            return self._deeds.dropped(t)
        before = _PEOPLE.get(holder, "both")
        return Cause.SLIPPED, f"the object was lost at {t:.1f} s in phase {phase}; {before} had held it"

    def _given_up(self, before: str) -> tuple[Cause, str]:
        """Return why the robot gave up in a phase."""
        transfer = self._under_way
        if before == "CHECK_VELOCITY" and transfer is not None:
            waited, touch = self.phases[-1][1] - transfer.asked, _TOUCH[transfer.receiver]
            if self.parameters.is_led and not transfer.touched:
                cause, why = self._deeds.untouched(touch, transfer.asked, self._track_end)
            else:
                threshold = self.parameters.threshold(transfer.receiver)
                cause, why = self._deeds.unfelt(touch, transfer.fastest, threshold)
            for_how_long = self._in_patience or f" within {waited:.0f} s"
            return cause, f"the robot never felt a {touch}{for_how_long} after its signal: {why}"
        if before == "CHECK_ANGLE":
            text = f"the robot gave up after {self._failed} failed receptions{self._deeds.receptions()}"
            return Cause.RECEPTIONS_FAILED, text
        if self._undelivered:
            how = "still held what it had released" if before == "VERIFY_RELEASE" else "was empty, and had not opened"
            often = counted_failures(self._failed_deliveries, "delivery")
            return Cause.DELIVERIES_FAILED, f"the robot gave up after {often}: its gripper {how}"
        if before == "GRASP_OBJECT":
            off = "" if self._off is None else f": the object was {1000.0 * self._off:.0f} mm from its fingers"
            return Cause.NOT_FETCHED, f"the robot closed its gripper and found nothing in it{off}"
        if before in _ARRIVING and self._approach is not None:
            return self._not_arrived(before, self._approach)
        return Cause.OTHER, f"the robot gave up in phase {before}{not_over(self._in_patience)}"

    @property
    def _in_patience(self) -> str:
        """Within which time the robot has not done what it gave up, for a sentence; "" if it had the time."""
        return within_patience(self.phases, self.parameters.patience)

    def _not_arrived(self, phase: str, approach: Approach) -> tuple[Cause, str]:
        """Return why the robot gave up in a phase that is to bring its gripper to rest in a place."""
        waited = self.phases[-1][1] - self.phases[-2][1]
        gate_error, _, rest = self._gate
        for_how_long = not_over(self._in_patience) or f" after {waited:.0f} s"
        text = f"the robot gave up in phase {phase}{for_how_long}: {approach.fault(rest)}"
        if self._handed_over:
            return Cause.NOT_RETREATED, f"the object changed hands, but then {text}"
        return (Cause.NOT_SETTLED if approach.nearest < gate_error else Cause.OUT_OF_REACH), text

    @property
    def _where(self) -> str:
        return {"BOTH": "both hold it", "FREE": "nobody holds it"}.get(
            self._holder, f"{_PEOPLE.get(self._holder, 'nobody')} holds it"
        )
