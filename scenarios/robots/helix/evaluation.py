"""Evaluates a Helix handover by ground truth, which the arm's controller does not see.

Besides the verdict, `HandoverEvaluator` measures how far the controller's model of the arm is from the arm that
the cameras see ([Vervloet2025] sec. 4.2, fig. 9), and keeps marked pictures of all cameras.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.robots.helix.disturbances import Cover
from handover.scenarios.robots.helix.marked_pictures import is_covered, take_pictures
from handover.scenarios.robots.helix.parameters import Parameters

FIG_9_RESOLUTION = 0.01
"""To which the thesis gives the lengths of fig. 9, m."""


class ModelMismatch(NamedTuple):
    """Distances of fig. 9, m: of gripper and model from the gripper's position after calibration, and between them."""

    arm_travel: float
    model_travel: float
    apart: float


def model_mismatch(q_sys: Floats, p_WG_est: Floats) -> ModelMismatch:
    """Compare the gripper of the commanded state, f(q_sys), with the filtered measured one.

    Args:
        q_sys: commanded state, shape (9,), rad and m.
        p_WG_est: filtered measured position of the gripper in W, shape (3,), m.
    """
    servo = vars(ServoParams())
    d_gripper = float(servo["d_gripper"])
    p_WG_sys = (W_FROM_B * forward_kinematics(q_sys, d_gripper))[3:]
    p_WG_calib = np.array([0.0, 0.0, -sum(servo["l_calib"]) - d_gripper])
    between = (p_WG_est - p_WG_calib, p_WG_sys - p_WG_calib, p_WG_sys - p_WG_est)
    return ModelMismatch(*(float(np.linalg.norm(d)) for d in between))


_SETTLING = 1.0
"""How long the ball must stay in the closed gripper, s (assumed)."""

_LETTING_GO = 2.0
"""How long the person may take to let go once the gripper has closed, s (assumed)."""

_NOTHING_SEEN = 10.0
"""How long the controller may wait for its first sight of ball and ring, s (assumed)."""

_GRIP_CLOSED = 0.999
"""Closure at which a gripper has closed, of a controller that does not say so."""

_RECENT = 10.0
"""Time before the end whose least distance is reported where time ran out, s: once or twice as long."""

_BROUGHT = 0.01
"""Distance of ball and closing gripper from which a success tells that the person brought the ball, m."""

_MOMENTS = {"APPROACH": "approach", "DESCEND": "descent", "GRASP": "gripper begins to close", "CARRY": "carrying"}
_COVERED = "lens covered"


_WHY_GIVEN_UP = {
    "NO_PROGRESS": "no progress",
    "OUT_OF_REACH": "out of reach",
    "LIMITS": "limits of the command",
    "LOST_RING": "lost ring",
    "LOST_BALL": "lost ball",
}
"""By the controller's verdict."""


def phase_of(signals: Signals) -> str:
    """Return the controller's phase; of one that gives none, what the gripper shows: APPROACH, GRASP or HOLD."""
    if "servo.phase" in signals:
        return signals.text("servo.phase")
    if float(signals["arm.grip"]) >= _GRIP_CLOSED:
        return "HOLD"
    return "GRASP" if "servo.closure" in signals and float(signals["servo.closure"]) > 0.0 else "APPROACH"


class HandoverEvaluator(Evaluator):
    """Follows one handover, keeps pictures of its key moments, and decides whether it succeeded.

    A controller may have other outputs than `VisualServo`: see the scenario's places.

    Attributes:
        phases: the controller's phases and when each was first entered, in s; for one without phases, see `phase_of`.

    Args:
        parameters: the scenario's.
        pictures: those that were kept, where a record is evaluated, which has no pictures; None: they are taken.
    """

    records = (CameraPicture, Mark, ModelMismatch)

    def __init__(self, parameters: Parameters, pictures: Sequence[CameraPicture] | None = None) -> None:
        self.parameters = parameters
        self._pictures = list(pictures or ())
        self._takes = pictures is None
        self.phases: dict[str, float] = {}
        self._t = 0.0
        self._phase = ""
        self._verdict = ""
        self._holder = ""
        self._has_seen = False
        self._p_WG: Floats = np.zeros(3)
        self._p_WO: Floats = np.zeros(3)
        self._p_GO: Floats = np.zeros(3)
        self._p_GO_closed: Floats = np.zeros(3)  # when the gripper was closed, the first time
        self._offset: Floats | None = None  # p_GO when the hand let go
        self._mismatch: ModelMismatch | None = None  # when the gripper began to close
        self._error = 0.0
        self._gives_error = False
        self._nearest = [np.inf, np.inf]  # error in the present interval of _RECENT, and in the one before
        self._unseen = {"ball": 0.0, "ring": 0.0}  # time for which vision did not see them, s
        self._ever_seen = {"ball": False, "ring": False}
        self._tilt = 0.0
        self._grasp_began: float | None = None  # the last time
        self._closing_distance = 0.0  # then
        self._released_at: float | None = None
        self._hand_force = 0.0  # largest on the hand
        self._pressing = 0.0  # likewise, while the arm touches the hand or what it holds
        self._control_period: float | None = float(parameters.period)  # s; None: the controller tells of none

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Take in by which period the controller counts its steps; another one than `VisualServo` may have none."""
        servo = units.get("servo")
        period = None if servo is None else servo.start.get("control_period")
        ticks_otherwise = servo is not None and servo.description.sampled and servo.description.step != period
        self._control_period = None if ticks_otherwise else period

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases and positions."""
        phase, holder = phase_of(signals), signals.text("hand.holder")
        self._verdict = signals.text("servo.verdict") if "servo.verdict" in signals else ""
        self._has_seen = True
        self._p_WG, self._p_WO = signals["arm.p_WG"], signals["hand.p_WO"]
        self._p_GO = np.transpose(rotation_of(signals["arm.q_WG"])) @ (self._p_WO - self._p_WG)
        self._gives_error = "servo.error" in signals
        self._error = float(signals["servo.error"]) if self._gives_error else self.distance
        self._follow_approach(t, phase, signals)
        self._t = t
        if not self._pictures:
            self._keep("start", signals)
        if phase in _MOMENTS and phase not in self.phases:
            self._keep(_MOMENTS[phase], signals)
        compares = "servo.q_sys" in signals and "servo.p_WG_est" in signals
        if phase == "GRASP" and self._phase != "GRASP":  # also again, where the gripper had to open
            self._grasp_began, self._closing_distance = t, self.distance
            self._mismatch = model_mismatch(signals["servo.q_sys"], signals["servo.p_WG_est"]) if compares else None
        if self._is_first_covered(t):
            self._keep(_COVERED, signals)
        if phase == "HOLD" and phase not in self.phases:
            self._p_GO_closed = self._p_GO
        self.phases.setdefault(phase, t)
        if holder == "GRIPPER" and self._released_at is None:
            self._released_at, self._offset = t, self._p_GO
        self._phase, self._holder = phase, holder
        if "hand.f_H" in signals:
            force = float(np.linalg.norm(signals["hand.f_H"]))
            self._hand_force = max(self._hand_force, force)
            if "hand.f_G" not in signals or np.any(signals["hand.f_G"]):
                self._pressing = max(self._pressing, force)

    def _follow_approach(self, t: float, phase: str, signals: Signals) -> None:
        """Keep how near the arm has come of late, how it is tilted, and for how long ball and ring were not seen."""
        if t // _RECENT > self._t // _RECENT:
            self._nearest = [np.inf, self._nearest[0]]
        if phase in ("APPROACH", "DESCEND"):
            self._nearest[0] = min(self._nearest[0], self._error)
        self._tilt = float(signals["servo.tilt"]) if "servo.tilt" in signals else 0.0
        for what, signal in (("ball", "vision.seen_O"), ("ring", "vision.seen_R")):
            if signal not in signals or signals[signal]:
                self._ever_seen[what] = True
            else:
                self._unseen[what] += t - self._t

    def finish(self, signals: Signals) -> None:
        """Keep the last picture."""
        self._keep("end", signals)

    def pictures(self) -> Sequence[CameraPicture]:
        """Return what the cameras saw at the start, on first entering a phase, through a covered lens, and at the end.

        Moments that were not reached, or that coincide with another, are left out.
        """
        return tuple(self._pictures)

    def _keep(self, role: str, signals: Signals) -> None:
        if self._takes and all(picture.t != self._t for picture in self._pictures):
            self._pictures += take_pictures(self._t, role, self.parameters, signals)

    def _is_first_covered(self, t: float) -> bool:
        """Return whether a lens is covered in the current pictures, for the first time."""
        p = self.parameters
        if p.cover is Cover.NONE or any(picture.role == _COVERED for picture in self._pictures):
            return False
        return is_covered(t, p.cover, p)

    @property
    def over(self) -> bool:
        """Whether the handover is decided.

        The gripper has kept the ball for a while, the ball fell or stays in the hand, the arm pressed too hard, the
        controller gave up, or time is over.
        """
        if self._phase == "GIVEN_UP" or self._t >= self._deadline:
            return True
        if self._released_at is not None:
            return self._t >= self._released_at + _SETTLING
        if self._holder == "FREE" or self._is_pressed:
            return True
        closed = self.phases.get("HOLD")
        return closed is not None and self._t >= closed + _LETTING_GO

    @property
    def _deadline(self) -> float:
        if self._phase == "WAIT":
            return min(_NOTHING_SEEN, self.parameters.patience)
        return np.inf if self._phase in ("GRASP", "HOLD") else self.parameters.patience

    @property
    def _is_pressed(self) -> bool:
        """Whether the arm has pressed harder on the hand than the person lets it."""
        return self._pressing > self.parameters.hand_force_max

    @property
    def distance(self) -> float:
        """Distance between gripper and ball by ground truth, m."""
        return float(np.linalg.norm(self._p_WG - self._p_WO))

    def outcome(self) -> Outcome:
        """Return whether the gripper has the ball, why, and the metrics."""
        success = self._holder == "GRIPPER" and not self._is_pressed
        return Outcome(success=success, reason=self._reason(success), metrics=self._metrics())

    def _metrics(self) -> dict[str, Metric]:
        grasp_began = self._grasp_began
        metrics: dict[str, Metric] = {}
        if self._has_seen:  # else the run failed before anything was there to be measured
            metrics["final_distance"] = Metric(self.distance, "m", "gripper to ball at the end, ground truth")
        approached = bool(self.phases.keys() & {"APPROACH", "DESCEND"})
        if self._gives_error and approached:  # else it never saw ball and arm, and its error means nothing
            metrics["controller_error"] = Metric(self._error, "m", "error that the controller saw last")
        if grasp_began is not None:
            metrics["arm_time"] = Metric(grasp_began, "s", "from the start until the gripper begins to close")
            if self._control_period is not None and not self.parameters.jitter:
                steps = round(grasp_began / self._control_period) + 1
                metrics["steps"] = Metric(steps, "1", "control steps until the gripper begins to close")
            metrics["closing_distance"] = Metric(
                self._closing_distance, "m", "gripper to ball when the gripper begins to close, ground truth"
            )
        if self._released_at is not None:
            metrics["handover_time"] = Metric(self._released_at, "s", "from the start until the ball leaves the hand")
        if self._hand_force > 0.0:
            metrics["hand_force"] = Metric(self._hand_force, "N", "largest force on the hand, with the ball's weight")
        if self._mismatch is not None:
            metrics |= _mismatch_metrics(self._mismatch)
        if self._offset is not None:
            lateral, axial = beside_and_along(self._offset)
            metrics["grasp_offset_lateral"] = Metric(
                lateral, "m", "ball beside the gripper's axis when it left the hand, ground truth"
            )
            metrics["grasp_offset_axial"] = Metric(
                axial, "m", "ball along the gripper's axis, towards its tip, when it left the hand, ground truth"
            )
        return metrics

    def _why_given_up(self) -> str:
        return _WHY_GIVEN_UP.get(self._verdict, "given up")

    def _reason(self, success: bool) -> str:
        if success:
            taken = f"the ball left the hand at {self._released_at:.1f} s and the gripper holds it"
            if self.parameters.help_speed > 0.0 and self._closing_distance > _BROUGHT:
                taken += f"; it was {self._closing_distance:.3f} m away as the gripper began to close, and was brought"
            return taken
        where = f"ball at {_format_point(self._p_WO)} m, gripper at {_format_point(self._p_WG)} m"
        if self._phase == "WAIT" and self._t >= self._deadline:
            unseen = " and ".join(what for what, seen in self._ever_seen.items() if not seen) or "ball and ring at once"
            return f"the cameras did not see {unseen} within {self._deadline:.0f} s; {where}"
        if self._phase == "GIVEN_UP":
            return f"{self._why_given_up()}: the gripper stays {self._error:.3f} m from its goal; {where}"
        if self._is_pressed:
            most = self.parameters.hand_force_max
            return (
                f"the arm pressed on the hand with {self._pressing:.1f} N, and a person tolerates {most:g} N; {where}"
            )
        if self._released_at is not None:
            return f"the ball left the hand at {self._released_at:.1f} s, and the gripper did not keep it; {where}"
        if self._holder == "FREE":
            return f"the ball was pushed out of the hand at {self._t:.1f} s; {where}"
        if "HOLD" in self.phases:
            lateral, axial = beside_and_along(self._p_GO_closed)
            return (
                f"the gripper closed with the ball {lateral:.3f} m beside its axis and {axial:+.3f} m along it, and "
                f"its fingers did not keep it; the hand kept the ball, {self.distance:.3f} m away at the end"
            )
        if self._t < self._deadline:
            return f"stopped at {self._t:.1f} s in phase {self._phase}, before the handover was done"
        return f"{self._why_too_late()}; {where}"

    def _why_too_late(self) -> str:
        """Return why a run's patience ended before the gripper closed for good."""
        patience, nearest = self.parameters.patience, min(self._nearest)
        lost, unseen = max(self._unseen.items(), key=lambda item: item[1])
        if self._phase == "RECOVER" or unseen > 0.5 * self._t:
            return f"lost {lost}: of {patience:.0f} s it was not seen for {unseen:.0f} s"
        goal = "its goal" if self._gives_error else "the ball"
        tilted = f", tilted by {np.degrees(self._tilt):.0f}°" if self._tilt else ""
        why = "out of reach or too slow" if nearest > 2 * self.parameters.threshold else "time ran out"
        came = f"of late the gripper was {nearest:.3f} m from {goal} at the nearest"
        return f"{why}: {came}, and {self._error:.3f} m after {patience:.0f} s{tilted}"


def _mismatch_metrics(m: ModelMismatch) -> dict[str, Metric]:
    start = "place after calibration when the gripper begins to close, as in fig. 9"
    return {
        "model_mismatch": Metric(
            m.apart, "m", "gripper of the commanded state f(q_sys) to the measured one when the gripper begins to close"
        ),
        "model_travel": Metric(m.model_travel, "m", f"gripper of the commanded state f(q_sys) from its {start}"),
        "arm_travel": Metric(m.arm_travel, "m", f"measured gripper from its {start}"),
    }


def beside_and_along(p_GO: Floats) -> tuple[float, float]:
    """Return how far a point in the gripper's frame, shape (3,), is from its axis, and along it to the tip, m."""
    return float(np.hypot(p_GO[0], p_GO[1])), float(p_GO[2])


def _format_point(p: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in p) + ")"
