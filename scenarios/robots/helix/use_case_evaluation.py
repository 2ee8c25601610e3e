"""Evaluates the use case by ground truth: whether the ball that the arm took comes to rest in the bowl."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.plants.helix.hand.bowl import Bowl
from handover.scenarios.experiment.experiment import Metric, Outcome
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator
from handover.scenarios.robots.helix.parameters import Parameters

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
        return f"the ball rests in the bowl since {self._moved_at:.1f} s; it fell in {offset:.0f} mm beside the middle"

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
