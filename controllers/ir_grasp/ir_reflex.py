"""Grasp refinement by infrared reflexes: centre the hand on an object, close, pull and shake. [Luberto] algorithm 1.

`Phase` is what the hand does, `Stop` why its refinement ended.
"""

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.controllers.ir_grasp.descent import Descent, Verdict
from handover.controllers.ir_grasp.following import Following, Mode, Termination
from handover.controllers.ir_grasp.moves import Move, Probing, Reading, X
from handover.controllers.ir_grasp.parameters import Correction, InvalidReflexParameters, Params, Strategy
from handover.controllers.ir_grasp.touch import Touch
from handover.controllers.ir_grasp.visibility import Recovery, Visibility, displaced
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.ports import Floats, Matrix3x4, Vector2, Vector3, Vector8, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Newton, Number, Radian, SquareMetre, Tick

__all__ = [
    "Inputs",
    "InvalidReading",
    "InvalidReflexParameters",
    "IrReflex",
    "Outputs",
    "Params",
    "Phase",
    "Stop",
    "Strategy",
    "Visibility",
]


class Phase(enum.IntEnum):
    """What the hand is doing; CHECK to STEP are the steps 3 to 9 of algorithm 1, SEARCH and TRACK are on the move."""

    REACH = 0
    CHECK = 1
    APPROACH = 2
    RECOVER = 3
    PROBE = 4
    STEP = 5
    CLOSE = 6
    PULL = 7
    SHAKE = 8
    DONE = 9
    SEARCH = 10
    TRACK = 11


class Stop(enum.IntEnum):
    """Why the refinement ended.

    The cost is small, steps, recoveries or way are used up, there is no progress, no finger sees the object, the limit
    of the wrist's reach is in the way of the next move (REACH), or the strategy has no refinement. Of the correction on
    the move: ways across change nothing of what is seen while a finger touches the object, which so goes along (PUSHED;
    also where no joint is measured); the object is deep between two fingers that are equally far from it, or presses a
    finger outwards there (CONTACT). Of the strategy CONTACT: it felt the object between the fingers, or its way ahead
    was at its end before (REACH).
    """

    RUNNING = 0
    THRESHOLD = 1
    PATIENCE = 2
    STALLED = 3
    OUT_OF_SIGHT = 4
    BLIND = 5
    FORWARD = 6
    PUSHED = 7
    CONTACT = 8
    CENTRED = 9
    REACH = 10


STOPS = {Verdict.REACHED: Stop.THRESHOLD, Verdict.STALLED: Stop.STALLED, Verdict.USED_UP: Stop.PATIENCE}
_TERMINATIONS = {
    Termination.REACHED: Stop.THRESHOLD,
    Termination.SETTLED: Stop.STALLED,
    Termination.LOST: Stop.OUT_OF_SIGHT,
    Termination.USED_UP: Stop.PATIENCE,
    Termination.REACH: Stop.REACH,
    Termination.PUSHED: Stop.PUSHED,
    Termination.CENTRED: Stop.CENTRED,
    Termination.CONTACT: Stop.CONTACT,
}
PHASES = {Mode.SEARCH: Phase.SEARCH, Mode.ONE_SIDED: Phase.RECOVER, Mode.TRACK: Phase.TRACK}


_PERIOD = Fraction(3, 200)  # one round of the three sensors, at 5 ms each (assumed)
_BRAKING = 0.008  # m; before the slow part of the way to the pre-grasp pose (assumed)


class InvalidReading(InvalidParameters):
    """An input that is not a number; `faults` names all of them."""

    block = "IrReflex"


@dataclass(kw_only=True)
class Inputs:
    """What the hand's sensors and the encoders of arm and motor measure."""

    ticks: Vector3[Tick] = port(np.zeros(3), "reading of the thumb's, index's and ring's sensor")
    p_WH: Vector2[Metre] = port(np.zeros(2), "wrist, in the world")
    yaw: Radian = port(0.0, "heading of the hand")
    sigma: Number = port(0.0, "closure of the hand: 0 open, 1 closed")
    tension: Newton = port(0.0, "tension of the tendon, by the motor's current; read by CONTACT and FAST")
    q: Vector8[Radian] = port(
        np.zeros(8), "joint angles: thumb 2, index 3, ring 3; all 0: not measured; read by CONTACT and FAST"
    )


@dataclass(kw_only=True)
class Outputs:
    """Commands, and what the controller concludes from its sensors at this instant."""

    p_WH_cmd: Vector2[Metre] = output("commanded wrist, in the world")
    yaw_cmd: Radian = output("commanded heading of the hand")
    sigma_cmd: Number = output("commanded closure: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    phase: Phase = output("what the hand is doing")
    case: Visibility = output("fingers that see the object, fig. 9")
    cost: SquareMetre = output("f, eq. (4), of the distances less their target, or as printed")
    distance: Vector3[Metre] = output("distance of thumb, index and ring by eq. (11)")
    steps: int = output("Gauss-Newton steps made")
    stop: Stop = output("why the refinement ended")
    jacobian_offset: Matrix3x4[Number] = output(
        "FAST: estimated Jacobian of the distances by ahead, left, yaw, sigma less the design's; else 0"
    )


class IrReflex:
    """Algorithm 1 as a state machine: probe the Jacobian (eq. 7), step by Gauss-Newton (eqs. 9, 10), close.

    Control inputs are x = [p_x, p_y, yaw, sigma], the planar part of the source's seven. A phase ends when the encoders
    have come to the command (or time is up); it is judged by the mean of some scans at rest.

    - REACH: to the pre-grasp pose. Then BLIND closes immediately and FORWARD after going forward_distance ahead.
    - CHECK: all fingers see the object: PROBE. None does: APPROACH. Some do: RECOVER (see `Recovery`). A finger that is
      not in the cost is given two closing motions to see, and no more: it may lag behind however long.
    - PROBE: each input in turn, and back, by its probing move, be it beyond the reach. Every probe_every steps;
      between, Broyden's update of J.
    - STEP: x + alpha dx within max_step and the reach. A step that raises f is undone and alpha halved.
    - CLOSE: when f is at most the threshold, or at the best pose if steps, recoveries or progress end, or the wrist
      stands at the limit of its reach (`Stop`). A hand whose recoveries end with the object out of sight closes where
      it is: it may have pushed the object along.
    - PULL, SHAKE, DONE: pull_distance back, then a sine across.

    That is the correction PAPER. FAST comes slowly to the pre-grasp pose and corrects on the move (`Following`).
    SEARCH, RECOVER and TRACK follow each other by what is seen, CLOSE goes along with the object, and `steps` are
    control periods in TRACK. The strategies BLIND, FORWARD and CONTACT do not look. CONTACT goes ahead and closes
    slowly until joints or tendon feel the object between the fingers, or as far as `reach`.

    The residuals are r_i = weight_i (d_i - target) over fingers with a weight: with the printed r_i = d_i the least
    cost is at contact, where the fingers push the object away.

    Raises:
        InvalidReflexParameters: by the constructor, for values that contradict each other or are out of range; all are
            named.
        InvalidReading: by `step`, for inputs that are not finite; all are named.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("p_WH_cmd", "yaw_cmd", "sigma_cmd", "phase", "case", "cost", "distance", "steps", "stop"),
        ("ticks", "p_WH", "yaw", "sigma", "tension", "q"),
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("encoders", TerminalKind.MEASUREMENTS, "p_WH", "yaw", "sigma", "tension", "q"),
        terminal("hand", TerminalKind.COMMAND, "p_WH_cmd", "yaw_cmd", "sigma_cmd"),
    )
    period: ClassVar[Fraction | None] = _PERIOD

    def __init__(self, params: Params) -> None:
        params.check()
        self.params = p = params
        self._calibration = p.calibration
        self._ticks_seen, self._ticks_lost = (self._calibration.ticks(y) for y in (p.epsilon, p.distance_max))
        self._weight: X = tuple(p.weight.tolist())
        self._target = 0.0 if p.literal else p.target
        self._move = Move(tuple(p.tolerance.tolist()), max(1, _periods(p.calm)))
        self._recovery = Recovery(p.recovery_step, p.recovery_closing, p.recovery_least)
        self._probing = Probing(tuple(p.probe.tolist()))
        self._descent = Descent(p)
        self._following = Following(p, float(_PERIOD))
        self._touch = Touch(p, float(_PERIOD))
        self._fast = p.strategy is Strategy.REFLEX and p.correction is Correction.FAST
        self._stop = Stop.RUNNING
        self._recoveries, self._closings, self._shaken = 0, 0, 0
        self._pregrasp: X = (*p.p_WH_pregrasp.tolist(), p.yaw_pregrasp, p.sigma_pregrasp)
        self._start(Phase.REACH, self._pregrasp, 0, p.travel_time)

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command in force and what the sensors say; no time passes."""
        ticks: X = tuple(u.ticks.tolist())
        if self._fast:
            ticks = self._following.without_ambient(ticks)
        distances = self._distances(ticks)
        p_x, p_y, yaw, sigma = self._command()
        return Outputs(
            p_WH_cmd=np.array([p_x, p_y]),
            yaw_cmd=yaw,
            sigma_cmd=sigma,
            phase=self._phase,
            case=self._case(ticks),
            cost=0.5 * sum((w * (d - self._target)) ** 2 for w, d in zip(self._weight, distances, strict=True)),
            distance=np.array(distances),
            steps=self._following.rounds if self._fast else self._descent.steps,
            stop=self._stop,
            jacobian_offset=self._following.jacobian_offset if self._fast else np.zeros((3, 4)),
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Continue the current move; when it is over, decide on the next one by its reading."""
        _check_inputs(u)
        if self._fast and self._phase not in (Phase.PULL, Phase.SHAKE, Phase.DONE):
            self._follow((*u.p_WH.tolist(), u.yaw, u.sigma), tuple(u.ticks.tolist()), u.q, u.tension)
        if self._phase is Phase.SHAKE:
            self._shake()
        elif self._phase is Phase.APPROACH and self.params.strategy is Strategy.CONTACT:
            self._feel((*u.p_WH.tolist(), u.yaw, u.sigma), u.q, u.tension)
        elif self._phase is not Phase.DONE and not self._on_the_move:
            reading = self._move.advance((*u.p_WH.tolist(), u.yaw, u.sigma), tuple(u.ticks.tolist()))
            if reading is not None:
                self._decide(reading)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return phase, move, recovery, probing, descent and counters."""
        parts = [part.get_state() for part in (self._move, self._recovery, self._probing, self._descent)]
        counters = (self._recoveries, self._closings, self._shaken)
        following = self._following.get_state() if self._fast else None
        return pack_state((int(self._phase), int(self._stop), parts, counters, following, self._touch.get_state()))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        phase, stop, parts, (self._recoveries, self._closings, self._shaken), following, touch = unpack_state(state)
        self._touch.set_state(touch)
        if self._fast:
            self._following.set_state(following)
        self._phase, self._stop = Phase(phase), Stop(stop)
        for part, saved in zip((self._move, self._recovery, self._probing, self._descent), parts, strict=True):
            part.set_state(saved)

    @property
    def _on_the_move(self) -> bool:
        return self._fast and self._phase in (Phase.SEARCH, Phase.TRACK, Phase.RECOVER)

    def _feel(self, now: X, q: Floats, tension: float) -> None:
        """Go ahead while slowly closing, until something presses a finger outwards near its root, or the reach ends.

        Where no joint is measured, or none feels it, the tendon may, by not being as tight as that of a free hand.
        """
        p = self.params
        x, step = self._ahead(p.contact_speed * float(_PERIOD)), p.contact_closing * float(_PERIOD)
        self._move.goal = (*x[:3], min(x[3] + step, p.sigma_limit))
        way = math.dist(x[:2], p.p_WH_pregrasp.tolist())
        self._touch.advance(now, q, tension)
        if self._touch.presses_outwards or abs(tension - p.free_tension * now[3]) > p.contact_tension:
            self._close(Stop.CONTACT)
        elif way >= float(p.reach[0]):
            self._close(Stop.REACH)

    def _follow(self, x: X, ticks: X, q: Floats, tension: float) -> None:
        """Correct on the move; while closing, go along with the object."""
        following = self._following
        if self._phase is Phase.CLOSE:  # what it last estimated: fingers that touch are not where the model has them
            v = following.velocity * float(_PERIOD)
            goal = self._move.goal
            self._move.goal = (goal[0] + float(v[0]), goal[1] + float(v[1]), *goal[2:])
            return
        sees = following.look(x, ticks)
        touches = following.feel(x, q, tension)
        arrived = self._phase is not Phase.REACH or self._arrived(x)
        if not (sees or touches or arrived):
            self._move.goal = self._arriving(x)
            return
        goal, ending = following.advance(x, self._move.goal if arrived else x)
        self._phase = PHASES[following.mode]
        self._move.goal = goal
        if ending is not Termination.NONE:
            self._close(_TERMINATIONS[ending])

    def _arriving(self, x: X) -> X:
        """Return the command on the way to the pre-grasp pose: slow on its last part, where an object may stand."""
        p, goal = self.params, self._pregrasp
        left, commanded = math.dist(x[:2], goal[:2]), math.dist(self._move.goal[:2], goal[:2])
        if left == 0.0:
            return goal
        if left > p.arrival_way + _BRAKING or p.arrival_way == 0.0:
            share = min(1.0, p.arrival_way / left)
        else:
            share = max(0.0, min(commanded, p.arrival_way) - p.arrival_speed * float(_PERIOD)) / max(left, 1e-9)
        return (goal[0] + share * (x[0] - goal[0]), goal[1] + share * (x[1] - goal[1]), *goal[2:])

    def _arrived(self, x: X) -> bool:
        return all(
            abs(a - b) <= tol for a, b, tol in zip(x, self._pregrasp, self.params.tolerance.tolist(), strict=True)
        )

    def _decide(self, reading: Reading) -> None:
        p = self.params
        if self._phase is Phase.REACH and p.strategy is Strategy.FORWARD:
            self._start(Phase.APPROACH, self._ahead(p.forward_distance), 0, p.travel_time)
        elif self._phase is Phase.REACH and p.strategy is Strategy.CONTACT:
            self._start(Phase.APPROACH, self._move.goal, 0)
        elif self._phase is Phase.REACH and p.strategy is Strategy.BLIND:
            self._close(Stop.BLIND)
        elif self._phase is Phase.APPROACH and p.strategy is Strategy.FORWARD:
            self._close(Stop.FORWARD)
        elif self._phase in (Phase.REACH, Phase.APPROACH, Phase.RECOVER):
            self._start(Phase.CHECK, self._move.goal, p.scans)
        elif self._phase is Phase.CHECK:
            self._check(reading)
        elif self._phase is Phase.PROBE:
            self._probe(reading)
        elif self._phase is Phase.STEP:
            self._judge(reading)
        elif self._phase is Phase.CLOSE:
            self._start(Phase.PULL, self._ahead(-p.pull_distance), 0, p.travel_time)
        elif self._phase is Phase.PULL:
            self._phase = Phase.SHAKE if p.shake_cycles else Phase.DONE

    def _check(self, reading: Reading) -> None:
        """Step 3 of algorithm 1: which fingers see the object, and so what comes next."""
        case = self._case(reading.ticks)
        suffices = all(self._in_cost(reading.ticks, self._ticks_seen))
        if case is Visibility.ALL_SEEN or (suffices and self._closings >= self.params.waited_closings):
            r = self._residuals(self._distances(reading.ticks))
            self._descent.measure(reading.x, r, self._move.goal)
            if self._descent.reached:
                self._close(Stop.THRESHOLD)
            else:
                self._begin_probing(reading.x, r)
        else:
            self._recover(case, only_lags=suffices)

    def _recover(self, case: Visibility, *, only_lags: bool) -> None:
        """Steps 4 and 5: approach, or move around the object."""
        p, x = self.params, self._move.goal
        motion = self._recovery.motion(case, may_close=x[3] + p.recovery_closing <= p.sigma_limit)
        wanted = displaced(x, motion)
        goal = self._descent.within_reach(wanted)
        self._closings += only_lags
        self._recoveries += 1
        if self._recoveries > p.max_recoveries or (goal == x and not only_lags):
            unseen = case is Visibility.NONE
            held = goal[:3] != wanted[:3]
            stop = Stop.REACH if held else Stop.OUT_OF_SIGHT if unseen else Stop.PATIENCE
            self._close(stop, at_best=not unseen)
        else:
            self._start(Phase.APPROACH if case is Visibility.NONE else Phase.RECOVER, goal, 0)

    def _begin_probing(self, x: X, r: Floats) -> None:
        self._probing.begin(self._move.goal, x, r)
        self._start(Phase.PROBE, self._probing.command, self.params.scans)

    def _probe(self, reading: Reading) -> None:
        """Steps 6 and 7: take a column's measurement, or, back at the beginning, step."""
        r, known = self._residuals(self._distances(reading.ticks)), self._in_cost(reading.ticks, self._ticks_lost)
        if not self._probing.done:
            self._probing.take(reading.x, r, known)
            self._start(Phase.PROBE, self._probing.command, self.params.scans)
        elif not all(known):
            self._recheck()
        else:
            self._descent.measure(reading.x, r, self._move.goal)
            self._descent.probed(self._probing.jacobian)
            self._step()

    def _step(self) -> None:
        """Steps 8 and 9."""
        self._start(Phase.STEP, self._descent.next_command(self._move.goal), self.params.scans)

    def _judge(self, reading: Reading) -> None:
        """Step 10; a finger of the cost that lost the object leads back to step 3."""
        if not all(self._in_cost(reading.ticks, self._ticks_lost)):
            self._recheck()
            return
        r = self._residuals(self._distances(reading.ticks))
        verdict = self._descent.judge(reading.x, r, self._move.goal)
        if verdict in STOPS:
            is_small = verdict is Verdict.REACHED
            held = self._descent.is_held and not is_small
            self._close(Stop.REACH if held else STOPS[verdict], at_best=not is_small)
        elif verdict is Verdict.BACK:
            self._start(Phase.CHECK, self._descent.best, self.params.scans)
        elif verdict is Verdict.PROBE:
            self._begin_probing(reading.x, r)
        else:
            self._step()

    def _recheck(self) -> None:
        """Return to step 3; counted, since readings at the edge of sight could lead there for ever."""
        self._recoveries += 1
        if self._recoveries > self.params.max_recoveries:
            self._close(Stop.PATIENCE, at_best=True)
            return
        self._start(Phase.CHECK, self._move.goal, self.params.scans)

    def _close(self, stop: Stop, *, at_best: bool = False) -> None:
        """Grasp the object: here, or, if the cost is not small but fingers still see, from the best pose known."""
        self._stop = stop
        x = self._descent.best if at_best and self._descent.best else self._move.goal
        self._start(Phase.CLOSE, (*x[:3], 1.0), 0, self.params.closing_time)

    def _shake(self) -> None:
        self._shaken += 1
        if self._shaken * float(_PERIOD) >= self.params.shake_cycles / self.params.shake_frequency:
            self._phase = Phase.DONE

    def _command(self) -> X:
        """Return the goal of the move, with the shake."""
        x = self._move.goal
        if self._phase is not Phase.SHAKE:
            return x
        p = self.params
        across = p.shake_amplitude * math.sin(2.0 * math.pi * p.shake_frequency * self._shaken * float(_PERIOD))
        return (x[0] - across * math.sin(x[2]), x[1] + across * math.cos(x[2]), x[2], x[3])

    def _start(self, phase: Phase, goal: X, scans: int, time: float | None = None) -> None:
        self._phase = phase
        self._move.start(goal, scans, _periods(self.params.move_time if time is None else time))

    def _ahead(self, distance: float) -> X:
        p_x, p_y, yaw, sigma = self._move.goal
        return (p_x + distance * math.cos(yaw), p_y + distance * math.sin(yaw), yaw, sigma)

    def _distances(self, ticks: Sequence[float]) -> list[float]:
        return [min(self._calibration.distance(x), self.params.distance_max) for x in ticks]

    def _residuals(self, distances: Sequence[float]) -> Floats:
        return np.array([w * (d - self._target) for w, d in zip(self._weight, distances, strict=True) if w > 0.0])

    def _in_cost(self, ticks: Sequence[float], min_ticks: float) -> list[bool]:
        """Return which fingers of the cost read at least so many ticks."""
        return [x >= min_ticks for w, x in zip(self._weight, ticks, strict=True) if w > 0.0]

    def _case(self, ticks: Sequence[float]) -> Visibility:
        return Visibility(sum(1 << i for i, x in enumerate(ticks) if x >= self._ticks_seen))


def _check_inputs(u: Inputs) -> None:
    """Raise InvalidReading for what is not a number: no move would ever arrive, and no finger would ever see."""
    inputs = {
        "ticks": u.ticks.tolist(),
        "p_WH": u.p_WH.tolist(),
        "yaw": [u.yaw],
        "sigma": [u.sigma],
        "tension": [u.tension],
        "q": u.q.tolist(),
    }
    wrong = [name for name, values in inputs.items() if not all(map(math.isfinite, values))]
    if wrong:
        raise InvalidReading([f"{name} must be finite, not {inputs[name]}" for name in wrong])


def _periods(time: float) -> int:
    return round(time / float(_PERIOD))
