"""Evaluates an infrared grasp by ground truth, which the hand's controller does not see."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from handover.controllers.ir_grasp.parameters import Correction, Strategy
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.plants.ir_grasp.hand import sensor_rays
from handover.plants.ir_grasp.parameters import OUT_OF_RANGE
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.robots.ir_grasp.parameters import Parameters, pregrasp_position

_SETTLING = 0.3
"""How long the hand rests after the shake, s (assumed)."""

_BODIES = 2
"""How many of palm and phalanges must touch an object that is held (assumed): one alone can only push."""

_LEFT_BEHIND = 0.04
"""How far an object that is held may have stayed behind the hand since the pull began, m (assumed): less than the
width of [Luberto]'s objects and the fingers on them, so that it is still where they closed."""

_PUSHED = 0.02
"""How far an object is pushed before the hand closes from which the verdict says so, m (assumed): a finger's width."""

_AT_LIMIT = 0.9
"""Part of its reach from which the wrist stands at its limit: the last step may have been held back (assumed)."""

_AXES = (("x", "m"), ("y", "m"), ("heading", "rad"))
"""Directions of the wrist's reach, in W."""

_COST = "cost f of thumb and ring as the hand began to close, [Luberto] eq. (4)"

_STEPS = {
    Correction.PAPER: "Gauss-Newton steps",
    Correction.FAST: "control periods in which both fingers of the cost saw the object",
}

_REFINED = "time from the first look at the sensors until the hand closes"

IN_COST = (0, 2)
"""Thumb and ring, the fingers in the cost, as indices of distances."""

_SIGNALS = {
    "final_cost": "reflex.cost",
    "steps": "reflex.steps",
    "stop": "reflex.stop",
    **{f"final_distance_{finger}": "reflex.distance" for finger in ("thumb", "index", "ring")},
}
"""By metric, the output of the controller that it takes; without it, it is left out."""

_AFTER_CLOSING = ("PULL", "SHAKE", "DONE")
_REFINING = ("CHECK", "APPROACH", "RECOVER", "PROBE", "STEP", "SEARCH", "TRACK")


def _where_below(values: Floats, ceiling: float) -> Floats:
    """Return values, NaN where they are at a ceiling that stands for nothing seen."""
    return np.where(values < ceiling, values, np.nan)


def _given(signals: Signals, name: str, shape: tuple[int, ...] = ()) -> Floats:
    """Return an output of the controller, zeros where it does not give it."""
    return signals[name] if name in signals else np.zeros(shape)


class GraspEvaluator(Evaluator):
    """Follows one grasp and decides whether it succeeded.

    Attributes:
        moments: times of `start`, `before closing`, `end`, in s, as far as the run reached them.
    """

    records = (Metric,)

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.moments: dict[str, float] = {}
        self._t = 0.0
        self._entered: dict[str, float] = {}
        self._phase = ""
        self._moves = {"RECOVER": 0, "APPROACH": 0, "PROBE": 0}
        self._command: tuple[float, ...] = ()
        self._p_WO_start: Floats = np.zeros(2)
        self._p_ground_start: Floats = np.zeros(2)
        self._p_HO: Floats = np.zeros(2)
        self._p_HO_closed: Floats | None = None  # in H, when the pull began
        self._touched = False
        self._touching = 0
        self._touching_closed = 0
        self._lost_in = ""
        self._at_start: dict[str, Metric] = {}
        self._at_closing: dict[str, Metric] = {}
        self._stop = ""
        self._displaced = 0.0
        self._reach: tuple[Floats, Floats] | None = None  # the pre-grasp pose, and how far the wrist may go from it
        self._at_limit = ""

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep the controller's reach about the pre-grasp pose, if it has such parameters."""
        reach = "fast_reach" if self.parameters.correction is Correction.FAST else "reach"
        given: Mapping[str, Any] = units["reflex"].start if "reflex" in units else {}
        if {"p_WH_pregrasp", "yaw_pregrasp"} <= given.keys():
            most = given.get(reach, getattr(ReflexParams(), reach))
            pregrasp = np.array([*np.asarray(given["p_WH_pregrasp"]), float(given["yaw_pregrasp"])])
            self._reach = (pregrasp, np.array(most, dtype=np.float64))

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow phases, hand and object."""
        self._t, phase = t, signals.text("reflex.phase")
        if not self.moments:
            self.moments["start"], self._p_WO_start = t, signals["scene.p_WO"]
            self._p_ground_start = signals["scene.p_ground"] if "scene.p_ground" in signals else np.zeros(2)
            self._at_start = self._vision_errors(signals)
        if phase != self._phase:
            self._enter(phase, signals)
        self._touched |= "CLOSE" not in self._entered and int(signals["scene.touching"]) > 0
        if phase in self._moves:
            self._count(phase, signals)
        elif phase in _AFTER_CLOSING:
            self._measure(signals)
            self._lost_in = "" if self._held else self._lost_in or phase

    def _vision_errors(self, signals: Signals) -> dict[str, Metric]:
        """Return how far the object was moved after vision saw it, and the errors of the pre-grasp pose by vision.

        Vision saw the object at W's origin in its reference pose. The hand starts a run-up behind the pre-grasp pose,
        with that pose's heading.
        """
        p, yaw = self.parameters, float(signals["scene.yaw"])
        pregrasp = signals["scene.p_WH"] + p.run_up * np.array([math.cos(yaw), math.sin(yaw)])
        turned = float(signals["scene.yaw_O"]) - p.solid.yaw
        off = float(np.linalg.norm(pregrasp - pregrasp_position(p.expected_solid, p.standoff)))
        moved = float(np.linalg.norm(signals["scene.p_WO"]))
        return {
            "moved": Metric(moved, "m", "how far the object was moved after vision saw it"),
            "turned": Metric(turned, "rad", "how far it was turned after vision saw it, counter-clockwise"),
            "vision_position_error": Metric(off, "m", "how far off vision put the pre-grasp position"),
            "vision_yaw_error": Metric(yaw, "rad", "how far off vision put the pre-grasp heading, counter-clockwise"),
        }

    def _enter(self, phase: str, signals: Signals) -> None:
        self._phase = phase
        self._entered.setdefault(phase, self._t)
        if phase == "CLOSE":
            self._close(self._t, signals)
        elif phase == "PULL":
            self._measure(signals)
            self._p_HO_closed, self._touching_closed = self._p_HO, self._touching

    def _measure(self, signals: Signals) -> None:
        self._touching = int(signals["scene.touching"])
        d_x, d_y = (signals["scene.p_WO"] - signals["scene.p_WH"]).tolist()
        yaw = float(signals["scene.yaw"])
        c, s = math.cos(yaw), math.sin(yaw)
        self._p_HO = np.array([c * d_x + s * d_y, c * d_y - s * d_x])

    def _close(self, t: float, signals: Signals) -> None:
        self.moments["before closing"] = t
        gives_stop = "reflex.stop" in signals
        self._stop = signals.text("reflex.stop").lower().replace("_", " ") if gives_stop else ""
        began = min((self._entered[p] for p in _REFINING if p in self._entered), default=t)
        seen = _where_below(_given(signals, "reflex.distance", (3,)), ReflexParams().distance_max)
        true = _where_below(signals["scene.range"], OUT_OF_RANGE)
        cost, blind = float(_given(signals, "reflex.cost")), bool(np.isnan(seen[list(IN_COST)]).any())
        p = self.parameters
        what_of_cost = _COST if p.literal else f"{_COST} of distances less their target"
        if blind:
            what_of_cost += " (thumb or ring sees nothing)"
        carried = signals["scene.p_ground"] - self._p_ground_start if "scene.p_ground" in signals else np.zeros(2)
        displaced = float(np.linalg.norm(signals["scene.p_WO"] - self._p_WO_start - carried))
        stop = int(_given(signals, "reflex.stop"))
        offset = self._offset(signals)
        self._displaced = displaced
        beyond = self._follow_limit(signals, offset) if self._stop == "reach" else {}
        metrics = {
            "final_cost": Metric(math.nan if blind else cost, "m2", what_of_cost),
            "steps": Metric(int(_given(signals, "reflex.steps")), "1", _STEPS[p.correction]),
            "refinement_time": Metric(
                t - began, "s", _REFINED if p.strategy is Strategy.REFLEX else "time from the pre-grasp pose to closing"
            ),
            "touched": Metric(
                int(self._touched), "1", "whether hand and object touched before the hand closed: 1 if so"
            ),
            "displacement": Metric(
                displaced, "m", "how far the object was pushed before the hand closed, less what the ground carried it"
            ),
            "offset_at_grasp": Metric(
                float(np.linalg.norm(offset)),
                "m",
                "distance of the object's middle from that of thumb's and ring's pads as the hand closes",
            ),
            "stop": Metric(stop, "1", f"why the refinement ended, by number: {stop} is {self._stop}"),
        }
        for i, finger in enumerate(("thumb", "index", "ring")):
            what = f"{finger} to object as the hand began to close"
            unseen = " (sees nothing)" if np.isnan(seen[i]) else ""
            unmet = " (meets nothing)" if np.isnan(true[i]) else ""
            metrics[f"final_distance_{finger}"] = Metric(float(seen[i]), "m", f"{what}, by [Luberto] eq. (11){unseen}")
            metrics[f"true_distance_{finger}"] = Metric(float(true[i]), "m", f"{what}, true along the beam{unmet}")
        metrics |= beyond
        self._at_closing = {name: m for name, m in metrics.items() if _SIGNALS.get(name, "scene.range") in signals}

    def _follow_limit(self, signals: Signals, offset: Floats) -> dict[str, Metric]:
        """Keep at which limit of its reach the wrist closes; return how far beyond the object is, if along an axis."""
        if self._reach is None or not np.any(self._reach[1] > 0.0):
            return {}
        pregrasp, reach = self._reach
        away = np.array([*signals["reflex.p_WH_cmd"], float(signals["reflex.yaw_cmd"])]) - pregrasp
        shares = np.abs(away) / np.where(reach > 0.0, reach, np.inf)
        k = int(np.argmax(shares))
        axis, unit = _AXES[k]
        if shares[k] < _AT_LIMIT:
            self._at_limit = "the next move would leave the wrist's reach"
            return {}
        scaled, shown = (1e3, "mm") if unit == "m" else (math.degrees(1.0), "°")
        how = f"{scaled * away[k]:+.0f} {shown} of at most {scaled * reach[k]:.0f} {shown}"
        self._at_limit = f"the wrist was at the limit of its reach in {axis}, {how} from the pre-grasp pose"
        if unit != "m":
            return {}
        beyond = math.copysign(1.0, away[k]) * float(offset[k])
        where = f"{1e3 * abs(beyond):.0f} mm {'beyond' if beyond > 0.0 else 'short of'} the fingers' middle"
        self._at_limit += f", and the object's middle {where} in {axis}"
        text = f"object's middle beyond that of thumb's and ring's pads in {axis}, the wrist at its limit there"
        return {"beyond_reach": Metric(beyond, "m", text)}

    def _offset(self, signals: Signals) -> Floats:
        """Return the object's middle, seen from the middle between the pads of thumb and ring, in W, m."""
        p_WH, yaw, yaw_O = signals["scene.p_WH"], float(signals["scene.yaw"]), float(signals["scene.yaw_O"])
        pads, _ = sensor_rays(p_WH, yaw, signals["scene.q"])
        x, y = self.parameters.solid.parts[0].centroid
        c, s = math.cos(yaw_O), math.sin(yaw_O)
        middle = signals["scene.p_WO"] + np.array([c * x - s * y, s * x + c * y])
        return middle - pads[list(IN_COST)].mean(axis=0)

    def _count(self, phase: str, signals: Signals) -> None:
        command = (
            *signals["reflex.p_WH_cmd"].tolist(),
            float(signals["reflex.yaw_cmd"]),
            float(signals["reflex.sigma_cmd"]),
        )
        if command != self._command:
            self._moves[phase] += 1
        self._command = command

    def finish(self, signals: Signals) -> None:  # noqa: ARG002
        """Keep the time of the end."""
        self.moments["end"] = self._t

    @property
    def over(self) -> bool:
        """Whether the shake is over and the hand has rested."""
        return "DONE" in self._entered and self._t >= self._entered["DONE"] + _SETTLING

    @property
    def _left_behind(self) -> float:
        """How far the object has come out of the hand since the pull began, m."""
        return math.inf if self._p_HO_closed is None else float(np.linalg.norm(self._p_HO - self._p_HO_closed))

    @property
    def _held(self) -> bool:
        return self._touching >= _BODIES and self._left_behind <= _LEFT_BEHIND

    def outcome(self) -> Outcome:
        """Return whether the object came along and is still in the hand, why, and the metrics."""
        metrics = {**self._at_closing, **self._at_start}
        unit_of_count = "moves" if self.parameters.correction is Correction.PAPER else "changes of the command"
        for phase, what in (("PROBE", "probing"), ("RECOVER", "recovering"), ("APPROACH", "approaching")):
            metrics[f"{what}_moves"] = Metric(self._moves[phase], "1", f"{unit_of_count} while {what}")
        if self._p_HO_closed is not None:
            metrics["left_behind"] = Metric(
                self._left_behind, "m", "how far the object moved in the hand since the pull began"
            )
        success = self.over and self._held
        return Outcome(success=success, reason=self._reason(success), metrics=metrics)

    def _reason(self, success: bool) -> str:
        if not self.over:
            return f"stopped at {self._t:.1f} s in phase {self._phase}, before the grasp was tried"
        closed, closed_at = self._p_HO_closed, self.moments.get("before closing")
        if closed is None and closed_at is None:
            return f"done at {self._entered['DONE']:.1f} s, before the hand closed"
        if closed_at is None:  # a controller of somebody's own, without the phase CLOSE
            refined = f"pulled back at {self._entered['PULL']:.1f} s"
        else:
            refined = f"closed at {closed_at:.1f} s{f' ({self._stop})' if self._stop else ''}"
            if self._at_limit:
                refined += f", as {self._at_limit}"
            if self._displaced > _PUSHED:
                refined += f", having pushed the object {1e3 * self._displaced:.0f} mm before"
        if success:
            return f"{refined}; the object came along with the hand and stayed in it"
        if closed is None:
            return f"{refined}; the hand was not pulled back"
        where = f"{1000 * closed[0]:.0f} mm ahead of the wrist and {1000 * closed[1]:+.0f} mm beside it"
        if self._touching_closed < _BODIES:
            how = "does not touch the object" if not self._touching_closed else "has the object outside its fingers"
            return f"{refined}; the closed hand {how}, {where}"
        during = {"PULL": "during the pull", "SHAKE": "during the shake"}.get(self._lost_in, "at the end")
        return f"{refined}; the object, {where}, slipped out of the closed hand {during}"
