"""Evaluates by ground truth how the robot yields to a push and comes back to rest.

The gripper's pose error is compared with the one by the impedance model, [Fernandes2020] eqs. (3.26), (4.4), which
`errors_of` computes from the actual motion.
"""

import abc
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from handover.controllers.free_flyer.ports import PERIOD
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.starts import array_of
from handover.scenarios.robots.free_flyer.model_mismatch import assumed_body, model_mismatch
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Body, ImpedanceParameters
from handover.scenarios.robots.free_flyer.push.hand_push import HAND_SIGNALS, HandPush, hand_push_at
from handover.scenarios.robots.free_flyer.robot_wiring import SATURATED_SHARE, stability_metrics

REST_POSITION, REST_ANGLE = 0.010, 0.030
"""Errors below which the robot counts as at rest, m and rad: some three times the noise of its navigation (assumed)."""
RESTING = 5.0
"""How long the errors must stay below these, s (assumed)."""
SPINNING = 60.0
"""Angular speed at which control counts as lost, rad/s: more than the strongest push can cause (assumed)."""
_BAND = f"{1000 * REST_POSITION:.0f} mm and {math.degrees(REST_ANGLE):.1f}°"
_MODEL = "[Fernandes2020] eq. (4.4)"

MOTION_SIGNALS = ("robot.p_WG", "robot.v_WG", "robot.q_WB", "robot.w_WB", "push.f_G", "push.tau_G")
"""Signals of a push that make up a `Motion`, in the order of its fields after time."""


@dataclass(frozen=True)
class Motion:
    """The motion and the push at communication points, one row each, in W and SI units; quaternions scalar first.

    The wrench `f_G`, `tau_G` of a row is the mean since the row before. It acted on the gripper in that step, or where
    units step in parallel, in the next. `by_hand` is what somebody pushed the robot with besides; None: nobody did.
    """

    t: Floats
    p_WG: Floats
    v_WG: Floats
    q_WB: Floats
    w_WB: Floats
    f_G: Floats
    tau_G: Floats
    by_hand: HandPush | None = None

    @classmethod
    def of(cls, signals: Record | Mapping[str, Floats], t: Floats) -> "Motion":
        """Return the motion that signals at times t, s, make up."""
        by_hand = HandPush.of(signals, len(t))
        columns = [signals[name] for name in MOTION_SIGNALS]
        return cls(t, *columns, by_hand=None if by_hand.is_none else by_hand)


@dataclass(frozen=True)
class Errors:
    """Errors of the gripper's pose, rest minus actual, one row for each sample of the controller.

    Attributes:
        t: time, s.
        p, p_model: position error, actual and by the model, shape (rows, 3), in W, m.
        R, R_model: orientation error likewise, as a rotation vector in W, rad, up to whole turns.
    """

    t: Floats
    p: Floats
    p_model: Floats
    R: Floats
    R_model: Floats

    @property
    def disagreement(self) -> tuple[float, float]:
        """Greatest difference along any axis, m and rad; of orientations, the turn from one to the other."""
        from scipy.spatial.transform import Rotation  # slow to import, and needed only after a run

        apart = Rotation.from_rotvec(-self.R) * Rotation.from_rotvec(self.R_model)
        turn: Floats = np.array(apart.as_rotvec())
        return float(np.max(np.abs(self.p - self.p_model))), float(np.max(np.abs(turn)))

    @property
    def without_jumps(self) -> tuple[Floats, Floats]:
        """R, and of the rotation vectors that mean R_model the ones nearest to R; NaN where they jump by a turn."""
        both = np.array(self.R), _nearest(self.R_model, self.R)
        for turns in both:
            turns[1:][np.linalg.norm(np.diff(turns, axis=0), axis=1) > np.pi] = np.nan
        return both


def errors_of(motion: Motion, p_WG_goal: Floats, behaviour: Behaviour, model: Body) -> Errors:
    """Return the errors by eq. (4.4), k_D xt' = B_x x'' + (C_x + k_B) x' - f_ext, with rest at no rotation.

    Velocities are twists, so B_x x'' + C_x x' - f_ext is the propulsion's wrench, taken at the gripper: what changes
    the body's momentum, less all pushes. It is computed as the mean over a period of the controller, with the push's
    impulse. All else is of the instant of its sample; since thrust is held in the robot's frame, the mean is turned
    back by half the period's turn. Where units step in parallel, push and thrust act some steps later than they were
    asked for: by how many is seen in the motion, where any other number disagrees more.

    Args:
        motion: of a run.
        p_WG_goal: the gripper's place of rest in W, shape (3,), m.
        behaviour: whose gains of table 4.1 are taken.
        model: the robot as its controllers assume it to be; where it is another, the errors disagree.
    """
    steps = steps_of_period(motion.t)
    found = [
        _errors(motion, _Delays(steps, *late), p_WG_goal, behaviour, model)
        for late in itertools.product(range(steps), (0, 1), (0, 1) if motion.by_hand else (0,))
    ]
    return min(found, key=lambda errors: sum(errors.disagreement))


def steps_of_period(t: Floats) -> int:
    """Return how many of a motion's steps make up a period of the controller; t are its times, s."""
    return max(1, round(PERIOD / float(np.median(np.diff(t)))))


@dataclass(frozen=True)
class _Delays:
    """Steps in a period of the controller, and by how many its thrust and the pushes act later than asked for."""

    steps: int
    thrust: int
    push: int
    by_hand: int


def _errors(motion: Motion, delays: _Delays, p_WG_goal: Floats, behaviour: Behaviour, model: Body) -> Errors:
    """Return the errors with these delays, one row a period of the controller."""
    from scipy.spatial.transform import Rotation

    gains = paper_values("free_flyer", f"gains_{behaviour.item}")
    m, I_B = model.mass, model.I_B
    held = np.arange(delays.thrust, len(motion.t), delays.steps)
    force, torque = _propulsion(motion, held, delays, model)
    seen = (held - delays.thrust)[:-1]
    R_WB = Rotation.from_quat(motion.q_WB[seen], scalar_first=True)
    torque_G: Floats = torque - np.cross(R_WB.apply(model.p_BG), force) + gains["k_B_rotational"] * motion.w_WB[seen]
    softness_R: Floats = np.linalg.inv(I_B) / gains["k_D_rotational"]
    return Errors(
        t=motion.t[seen],
        p=p_WG_goal - motion.p_WG[seen],
        p_model=(force + gains["k_B_linear"] * motion.v_WG[seen]) / (gains["k_D_linear"] * m),
        R=-R_WB.as_rotvec(),
        R_model=_times(softness_R, torque_G),
    )


def _propulsion(motion: Motion, rows: NDArray[np.intp], delays: _Delays, model: Body) -> tuple[Floats, Floats]:
    """Return force, and torque about B, of the propulsion in W at the beginning of each interval between two rows."""
    from scipy.spatial.transform import Rotation

    m, I_B, w_WB, t = model.mass, model.I_B, motion.w_WB[rows], motion.t[rows]
    R_WB = Rotation.from_quat(motion.q_WB[rows], scalar_first=True)
    r_W: Floats = R_WB.apply(model.p_BG)
    dt = np.diff(t)[:, np.newaxis]
    f_G, tau_G = (mean_between(motion.t, a, rows, delays.push) for a in (motion.f_G, motion.tau_G))
    f_B, tau_B = np.zeros((2, len(dt), 3))
    if motion.by_hand is not None:
        wrenches = motion.by_hand.wrenches(motion.t, motion.q_WB, motion.w_WB, motion.q_WB)
        f_B, tau_B, f_Q, tau_Q = (mean_between(motion.t, a, rows, delays.by_hand) for a in wrenches)
        f_G, tau_G = f_G + f_Q, tau_G + tau_Q
    v_WB = motion.v_WG[rows] - np.cross(w_WB, r_W)
    w_B: Floats = R_WB.apply(w_WB, inverse=True)
    L_W: Floats = R_WB.apply(_times(I_B, w_B))
    force: Floats = m * np.diff(v_WB, axis=0) / dt - f_G - f_B
    torque: Floats = np.diff(L_W, axis=0) / dt - np.cross((r_W[:-1] + r_W[1:]) / 2, f_G) - tau_G - tau_B
    half_turn = Rotation.from_rotvec((w_WB[:-1] + w_WB[1:]) * dt / 4)
    return half_turn.apply(force, inverse=True), half_turn.apply(torque, inverse=True)


def mean_between(t: Floats, means: Floats, rows: NDArray[np.intp], delay: int) -> Floats:
    """Return the mean between each two rows, of means over the step before each row that acted `delay` steps later."""
    acting = means[1:] if delay == 0 else means[:-delay]
    impulse: Floats = np.vstack([np.zeros((1, means.shape[1])), np.cumsum(acting * np.diff(t)[:, np.newaxis], axis=0)])
    mean: Floats = np.diff(impulse[rows], axis=0) / np.diff(t[rows])[:, np.newaxis]
    return mean


def _nearest(turns: Floats, to: Floats) -> Floats:
    """Return vectors of the same rotations, whole turns more or less about their own axes, nearest to others."""
    angle = np.linalg.norm(turns, axis=1, keepdims=True)
    axis = turns / np.maximum(angle, 1e-12)
    whole: Floats = np.rint((np.sum(axis * to, axis=1, keepdims=True) - angle) / (2 * np.pi))
    return turns + 2 * np.pi * whole * axis


def _times(M: Floats, v: Floats) -> Floats:
    """Return M v for each row of v."""
    return v @ np.transpose(M)


def agreement_bound() -> str:
    """Return how far errors may be from those by eq. (4.4) at most to agree with them, as a clause."""
    by = paper_values("free_flyer", "published")["model_agreement"]
    return f"by its residual in eq. (4.4), of which {1000 * by[0]:.0f} mm and {math.degrees(by[1]):.1f}° at most agree"


P = TypeVar("P", bound=ImpedanceParameters)


class PushEvaluator(Evaluator, Generic[P]):
    """Follows one push and decides whether the gripper came back to rest, and moved as by a model of its impedance.

    Subclasses say which `signals` make up a motion, and what an error is. The push ends when `start` and `duration` of
    its unit say. Of a unit without them it ended with what it last gave.
    """

    records = (Metric,)
    signals: ClassVar[tuple[str, ...]]

    def __init__(self, parameters: P) -> None:
        self.parameters = parameters
        self._rows: list[list[Any]] = []
        self._saturated = 0
        self._timed, self._push_end = True, parameters.end
        self._t, self._astray, self._spins = 0.0, 0.0, False
        self._greatest = [0.0, 0.0]
        self._last = (0.0, 0.0)
        self._stability: dict[str, Metric] = {}
        self._mismatch = ""

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep when the push ends, if its unit says so, and what the controllers do not know of the robot."""
        of_push = units["push"].description.parameters if "push" in units else {}
        self._timed = {"start", "duration"} <= of_push.keys()
        ends = (float(array_of(units["push"], name)[0]) for name in ("start", "duration") if self._timed)
        self._push_end = sum(ends) if self._timed else -math.inf
        self._mismatch = model_mismatch(units)

    def __call__(self, t: float, signals: Signals) -> None:
        """Keep the motion and follow the errors."""
        if not self._rows:
            self._stability = stability_metrics(signals, ("impedance",))
        self._rows.append([t, *(signals[name] for name in self.signals), *hand_push_at(signals)])
        self._saturated += bool(signals["thrusters.saturated"])
        self._t, self._last = t, self._away(signals)
        self._spins = math.hypot(*signals["robot.w_WB"].tolist()) > SPINNING
        self._greatest = [max(both) for both in zip(self._greatest, self._last, strict=True)]
        if self._last[0] > REST_POSITION or self._last[1] > REST_ANGLE:
            self._astray = t
        if not self._timed and any((*signals.plain("push.f_G"), *signals.plain("push.tau_G"))):
            self._push_end = t

    @abc.abstractmethod
    def _away(self, signals: Signals) -> tuple[float, float]:
        """Return how far the gripper is from its rest, m and rad."""

    @property
    def over(self) -> bool:
        """Whether the gripper has come to rest after the push, or the robot spins out of control."""
        return self._spins or self._at_rest

    @property
    def _at_rest(self) -> bool:
        return self._t - max(self._astray, self._end) >= RESTING and self._end > -math.inf

    @property
    def _end(self) -> float:
        """When the last push ended, s, be it by hand; minus infinity while there was none."""
        return max(self._push_end, self.last_pushed)

    @property
    def _settled(self) -> float:
        return max(0.0, self._astray - self._end)

    def outcome(self) -> Outcome:
        """Return whether the gripper rests again and agreed with the model, why, and the metrics."""
        if len(self._rows) < 2:
            return Outcome(success=False, reason="stopped before the first step")
        motion = self._motion()
        by = self._errors(motion).disagreement
        bounds = paper_values("free_flyer", "published")["model_agreement"]
        agrees = by[0] <= bounds[0] and by[1] <= bounds[1]
        reason = self._reason(motion, by, agrees=agrees) + self._mismatch
        return Outcome(success=self._at_rest and agrees, reason=reason, metrics=self._metrics(motion, by))

    def _motion(self) -> dict[str, Floats]:
        columns = (np.array(column) for column in zip(*self._rows, strict=True))
        return dict(zip(("t", *self.signals, *HAND_SIGNALS), columns, strict=True))

    @abc.abstractmethod
    def _errors(self, motion: Mapping[str, Floats]) -> Errors:
        """Return the errors, actual and by the model, of a motion by signal, and its time as `t`."""

    @abc.abstractmethod
    def _reason(self, motion: Mapping[str, Floats], by: tuple[float, float], *, agrees: bool) -> str:
        """Return why a run is a success or not: rest, and what errors and the model's differ by, m and rad."""

    @abc.abstractmethod
    def _metrics(self, motion: Mapping[str, Floats], by: tuple[float, float]) -> dict[str, Metric]:
        """Return the metrics, see `_push_metrics`."""

    def _push_metrics(
        self, by: tuple[float, float], model: str, rest: str, own: Mapping[str, Metric] = MappingProxyType({})
    ) -> dict[str, Metric]:
        """Return the metrics of every push, with a subclass's own among them.

        Args:
            by: what errors and the model's differ by, m and rad.
            model: its equation.
            rest: where the gripper is to stay, as a clause.
            own: metrics.
        """
        apart = "actual against calculated {} error at most, " + model
        metrics = {
            "greatest_position_error": Metric(self._greatest[0], "m", "gripper from its place of rest at most"),
            "greatest_orientation_error": Metric(self._greatest[1], "rad", "gripper from its rest orientation at most"),
            **own,
            "disagreement_position": Metric(by[0], "m", apart.format("position")),
            "disagreement_orientation": Metric(by[1], "rad", apart.format("orientation")),
            "saturated_share": Metric(self._saturated / len(self._rows), "1", SATURATED_SHARE),
            **self._stability,
        }
        if self._at_rest:
            text = f"from the end of the push until the gripper stays {rest}"
            metrics["settling_time"] = Metric(self._settled, "s", text)
        return metrics


class ImpedanceEvaluator(PushEvaluator[ImpedanceParameters]):
    """Follows one push of a robot whose arm is rigid.

    Raises:
        KeyError: `paper.toml` lacks the place of rest.
    """

    records = (Metric, Body)
    signals = MOTION_SIGNALS

    def __init__(self, parameters: ImpedanceParameters) -> None:
        super().__init__(parameters)
        self.p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
        self._model = parameters.model

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep what the controller takes the robot to be, and what it does not know of it."""
        super().note_units(units)
        if "impedance" in units:
            self._model = assumed_body(units["impedance"], self._model)

    def _away(self, signals: Signals) -> tuple[float, float]:
        away = math.dist(signals["robot.p_WG"].tolist(), self.p_WG_goal.tolist())
        return away, 2.0 * math.acos(min(1.0, abs(float(signals["robot.q_WB"][0]))))

    def errors(self) -> Errors:
        """Return the errors, actual and by the model."""
        return self._errors(self._motion())

    def _errors(self, motion: Mapping[str, Floats]) -> Errors:
        return errors_of(Motion.of(motion, motion["t"]), self.p_WG_goal, self.parameters.behaviour, self._model)

    def _metrics(self, motion: Mapping[str, Floats], by: tuple[float, float]) -> dict[str, Metric]:  # noqa: ARG002
        return self._push_metrics(by, _MODEL, f"within {_BAND} of its rest")

    def _reason(self, motion: Mapping[str, Floats], by: tuple[float, float], *, agrees: bool) -> str:  # noqa: ARG002
        far = f"{1000 * by[0]:.1f} mm" if by[0] < 1.0 else f"{by[0]:.1f} m"
        apart = f"{far} and {math.degrees(by[1]):.2f}°"
        model = (
            f"agreed with the impedance model within {apart}"
            if agrees
            else f"departed from the impedance model by {apart}, {agreement_bound()}"
        )
        joined = "and" if agrees is self._at_rest else "but"
        share = self._saturated / len(self._rows)
        thrust = f"; more was commanded than the thrusters give for {100 * share:.0f} % of the time" if share else ""
        return f"{self._back()}{'' if self._at_rest and agrees else ','} {joined} {model}{thrust}"

    def _back(self) -> str:
        """Return whether the gripper came back to rest, as a clause of the reason."""
        if self._at_rest:
            last = "the push" if self._end == self._push_end else "the last push, by hand"
            return f"the gripper was back at rest, within {_BAND}, {self._settled:.1f} s after {last}"
        if self._spins:
            return f"the robot was out of control at {self._t:.1f} s, turning by more than {SPINNING:.0f} rad/s"
        if self._t < float(self.parameters.stop) - 0.02:
            return f"stopped at {self._t:.1f} s, before the robot could come to rest"
        if self._end == -math.inf:
            return f"nothing pushed the gripper in {self._t:.3g} s"
        if not self._timed and self._t - self._end < RESTING:
            return f"the gripper was pushed until {self._end:.1f} s, too late to see it rest within {self._t:.3g} s"
        return (
            f"the gripper did not come back to rest, within {_BAND} for {RESTING:g} s, in {self._t - self._end:.3g} s: "
            f"{1000 * self._last[0]:.0f} mm and {math.degrees(self._last[1]):.1f}° away at the end"
        )
