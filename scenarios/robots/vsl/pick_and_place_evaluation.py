"""Parameters of a pick and place, and its evaluation by ground truth."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handover.controllers.vsl.hybrid_kinematics import Method
from handover.controllers.vsl.pick_and_place import PHASES, TaskPhase
from handover.controllers.vsl.pick_and_place import Params as Task
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.plants.vsl.vacuum_gripper import Params as Gripper
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.experiment.exposed import expose
from handover.scenarios.robots.vsl.arms import unlike_lengths
from handover.scenarios.robots.vsl.evaluation import EXTRAPOLATION_TO_REPORT
from handover.scenarios.robots.vsl.training_data import beyond_loads, is_heavy

_TOUCHES = {"pick": (TaskPhase.DESCEND, TaskPhase.GRASP), "place": (TaskPhase.LOWER, TaskPhase.RELEASE)}
"""Parts of the task in which something is touched."""

_MAX_HEIGHT_ERROR = 0.01
"""How far from the height of the place an object is at most that lies there, m (assumed: deeper than it is pressed)."""

_ON_THE_WAY = (TaskPhase.CARRY, TaskPhase.SOFTEN)
"""Parts in which the object is to hang above the table."""

_HANGING = (TaskPhase.LIFT, *_ON_THE_WAY)
"""Parts in which it hangs freely: a face that presses on the gripper is in no training."""


@dataclass(frozen=True, kw_only=True)
class PickAndPlaceParameters:
    """One object that is picked up and put down."""

    mass: float = expose(Gripper, "gripper.mass", maximum=0.3)
    pick: Floats = expose(Task, "planner.p_WP", "gripper.p_WO_0", minimum=-1.0, maximum=1.0)
    place: Floats = expose(Task, "planner.p_WQ", minimum=-1.0, maximum=1.0)
    contact_pressure: float = expose(Task, "planner.p_contact")
    carry_pressure: float = expose(Task, "planner.p_carry")
    contact_speed: float = expose(Task, "planner.V_contact", minimum=0.005, maximum=0.3)
    speed: float = expose(Task, "planner.V", minimum=0.005, maximum=0.3)
    hover: float = expose(Task, "planner.hover", minimum=0.02, maximum=0.3)
    press: float = expose(Task, "planner.press", maximum=0.05)
    settle: float = expose(Task, "planner.settle")
    wait: float = expose(Task, "planner.wait", maximum=60.0)
    tolerance: Metre = parameter(
        0.01,
        "how far from its place the object may be, and be dragged over the table, for the run to count as a success",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("a quarter of the object's width; the tip of the trained arm has an error of 2 mm"),
    )

    @property
    def duration(self) -> float:
        """Nominal duration of the task, s."""
        down = self.hover + self.press
        way = float(np.linalg.norm(self.place - self.pick))
        return self.settle + 3.0 * self.wait + 2.0 * down / self.contact_speed + (2.0 * down + way) / self.speed

    def faults(self) -> list[str]:
        """Return what contradicts itself: one face carries the object at both places, and they differ."""
        faults: list[str] = []
        if self.pick[2] < 0.0:
            faults.append(f"pick: its height, {self.pick[2]:g} m, is below the ground, z = 0 in W")
        if self.pick[2] != self.place[2]:
            faults.append(f"place: its height, {self.place[2]:g} m, must be that of pick, {self.pick[2]:g} m")
        if np.array_equal(self.pick, self.place):
            faults.append("place: it must be another than pick")
        return faults


class PickAndPlaceEvaluator(Evaluator):
    """Follows one run: how hard the arm touches, how far it is from its goal while it carries, where the object is.

    Attributes:
        force: largest force of the face on the gripper or on what it holds, N, by touch.
        carried_off: largest distance of the tip while it carries from its goal, as the next one is set, m.
        dragged: length of the way over the table of the object that is held and touches it, on its way to its place, m.
    """

    def __init__(self, parameters: PickAndPlaceParameters) -> None:
        self.parameters = parameters
        self.force = dict.fromkeys(_TOUCHES, 0.0)
        self.carried_off = 0.0
        self.dragged = 0.0
        self._t = 0.0
        self._phase = 0
        self._was_held = self._held = self._done = False
        self._lengths, self._is_learned = "", True
        self._asked = self._outside = 0
        self._p_WO = np.array(parameters.pick)
        self._p_WG_goal: Floats | None = None
        """While it carries, where the tip is to be when the next goal is set."""

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep whether the kinematics use a learned model, and which links are not as long as they assume."""
        self._lengths = unlike_lengths(units)
        method = units["kinematics"].start.get("method") if "kinematics" in units else None
        self._is_learned = str(method).upper() not in ("MODEL_BASED", str(int(Method.MODEL_BASED)))

    def __call__(self, t: float, signals: Signals) -> None:
        """Take in what is touched, carried and put down."""
        self._t, self._phase = t, int(signals["planner.phase"])
        self._held, self._done = bool(signals["gripper.held"]), bool(signals["planner.done"])
        self._was_held = self._was_held or self._held
        if self._is_learned and self._held and self._phase in _HANGING and "kinematics.outside" in signals:
            self._asked += 1
            self._outside += bool(signals["kinematics.outside"]) or is_heavy(self.parameters.mass)
        p_WO = np.array(signals["gripper.p_WO"])
        if self._held and self._phase in _ON_THE_WAY and signals["arm.f_G"] > 0.0:
            self.dragged += float(np.hypot(*(p_WO - self._p_WO)[:2]))
        self._p_WO = p_WO
        for touch, phases in _TOUCHES.items():
            if self._phase in phases:
                self.force[touch] = max(self.force[touch], float(signals["arm.f_G"]))
        goal, carrying = signals["planner.p_WG_goal"], self._phase == TaskPhase.CARRY
        if self._p_WG_goal is not None and not (carrying and np.array_equal(goal, self._p_WG_goal)):
            off = float(np.linalg.norm(signals["arm.p_WG"] - self._p_WG_goal))
            self.carried_off = max(self.carried_off, off)
        self._p_WG_goal = np.array(goal) if carrying else None

    @property
    def over(self) -> bool:
        """Whether the task has ended and the object lies."""
        return self._done and abs(float(self._p_WO[2] - self.parameters.place[2])) < _MAX_HEIGHT_ERROR

    @property
    def place_error(self) -> float:
        """Horizontal distance of the object from where it is to be put down, m."""
        return float(np.hypot(*(self._p_WO - self.parameters.place)[:2]))

    def outcome(self) -> Outcome:
        """Return whether the object lies where it is to lie, and was not dragged there."""
        put_down = self.over and self._was_held and not self._held
        success = put_down and max(self.place_error, self.dragged) <= self.parameters.tolerance
        reason = self._reason(put_down) + self._extrapolated + self._lengths
        return Outcome(success=success, reason=reason, metrics=self._metrics())

    @property
    def _extrapolated(self) -> str:
        """That the model was asked about what it was not trained on, as the end of a sentence."""
        share = self._outside / max(self._asked, 1)
        if share < EXTRAPOLATION_TO_REPORT:
            return ""
        text = f"; the model had to extrapolate for {100 * share:.0f} % of the way with the object"
        return text + beyond_loads(self.parameters.mass)

    def _reason(self, put_down: bool) -> str:
        if put_down:
            forces = f"touched with {self.force['pick']:.2f} N and {self.force['place']:.2f} N"
            tolerance, off, dragged = self.parameters.tolerance, self.place_error, self.dragged
            above = f", above the tolerance of {1000 * tolerance:.3g} mm"
            reason = f"the object lies {1000 * off:.1f} mm from its place{above if off > tolerance else ''}; {forces}"
            drag = f"; it came down too early and was dragged over {1000 * dragged:.0f} mm of the table{above}"
            return f"{reason}{drag if dragged > tolerance else ''}"
        if self._done:
            return "the object was never picked up" if not self._was_held else "the object did not come to rest"
        held = "with the object" if self._held else "without the object"
        return f"stopped at {self._t:.1f} s as it was to {PHASES[self._phase]}, {held}"

    def _metrics(self) -> dict[str, Metric]:
        what = "largest force as the tip comes down to"
        outside = "share of the time with the object for which the model had to extrapolate, by inputs or its mass"
        return {
            **({"outside": Metric(self._outside / self._asked, "1", outside)} if self._asked else {}),
            "pick_force": Metric(self.force["pick"], "N", f"{what} the object"),
            "place_force": Metric(self.force["place"], "N", f"{what} put it down"),
            "place_error": Metric(self.place_error, "m", "horizontal distance of the object from its place at the end"),
            "carry_error": Metric(self.carried_off, "m", "largest distance of the tip from its goal while it carries"),
            "dragged": Metric(
                self.dragged, "m", "way of the object over the table while it is held, on the way to its place"
            ),
            "picked_up": Metric(float(self._was_held), "1", "whether the object was picked up"),
        }
