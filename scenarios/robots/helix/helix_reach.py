"""How far the sagging Helix reaches: its controller with exact measurements, without cameras and a hand's tremor.

What this reaches, no picture keeps it from. [Vervloet2025] sec. 5.4.1 names the workspace as what limits a handover.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Metric, Outcome
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import Curve, TimeFigure, TimePlot, phases_of
from handover.scenarios.robots.helix.parameters import CAMERA_PERIOD, PUSHES, Parameters
from handover.scenarios.robots.helix.places import REACH_PLACES

_KNOWN = 1e-8
"""Variance of an exact measurement, m2; 0 would be of no measurement."""


@dataclass(frozen=True, kw_only=True)
class ReachParameters:
    """Where the gripper is to come."""

    azimuth: float = expose(Parameters, "azimuth", description="direction of the place from the arm's axis")
    radius: float = expose(Parameters, "radius", description="distance of the place from the arm's axis")
    height: float = expose(Parameters, "height", description="height of the place in W")
    alpha: float = expose(Parameters, "alpha")
    patience: float = expose(Parameters, "patience", description="time by which the gripper must be there")

    @property
    def p_WO(self) -> Floats:
        """The place in W, shape (3,), m."""
        return np.array([self.radius * np.cos(self.azimuth), self.radius * np.sin(self.azimuth), self.height])


class ReachEvaluator(Evaluator):
    """Sees whether the gripper settles at the place."""

    def __init__(self, parameters: ReachParameters) -> None:
        self.parameters = parameters
        self._t = 0.0
        self._phase = ""
        self._verdict = ""
        self._distance = np.inf
        self._tilt = 0.0

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow gripper, phase and verdict."""
        self._t, self._phase = t, signals.text("servo.phase")
        self._verdict = signals.text("servo.verdict").lower().replace("_", " ")
        self._distance = float(np.linalg.norm(signals["arm.p_WG"] - signals["hand.p_WO"]))
        self._tilt = float(signals["servo.tilt"])

    @property
    def over(self) -> bool:
        """Whether the gripper would close, the controller gave up, or patience ended."""
        return self._phase in ("GRASP", "GIVEN_UP") or self._t >= self.parameters.patience

    def outcome(self) -> Outcome:
        """Return whether it is there, and how near it is."""
        success = self._phase == "GRASP"
        metrics = {
            "final_distance": Metric(self._distance, "m", "gripper to the place at the end, ground truth"),
            "tilt": Metric(self._tilt, "rad", "angle of the gripper from straight down at the end"),
            "arm_time": Metric(self._t, "s", "from the start to the end"),
        }
        if success:
            return Outcome(success=True, reason=f"the gripper is there after {self._t:.1f} s", metrics=metrics)
        late = self._t >= self.parameters.patience
        why = f"not there within {self._t:.0f} s" if late else f"stopped at {self._t:.1f} s"
        why = self._verdict if self._phase == "GIVEN_UP" else why
        stays = f"{why}: the gripper stays {1e3 * self._distance:.0f} mm away"
        return Outcome(success=False, reason=stays, metrics=metrics)


class HelixReach(Experiment[ReachEvaluator]):
    """The controller gets the true positions of wrist, gripper and place; the hand is still."""

    name: ClassVar[str] = "helix_reach"
    title: ClassVar[str] = "how far the Helix reaches, with exact measurements instead of cameras"
    parameters_type: ClassVar[type[ReachParameters]] = ReachParameters
    units: ClassVar[Mapping[str, str]] = {"servo": "VisualServo", "arm": "TendonArm", "hand": "HandoverPartner"}
    places: ClassVar[Mapping[str, Place]] = REACH_PLACES
    headline: ClassVar[tuple[str, ...]] = ("final_distance", "tilt", "arm_time")
    is_seeded: ClassVar[bool] = False
    parallel_step: ClassVar[Fraction | None] = Fraction(1, 50)

    def build(self, parameters: ReachParameters, seed: int, fmu: FmuOf) -> System:  # noqa: ARG002
        """Wire arm and controller directly."""
        s, known = System(), _KNOWN * np.eye(3)
        servo = s.add(
            "servo",
            fmu("servo"),
            period=3 * CAMERA_PERIOD,
            sampled=True,
            seen_O=True,
            seen_R=True,
            cov_O=known,
            cov_R=known,
            cov_G=known,
            threshold_accept=0.0,  # near is not there
        )
        arm = s.add("arm", fmu("arm"))
        hand = s.add("hand", fmu("hand"), p_WO_0=parameters.p_WO, room=0.0, tremor_rms=0.0, drift_rms=0.0)
        s.connect(hand.y.p_WO, servo.u.p_WO_meas)
        s.connect(arm.y.p_WR, servo.u.p_WR_meas)
        s.connect(arm.y.p_WG, servo.u.p_WG_meas)
        s.connect(servo.y.dl_t, arm.u.dl_t)
        return s

    def stop_time(self, parameters: ReachParameters) -> Fraction:
        """Return the end of the patience."""
        return Fraction(math.ceil(parameters.patience))

    def evaluator(self, parameters: ReachParameters) -> ReachEvaluator:
        """Return the evaluator of one place."""
        return ReachEvaluator(parameters)

    def pushes(self, parameters: ReachParameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return the gripper."""
        return PUSHES

    def replay(self, parameters: ReachParameters, record: Record) -> Replay:  # noqa: ARG002
        """Return arm, gripper and the place, as a ball in a hand."""
        from handover.scenarios.robots.helix.replay import replay_handover  # matplotlib and SciPy are slow to import

        return replay_handover(record)

    def time_figures(self, parameters: ReachParameters, record: Record) -> list[TimeFigure]:  # noqa: ARG002
        """Return the gripper's distance over time."""
        apart = 1e3 * np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
        phases = phases_of(record, "servo.phase") if "servo.phase" in record else ()
        distance = TimePlot(
            title="Gripper to the place",
            quantity="distance",
            unit="mm",
            curves=[Curve(label="distance", values=np.asarray(apart, dtype=np.float64))],
            phases=phases,
        )
        caption = "Distance of the gripper from the place over time, by ground truth."
        return [TimeFigure(name="distance", caption=caption, plots=[distance])]
