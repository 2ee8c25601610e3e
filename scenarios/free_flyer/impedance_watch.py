"""Judges by ground truth how the robot yields to a push and comes back."""

import math
from typing import Any

import numpy as np

from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Metric, Outcome, Watch
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.impedance_model import MOTION_SIGNALS, Errors, Motion, errors_of
from handover.scenarios.free_flyer.impedance_parameters import Parameters
from handover.scenarios.free_flyer.stability import stability_metrics

_REST_POSITION, _REST_ANGLE = 0.010, 0.030
"""Errors below which the robot counts as at rest, m and rad: some three times the noise of its navigation (assumed)."""

_BAND = f"{1000 * _REST_POSITION:.0f} mm and {_REST_ANGLE:g} rad"
_MODEL = "[Fernandes2020] eq. (4.4)"

_RESTING = 5.0
"""How long it must stay within them, s (assumed)."""

_SPINNING = 60.0
"""Rate at which control counts as lost, rad/s: more than the greatest push can bring about (assumed)."""


class ImpedanceWatch(Watch):
    """Follows one push and tells whether the robot came back to rest and moved as the impedance model says.

    Raises:
        KeyError: `paper.toml` lacks the place of rest.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
        x, y, z = self.p_WG_goal.tolist()
        self._goal = (x, y, z)
        self._rows: list[list[Any]] = []
        self._saturated = 0
        self._t = 0.0
        self._astray = 0.0
        self._spins = False
        self._greatest = [0.0, 0.0]
        self._last = (0.0, 0.0)
        self._stability: dict[str, Metric] = {}

    def __call__(self, t: float, signals: Signals) -> None:
        """Keep the motion and follow the errors."""
        if not self._rows:
            self._stability = stability_metrics(signals, ("impedance",))
        seen = [signals[name] for name in MOTION_SIGNALS]
        self._rows.append([t, *seen])
        self._saturated += bool(signals["thrusters.saturated"])
        away = math.dist(seen[0].tolist(), self._goal)
        turned = 2.0 * math.acos(min(1.0, abs(float(seen[2][0]))))
        self._t, self._last = t, (away, turned)
        self._spins = math.hypot(*seen[3].tolist()) > _SPINNING
        self._greatest = [max(self._greatest[0], away), max(self._greatest[1], turned)]
        if away > _REST_POSITION or turned > _REST_ANGLE:
            self._astray = t

    @property
    def over(self) -> bool:
        """Whether the robot has come to rest after the push, or spins out of control."""
        return self._spins or self._at_rest

    @property
    def _at_rest(self) -> bool:
        return self._t - max(self._astray, self.parameters.end) >= _RESTING

    @property
    def _settled(self) -> float:
        return max(0.0, self._astray - self.parameters.end)

    def errors(self) -> Errors:
        """Return the errors as they were and as the model calls for."""
        return errors_of(Motion.of(self._rows), self.p_WG_goal, self.parameters.behaviour)

    def outcome(self) -> Outcome:
        """Return whether the robot rests again and agreed with the model, why, and the figures."""
        if len(self._rows) < 2:
            return Outcome(success=False, reason="stopped before the first step")
        by = self.errors().disagreement
        published = paper_values("free_flyer", "published")["model_agreement"]
        agrees = by[0] <= published[0] and by[1] <= published[1]
        share = self._saturated / len(self._rows)
        metrics = {
            "greatest_position_error": Metric(self._greatest[0], "m", "gripper from its place of rest at most"),
            "greatest_orientation_error": Metric(self._greatest[1], "rad", "gripper from its rest orientation at most"),
            "disagreement_position": Metric(by[0], "m", f"actual against calculated position error at most, {_MODEL}"),
            "disagreement_orientation": Metric(
                by[1], "rad", f"actual against calculated orientation error at most, {_MODEL}"
            ),
            "saturated_share": Metric(share, "1", "share of the time for which the thrusters were at their limits"),
            **self._stability,
        }
        if self._at_rest:
            told = f"from the end of the push until the gripper stays within {_BAND} of its rest"
            metrics["settling_time"] = Metric(self._settled, "s", told)
        return Outcome(success=self._at_rest and agrees, reason=self._reason(agrees, by, share), metrics=metrics)

    def _reason(self, agrees: bool, by: tuple[float, float], share: float) -> str:
        far = f"{1000 * by[0]:.1f} mm" if by[0] < 1.0 else f"{by[0]:.1f} m"
        apart = f"{far} and {by[1]:.3f} rad"
        model = (
            f"agreed with the impedance model within {apart}"
            if agrees
            else f"departed from the impedance model by {apart}"
        )
        joined = "and" if agrees is self._at_rest else "but"
        thrust = f"; thrusters at their limits for {100 * share:.0f} % of the time" if share else ""
        return f"{self._back()}{'' if self._at_rest and agrees else ','} {joined} {model}{thrust}"

    def _back(self) -> str:
        """Tell whether the gripper came back to rest."""
        p = self.parameters
        if self._at_rest:
            return f"the gripper was back at rest, within {_BAND}, {self._settled:.1f} s after the push"
        if self._spins:
            return f"the robot was out of control at {self._t:.1f} s, turning by more than {_SPINNING:.0f} rad/s"
        if self._t < float(p.stop) - 0.02:
            return f"stopped at {self._t:.1f} s, before the robot could come to rest"
        return (
            f"the gripper did not come back to rest, within {_BAND}, in {p.patience:.0f} s: {self._last[0]:.2f} m and "
            f"{self._last[1]:.2f} rad away at the end"
        )
