"""The Helix takes a ball from a hand and drops it into a bowl. [Vervloet2025] secs. 3.5.3 and 4.4, fig. 13.

It is evaluated by ground truth: whether the ball that the arm took comes to rest in the bowl.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.controllers.helix.servo.constant_curvature import W_FROM_B
from handover.controllers.helix.servo.jacobian_control import REACH_TOLERANCE, Limits, nearest_distance
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre, Radian, Second
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.plants.helix.hand.bowl import Bowl
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.experiment.experiment import FmuOf, Metric, Outcome
from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.helix.cameras import pinholes
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.parameters import Parameters
from handover.scenarios.robots.helix.places import PLACES

_REST_SPEED = 0.01
"""Speed below which the ball rests, m/s (assumed)."""
_REST_FOR = 0.5
"""How long it must, s (assumed)."""
_LONGEST_FALL = 5.0
"""How long a fallen ball may roll, s (assumed)."""


class UseCaseEvaluator(HandoverEvaluator):
    """Follows the handover as its base does, then the ball: on its way in the gripper, falling, and at rest.

    It is a success if the ball's middle comes through the plane of the bowl's rim within the rim, and at the end it
    rests in there.

    Args:
        parameters: the scenario's.
        bowl: where the ball is to go.
        carry_patience: time after the hand let go by which the ball must fall, s.
        pictures: those that were kept, where a record is evaluated; None: they are taken.
    """

    records = (*HandoverEvaluator.records, Bowl)

    def __init__(
        self,
        parameters: Parameters,
        bowl: Bowl,
        carry_patience: float,
        pictures: Sequence[CameraPicture] | None = None,
    ) -> None:
        super().__init__(parameters, pictures)
        self._bowl = bowl
        self._carry_patience = carry_patience
        self._fell_at: float | None = None
        self._p_WO_fell: Floats = np.zeros(3)
        self._is_lost = False  # it fell before the controller was to drop it, of one that says what it does
        self._crossed: Floats | None = None  # from the bowl's middle, where the ball fell through the rim's plane
        self._moved_at = 0.0  # the last time
        self._before: tuple[float, Floats] = (0.0, np.zeros(3))

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases and positions, and the ball's fall."""
        super().__call__(t, signals)
        if self._holder == "FREE":
            self._follow_fall(t, signals)
        self._before = (t, self._p_WO)

    def _follow_fall(self, t: float, signals: Signals) -> None:
        t_before, p_before = self._before
        if self._fell_at is None:
            self._fell_at, self._moved_at, self._p_WO_fell = t, t, self._p_WO
            self._is_lost = "servo.phase" in signals and self._phase != "DROP"
            self._keep("the ball falls", signals)
        crossing = self._bowl.crossing(p_before, self._p_WO)
        if crossing is not None:
            self._crossed = (crossing - self._bowl.p_WD)[:2]
        if np.linalg.norm(self._p_WO - p_before) > _REST_SPEED * (t - t_before):
            self._moved_at = t

    @property
    def over(self) -> bool:
        """Whether the ball rests, the arm gave up or was too slow, or there was no handover."""
        if self._released_at is None:
            return super().over
        if self._fell_at is not None:
            return self._t >= self._moved_at + _REST_FOR or self._t >= self._fell_at + _LONGEST_FALL
        return self._phase == "GIVEN_UP" or self._t >= self._released_at + self._carry_patience

    @property
    def is_in_bowl(self) -> bool:
        """Whether the ball came in through the rim's plane, and is below it within the rim."""
        if self._crossed is None or _length(self._crossed) > self._bowl.radius:
            return False
        over = self._p_WO - self._bowl.p_WD
        return bool(over[2] < 0.0) and _length(over[:2]) <= self._bowl.radius

    @property
    def _rests(self) -> bool:
        return self._fell_at is not None and self._t >= self._moved_at + _REST_FOR

    def outcome(self) -> Outcome:
        """Return whether the ball is in the bowl, why, and the metrics."""
        handover = super().outcome()
        success = self.is_in_bowl and self._rests and not self._is_pressed and not self._is_lost
        metrics = dict(handover.metrics)
        if self._released_at is not None:
            metrics.pop("final_distance", None)  # of a gripper that has let go, it tells nothing
        if self._released_at is not None and self._fell_at is not None and not self._is_lost:
            carried = self._fell_at - self._released_at
            metrics["carry_time"] = Metric(carried, "s", "from when the hand lets go until the gripper does")
            if self._rests:
                metrics["task_time"] = Metric(self._moved_at, "s", "from the start until the ball rests")
        if self._crossed is not None:
            metrics["drop_offset"] = Metric(
                _length(self._crossed), "m", "ball beside the bowl's middle as it falls past the rim, ground truth"
            )
        reason = self._success() if success else self._failure(handover)
        return Outcome(success=success, reason=reason, metrics=metrics)

    def _success(self) -> str:
        offset = 0.0 if self._crossed is None else 1e3 * _length(self._crossed)
        since = f"the ball has rested in the bowl since {self._moved_at:.1f} s"
        return f"{since}; it fell in {offset:.0f} mm beside the middle"

    def _failure(self, handover: Outcome) -> str:
        if self._released_at is None:
            return f"no handover: {handover.reason}"
        if self._is_pressed:
            return handover.reason
        if self._fell_at is None:
            return self._why_not_dropped()
        beside = _length((self._p_WO_fell - self._bowl.p_WD)[:2])
        if self._is_lost:
            return f"the gripper lost the ball on the way at {self._fell_at:.1f} s, {beside:.3f} m from above the bowl"
        if self._crossed is None:
            return f"stopped at {self._t:.1f} s, before the ball had fallen to the bowl's rim"
        offset, rim = _length(self._crossed), self._bowl.radius
        if offset > rim:
            return (
                f"the ball missed the bowl by {offset - rim:.3f} m: it fell past the rim's height {offset:.3f} m "
                f"beside the bowl's middle, whose rim has a radius of {rim:.3f} m"
            )
        if not self.is_in_bowl:
            return f"the ball fell into the bowl, {offset:.3f} m beside its middle, and left it again"
        return f"the ball fell into the bowl and did not come to rest until {self._t:.1f} s"

    def _why_not_dropped(self) -> str:
        beside = _length((self._p_WG - self._bowl.p_WD)[:2])
        where = f"the gripper holds the ball {beside:.3f} m from above the bowl"
        if self._phase == "GIVEN_UP":
            return (
                f"{self._why_given_up()} while carrying: the gripper stays {self._error:.3f} m from its goal; {where}"
            )
        if self._t >= (self._released_at or 0.0) + self._carry_patience:
            return f"not dropped within {self._carry_patience:.0f} s after the hand let go; {where}"
        return f"stopped at {self._t:.1f} s in phase {self._phase}, before the ball was dropped; {where}"


def _length(p: Floats) -> float:
    return float(np.linalg.norm(p))


_REACHED = 0.02
"""How far the place above the bowl may lie beyond the sure reach, m: in the thesis's direction the arm gets there."""

_END = Fraction(10)
"""Time for the last ball to fall and rest, s."""


@dataclass(frozen=True, kw_only=True)
class BowlPlace:
    """Where the bowl stands, and where the gripper lets the ball fall: above its middle."""

    bowl_azimuth: Radian = parameter(
        -math.pi / 2,
        "direction of the bowl from the arm's axis, as of the ball",
        minimum=-math.pi,
        maximum=math.pi,
        origin=assumed("to the right of the cameras, where no hand was offered"),
    )
    bowl_distance: Metre = parameter(
        0.16,
        "distance of the bowl's middle from the arm's axis",
        minimum=0.0,
        maximum=1.5,
        origin=assumed("as far as the ball is offered"),
    )
    bowl_height: Metre = parameter(
        -0.74,
        "height of the bowl's rim in W",
        minimum=-1.1,
        maximum=0.0,
        origin=assumed("just below the hanging gripper, which is at -0.7 m"),
    )
    bowl_radius: Metre = parameter(
        0.08,
        "radius of the bowl's rim",
        minimum=0.03,
        maximum=0.5,
        origin=assumed("fig. 13 has a bowl of some three balls' width"),
    )
    drop_height: Metre = parameter(
        0.1,
        "height of the gripper over the rim as it opens",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("own choice"),
    )
    carry_patience: Second = parameter(
        60.0,
        "time after the hand let go by which the ball must fall",
        minimum=1.0,
        maximum=600.0,
        origin=assumed("own choice"),
    )

    @property
    def p_WD(self) -> Floats:
        """Middle of the bowl's rim in W, shape (3,), m."""
        a, r = self.bowl_azimuth, self.bowl_distance
        return np.array([r * np.cos(a), r * np.sin(a), self.bowl_height])

    @property
    def p_WG_drop(self) -> Floats:
        """Where the gripper lets the ball fall, in W, shape (3,), m."""
        return self.p_WD + np.array([0.0, 0.0, self.drop_height])

    @property
    def bowl(self) -> Bowl:
        """The bowl, with the hand's depth and ball."""
        hand = HandParams()
        return Bowl(self.p_WD, self.bowl_radius, min(hand.bowl_depth, self.bowl_radius), hand.ball_radius)


@dataclass(frozen=True, kw_only=True)
class UseCaseParameters(BowlPlace, Parameters):
    """One use case: a handover, then a delivery."""

    @property
    def settings(self) -> dict[str, Any]:
        """The controller's parameters of the tuning and the filters, and of the delivery."""
        threshold = paper_values("helix", "delivery")["threshold_drop"][self.tuning]
        return {**super().settings, "delivers": True, "p_WG_drop": self.p_WG_drop, "threshold_drop": threshold}

    def hand_values(self, p_WO: Floats) -> dict[str, Any]:
        """Return what is set on the unit of hand and ball: the disturbances, and the bowl."""
        return super().hand_values(p_WO) | self._bowl_values()

    def camera_values(self) -> dict[str, Any]:
        """Return what is set on the cameras: the disturbances, and the bowl, which they see."""
        return super().camera_values() | self._bowl_values()

    def _bowl_values(self) -> dict[str, Any]:
        return {"p_WD": self.p_WD, "bowl_radius": self.bowl_radius, "bowl_depth": self.bowl.depth}


_BOWL = {
    "p_WD": "the scenario's bowl",
    "bowl_radius": "the scenario's",
    "bowl_depth": "the scenario's",
}
_OPTIONAL = {
    "camera": _BOWL,
    "servo": {
        "delivers": "true: after the handover it carries the ball on",
        "p_WG_drop": "above the bowl's middle, by the scenario's drop_height",
        "threshold_drop": "by the scenario's tuning",
    },
    "hand": {**_BOWL, "bowl_radius": "the scenario's; without a bowl the ball falls through where it stands"},
}


class HelixUseCase(HelixHandover):
    """The thesis's third experiment: a handover, after which the ball is dropped into a bowl at a known place."""

    name: ClassVar[str] = "helix_use_case"
    title: ClassVar[str] = "the Helix takes a ball from a hand and drops it into a bowl"
    parameters_type: ClassVar[type[Parameters]] = UseCaseParameters
    places: ClassVar[Mapping[str, Place]] = {
        name: replace(place, optional={**place.optional, **_OPTIONAL.get(name, {})}) for name, place in PLACES.items()
    }
    headline: ClassVar[tuple[str, ...]] = (
        "drop_offset",
        "grasp_offset_lateral",
        "arm_time",
        "handover_time",
        "carry_time",
        "task_time",
        "cpu_per_cycle",
        "pace_arm",
        "peak_memory",
    )

    def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Wire the handover's units, with a bowl; a place to drop the ball that the arm does not reach is a fault."""
        p: UseCaseParameters = parameters
        # OpenCV is slow to import, and lists import this.
        from handover.scenarios.robots.helix.workspace import short_of_reach

        s = super().build(p, seed, fmu)
        if short := short_of_reach(p.p_WG_drop, _REACHED):
            r, z = float(np.hypot(*p.p_WG_drop[:2])), p.p_WG_drop[2]
            at = f"{r:.2f} m from the arm's axis at a height of {z:.2f} m"
            s.notes.append(f"the gripper is to open {at}, but the arm {short}")
        if (away := nearest_approach(p.p_WG_drop, p.settings)) > REACH_TOLERANCE:
            x, y, z = p.p_WG_drop
            s.add_fault(
                f"bowl_azimuth, bowl_distance, bowl_height, drop_height: the place above the bowl, ({x:.2f}, {y:.2f}, "
                f"{z:.2f}) m, is out of the arm's reach: by its model the gripper comes no nearer than {away:.3f} m. "
                f"As far as the ball is offered, {p.radius:g} m from the axis and {p.height:g} m high, would do"
            )
        return s

    def stop_time(self, parameters: Any) -> Fraction:
        """Return the end of the patience for the approach and for the carrying, plus time for closing and falling."""
        p: UseCaseParameters = parameters
        return super().stop_time(p) + Fraction(math.ceil(p.carry_patience)) + _END

    def evaluator(self, parameters: Any) -> UseCaseEvaluator:
        """Return the evaluator of one use case."""
        p: UseCaseParameters = parameters
        return UseCaseEvaluator(p, p.bowl, p.carry_patience)

    def evaluator_of_record(self, parameters: Any, pictures: Sequence[CameraPicture]) -> UseCaseEvaluator:
        """Return an evaluator with the pictures that the run's folder keeps."""
        p: UseCaseParameters = parameters
        return UseCaseEvaluator(p, p.bowl, p.carry_patience, pictures)

    def published(self, parameters: Any) -> Sequence[PublishedValue]:  # noqa: ARG002
        """Return nothing: of single use cases the thesis gives no figures."""
        return ()

    def time_figures(self, parameters: Any, record: Record) -> list[TimeFigure]:
        """Return the handover's figures, and where the ball is over the bowl."""
        from handover.scenarios.robots.helix.plots import figure_of_delivery, figures_of_handover

        p: UseCaseParameters = parameters
        return [*figures_of_handover(p, record), figure_of_delivery(p.bowl, record)]

    def replay(self, parameters: Any, record: Record) -> Replay:
        """Return the handover in space, with the bowl."""
        from handover.scenarios.robots.helix.replay import replay_handover

        p: UseCaseParameters = parameters
        return replay_handover(record, pinholes(p.camera_turn, p.cameras).values(), p.bowl)


def nearest_approach(p_WG: Floats, settings: Mapping[str, Any]) -> float:
    """Return how near the controller's model of the arm, hanging in B, comes to a point in W, shape (3,), m."""
    servo = ServoParams(**settings)
    q_calib = np.zeros(9)
    q_calib[2::3] = servo.l_calib
    limits = Limits(servo.L_sys_LB, servo.L_sys_UB)
    p_BG, K = W_FROM_B[:3] * p_WG, np.array(servo.K_initialize)
    return nearest_distance(p_BG, q_calib, K, limits, servo.d_gripper)
