"""A hand offers a ball; the Helix finds it with two cameras and takes it. [Vervloet2025] sec. 3.5.1.

The thesis's own results for such a handover are those of table 1 and sec. 5.2 (`published_values`). Starts in which
ball or hand is in the arm or its gripper are refused: the arm hangs straight then, its gripper open, and the units
simulate how ball, palm and fingers touch, not how they separate.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.system import PlacedUnit, System
from handover.plants.helix.gripper_fingers import KNUCKLE, LINK_RADIUS, PALM_RADIUS, finger_joints
from handover.plants.helix.hand.partner_parameters import Params as PartnerParams
from handover.plants.helix.hand.partner_parameters import place_aside
from handover.scenarios.experiment.experiment import Experiment, Figure, FmuOf
from handover.scenarios.experiment.exposed import carry
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.experiment.paper import PublishedValue, paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.starts import array_of, penetration_fault
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.helix.cameras import calibrated, camera_parameters, marker_fault, pinholes
from handover.scenarios.robots.helix.disturbances import Disturbances
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator
from handover.scenarios.robots.helix.parameters import PUSHES, Parameters, StepRule, Tuning
from handover.scenarios.robots.helix.places import PLACES

_OF_ARM = {"tendon_length", "d_gripper", "d"}
_OF_HAND = {"p_WO_0", "p_OH", "room", "ball_radius", "palm_radius"}
_HANGING = np.diag([1.0, -1.0, -1.0])
"""Orientation of the gripper of an arm that hangs straight: z_G points down."""
_RIM = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)


def start_faults(units: Mapping[str, PlacedUnit]) -> list[str]:
    """Return where ball or palm would start in the arm or the gripper, with depth and the way out.

    The palm is a disc without thickness, of which its middle and 48 points are looked at. What a unit in the place of
    arm or hand does not have is not checked.
    """
    arm, hand = units.get("arm"), units.get("hand")
    if arm is None or not arm.description.parameters.keys() >= _OF_ARM:
        return []
    if hand is None or not hand.description.parameters.keys() >= _OF_HAND:
        return []
    offered, room = array_of(hand, "p_WO_0"), float(array_of(hand, "room")[0])
    p_WO = offered + place_aside(offered, room)
    radius, palm = float(array_of(hand, "ball_radius")[0]), float(array_of(hand, "palm_radius")[0])
    rim = np.stack([np.cos(_RIM), np.sin(_RIM), np.zeros(len(_RIM))], axis=1)
    disc = p_WO + array_of(hand, "p_OH") + palm * np.vstack([np.zeros(3), 0.5 * rim, rim])
    faults: list[str] = []
    for what, points, around in (("the ball", p_WO[np.newaxis], radius), ("the palm", disc, 0.0)):
        found = [(where, *_deepest(points, around, a, b, r)) for where, a, b, r in _capsules(arm)]
        where, depth, out = max(found, key=lambda one: one[1])
        faults.append(penetration_fault(f"{hand.name}.p_WO_0", f"{what} would start", where, depth, out))
    way = f", or let {hand.name}.room be larger than {room:g} m"
    return [fault + way for fault in faults if fault]


def _capsules(arm: PlacedUnit) -> list[tuple[str, Floats, Floats, float]]:
    """Return the hanging arm with its open gripper: names, both ends in W and radii of capsules, m."""
    wrist = np.array([0.0, 0.0, -float(np.sum(array_of(arm, "tendon_length")))])
    p_WG = wrist - np.array([0.0, 0.0, float(array_of(arm, "d_gripper")[0])])
    knuckle = p_WG + np.array([0.0, 0.0, KNUCKLE])
    links = [
        ("the gripper's finger", joints[i], joints[i + 1], LINK_RADIUS)
        for joints in finger_joints(p_WG, _HANGING, 0.0)
        for i in range(2)
    ]
    body = float(array_of(arm, "d")[0])
    return [("the arm", np.zeros(3), wrist, body), ("the gripper's palm", wrist, knuckle, PALM_RADIUS), *links]


def _deepest(points: Floats, around: float, a: Floats, b: Floats, radius: float) -> tuple[float, Floats]:
    """Return how deep the deepest of some balls, of one radius, is in a capsule from a to b, m, and the way out."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    apart = points - (a + share[:, np.newaxis] * along)
    distances = np.linalg.norm(apart, axis=1)
    i = int(np.argmin(distances))
    out = apart[i] / distances[i] if distances[i] > 0.0 else np.array([1.0, 0.0, 0.0])
    return around + radius - float(distances[i]), out


_PAPER = "helix"


def published_values(p: Parameters) -> Sequence[PublishedValue]:
    """Return the times and steps of table 1 for its step sizes, and for the smallest of them the model's error.

    Nothing for other step sizes, other places of ball or cameras, other markers, or where anything is disturbed.
    """
    published, default = paper_values(_PAPER, "experiment"), Parameters()
    matches = np.flatnonzero(np.isclose(published["alpha"], p.alpha))
    compared = [f.name for f in fields(Disturbances) if f.name != "help_speed"] + [
        "azimuth",
        "radius",
        "height",
        "marker",
        "rings",
        "cameras",
    ]
    if not len(matches) or any(getattr(p, name) != getattr(default, name) for name in compared):
        return ()
    k = int(matches[0])
    period = paper_values(_PAPER, "published")["timestep_mean"][k]
    differences = [] if np.isclose(p.control_period, period) else [f"its control period was {period:g} s"]
    differences += [] if p.tuning is Tuning.THESIS else ["its settings were those of tuning=thesis"]
    note = " and ".join(differences)
    span = ("arm_time_min", "arm_time_max")
    values = [
        PublishedValue(metric="arm_time", paper=_PAPER, name="arm_time_median", index=(k,), span=span, note=note),
        PublishedValue(
            metric="steps", paper=_PAPER, name="steps_median", index=(k,), note=" and ".join(differences[-1:])
        ),
    ]
    if k == 0:
        values += [
            PublishedValue(metric=metric, paper=_PAPER, name=metric, note="of one run, whose place is not stated")
            for metric in ("model_mismatch", "arm_travel", "model_travel")
        ]
    return values


_CLOSING = 15
"""Time after the approach, s: 10 to close, 3 for person and ball (`HandoverEvaluator`), and 2 to spare."""


class HelixHandover(Experiment[HandoverEvaluator]):
    """The thesis's first experiment: one automated human-to-robot handover."""

    name: ClassVar[str] = "helix_handover"
    title: ClassVar[str] = "the Helix takes a ball from a hand by visual servoing"
    parameters_type: ClassVar[type[Parameters]] = Parameters
    units: ClassVar[Mapping[str, str]] = {
        "camera": "StereoCamera",
        "vision": "HandoverVision",
        "servo": "VisualServo",
        "arm": "TendonArm",
        "hand": "HandoverPartner",
    }
    places: ClassVar[Mapping[str, Place]] = PLACES
    headline: ClassVar[tuple[str, ...]] = (
        "final_distance",
        "closing_distance",
        "grasp_offset_lateral",
        "grasp_offset_axial",
        "steps",
        "arm_time",
        "handover_time",
        "cpu_per_cycle",
        "pace_arm",
        "peak_memory",
    )
    parallel_step: ClassVar[Fraction | None] = Fraction(1, 100)

    def build(self, parameters: Parameters, seed: int, fmu: FmuOf) -> System:
        """Wire arm, hand, cameras, vision and controller."""
        s = self.without_measurements(parameters, seed, fmu)
        s.connect(s.units["vision"].y, s.units["servo"].u)
        return s

    def without_measurements(self, p: Parameters, seed: int, fmu: FmuOf, **of_cameras: Any) -> System:
        """Wire all but what the controller gets of vision; the cameras may have more values set."""
        hand_seed, camera_seed, click_seed, servo_seed = (
            int(n) for n in np.random.SeedSequence(seed).generate_state(4) >> 1
        )
        # OpenCV is slow to import, and lists import this.
        from handover.controllers.helix.vision.calibration import TooFewCorners
        from handover.scenarios.robots.helix.workspace import notes_on_place

        s = System()
        s.notes += notes_on_place(p.p_WO, p.cameras, p.marker)
        try:
            calibration = calibrated(p.click_noise, click_seed, p.box_height, p.cameras)
        except TooFewCorners as e:
            s.add_fault(f"box_height = {p.box_height:g} m: {e}")
            calibration = camera_parameters(places=p.cameras)
        weight = p.ball_mass * PartnerParams().gravity
        if weight >= p.hand_force_max:
            s.add_fault(f"hand_force_max = {p.hand_force_max:g} N: it must exceed the ball's weight, {weight:.3g} N")
        if fault := marker_fault(p.marker):
            s.add_fault(f"marker = {p.marker:g} m: {fault}")
        camera = s.add(
            "camera",
            fmu("camera"),
            period=p.picture_period,
            seed=camera_seed,
            **camera_parameters(p.camera_turn, p.cameras),
            **p.camera_values(),
            **of_cameras,
        )
        vision = s.add("vision", fmu("vision"), period=p.picture_period, **calibration)
        settings = p.settings
        servo = s.add(
            "servo",
            fmu("servo"),
            period=p.picture_period if settings["filter_pictures"] or p.jitter > 0.0 else p.period,
            sampled=True,
            control_period=float(p.period),
            adaptive_step=p.step_rule is StepRule.BY_ERROR,
            seed=servo_seed,
            **settings,
        )
        arm = s.add("arm", fmu("arm"), **p.arm_values())
        hand = s.add("hand", fmu("hand"), seed=hand_seed, **p.hand_values(p.p_WO))
        s.connect(arm.y, camera.u)
        s.connect(hand.y, camera.u)
        for side in p.cameras.sides:
            s.connect(getattr(camera.y, side), getattr(vision.u, side))
        s.connect(servo.y, arm.u)
        s.connect(hand.y, arm.u)
        s.connect(arm.y, hand.u)
        return carry(p, s)

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:  # noqa: ARG002
        """Reject a ball or a hand that starts in the arm or its gripper.

        Raises:
            InvalidParameter: with depth and the way out.
        """
        if faults := start_faults(system.units):
            raise InvalidParameter(faults)

    def stop_time(self, parameters: Parameters) -> Fraction:
        """Return the end of the patience for the approach, plus time for closing the gripper."""
        return Fraction(math.ceil(parameters.patience)) + _CLOSING

    def evaluator(self, parameters: Parameters) -> HandoverEvaluator:
        """Return the evaluator of one handover."""
        return HandoverEvaluator(parameters)

    def evaluator_of_record(self, parameters: Parameters, pictures: Sequence[CameraPicture]) -> HandoverEvaluator:
        """Return an evaluator with the pictures that the run's folder keeps."""
        return HandoverEvaluator(parameters, pictures)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robot's computer: vision and control."""
        return ("vision", "servo")

    def published(self, parameters: Parameters) -> Sequence[PublishedValue]:
        """Return the values of table 1 and fig. 9."""
        return published_values(parameters)

    def draw(self, parameters: Parameters, evaluator: HandoverEvaluator, record: Record, folder: Path) -> list[Figure]:  # noqa: ARG002
        """Draw the camera pictures of some moments."""
        from handover.scenarios.robots.helix.plots import draw_pictures  # matplotlib is slow to import

        pictures = evaluator.pictures()
        return [draw_pictures(pictures, parameters.cameras.above, folder)] if pictures else []

    def time_figures(self, parameters: Parameters, record: Record) -> list[TimeFigure]:
        """Return distance to the goal, positions, tendons and gripper over time."""
        from handover.scenarios.robots.helix.plots import figures_of_handover

        return figures_of_handover(parameters, record)

    def pushes(self, parameters: Parameters) -> tuple[Pushable, ...]:  # noqa: ARG002
        """Return the gripper."""
        return PUSHES

    def replay(self, parameters: Parameters, record: Record) -> Replay:
        """Return arm, gripper, hand, ball and cameras in space."""
        from handover.scenarios.robots.helix.replay import replay_handover

        return replay_handover(record, pinholes(parameters.camera_turn, parameters.cameras).values())
