"""The Helix's cameras bring its gripper near a ball, and infrared sensors in its fingers centre it there.

[Vervloet2025] for arm, vision and control, [Luberto] for the sensors; neither has the two together. The evaluation adds
to the handover's where the ball was as the gripper began to close.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Figure, FmuOf, Metric
from handover.scenarios.experiment.exposed import with_exposed
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator, beside_and_along
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.parameters import Parameters
from handover.scenarios.robots.helix.places import AS_IN_HANDOVER, REFLEX_PLACES
from handover.scenarios.robots.helix.reflex_grasp_parameters import Offer, ReflexGraspParameters


class ReflexGraspEvaluator(HandoverEvaluator):
    """Follows the handover as its base does, and what the controller believes of the ball's place in the gripper.

    Args:
        parameters: of the handover.
        pictures: those that were kept, where a record is evaluated; None: they are taken.
    """

    def __init__(self, parameters: Parameters, pictures: Sequence[CameraPicture] | None = None) -> None:
        super().__init__(parameters, pictures)
        self._p_GO_closing: Floats | None = None  # when the gripper began to close, the last time
        self._believed: Floats | None = None  # the same offset as the controller had it

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow the handover, and note where the ball is as the gripper begins to close."""
        before = self._grasp_began
        super().__call__(t, signals)
        if self._grasp_began != before:
            self._p_GO_closing = self._p_GO
            self._believed = np.array(signals["reflex.p_GO_est"]) if "reflex.p_GO_est" in signals else None

    def _metrics(self) -> dict[str, Metric]:
        metrics = super()._metrics()
        if self._p_GO_closing is None:
            return metrics
        lateral, axial = beside_and_along(self._p_GO_closing)
        metrics["closing_offset_lateral"] = Metric(
            lateral, "m", "ball beside the gripper's axis when the gripper begins to close, ground truth"
        )
        metrics["closing_offset_axial"] = Metric(
            axial, "m", "ball along the gripper's axis, towards its tip, when the gripper begins to close, ground truth"
        )
        if self._believed is not None:
            metrics["felt_error"] = Metric(
                float(np.linalg.norm(self._believed - self._p_GO_closing)),
                "m",
                "controller's error of the ball's place in the gripper when it begins to close",
            )
        return metrics

    def _reason(self, success: bool) -> str:
        reason = super()._reason(success)
        if success or self._p_GO_closing is None or self._believed is None:
            return reason
        beside, believed = beside_and_along(self._p_GO_closing)[0], beside_and_along(self._believed)[0]
        return (
            f"{reason}; as the gripper began to close the ball was {beside:.3f} m beside its axis, "
            f"{believed:.3f} m as the controller had it"
        )


class HelixReflexGrasp(HelixHandover):
    """A handover with infrared sensors in the gripper's fingers, whose last stretch the cameras may not see.

    `GraspReflex` stands between vision and servo. Without the reflex it is there, too, and reckons on by the motors
    where the cameras fail; so what differs is the sensing alone.
    """

    name: ClassVar[str] = "helix_reflex_grasp"
    title: ClassVar[str] = "the Helix comes to a ball by its cameras and centres its gripper by infrared fingers"
    parameters_type: ClassVar[type[Any]] = ReflexGraspParameters
    units: ClassVar[Mapping[str, str]] = {
        **HelixHandover.units,
        "fingers": "FingerInfrared",
        "reflex": "GraspReflex",
    }
    places: ClassVar[Mapping[str, Place]] = with_exposed(
        with_exposed(REFLEX_PLACES, ReflexGraspParameters), Parameters, AS_IN_HANDOVER
    )
    headline: ClassVar[tuple[str, ...]] = (
        "closing_offset_lateral",
        "closing_offset_axial",
        "felt_error",
        "grasp_offset_lateral",
        "grasp_offset_axial",
        "final_distance",
        "arm_time",
        "handover_time",
        "cpu_per_cycle",
    )

    def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Wire the handover's units, with sensors in the fingers and the reflex between vision and servo."""
        p: ReflexGraspParameters = parameters
        place_seed, sensor_seed = (int(n) for n in np.random.SeedSequence((seed, 19)).generate_state(2) >> 1)
        handover = offered(p, place_seed)
        s = self.without_measurements(handover, seed, fmu, **p.covers)
        fingers = s.add(
            "fingers",
            fmu("fingers"),
            seed=sensor_seed,
        )
        reflex = s.add(
            "reflex",
            fmu("reflex"),
            period=handover.picture_period,
            sampled=True,
        )
        vision, servo, arm, hand = (s.units[name] for name in ("vision", "servo", "arm", "hand"))
        s.connect(arm.y, fingers.u)
        s.connect(hand.y, fingers.u)
        s.connect(vision.y, reflex.u)
        s.connect(reflex.y, servo.u)
        s.connect(fingers.y, reflex.u)
        s.connect(arm.y, reflex.u)
        s.connect(servo.y, reflex.u)
        return s

    def stop_time(self, parameters: Any) -> Fraction:
        """Return the end of the patience for the approach, plus time for closing the gripper."""
        p: ReflexGraspParameters = parameters
        return super().stop_time(p.handover)

    def evaluator(self, parameters: Any) -> ReflexGraspEvaluator:
        """Return the evaluator of one handover."""
        p: ReflexGraspParameters = parameters
        return ReflexGraspEvaluator(p.handover)

    def evaluator_of_record(self, parameters: Any, pictures: Sequence[CameraPicture]) -> ReflexGraspEvaluator:
        """Return an evaluator with the pictures that the run's folder keeps."""
        p: ReflexGraspParameters = parameters
        return ReflexGraspEvaluator(p.handover, pictures)

    def cycle(self) -> tuple[str, ...]:
        """Return the units that run on the robot's computer: vision, reflex and control."""
        return ("vision", "reflex", "servo")

    def published(self, parameters: Any) -> Sequence[PublishedValue]:  # noqa: ARG002
        """Return nothing: nobody has published such a grasp."""
        return ()

    def draw(self, parameters: Any, evaluator: Any, record: Record, folder: Path) -> list[Figure]:
        """Draw the camera pictures of some moments."""
        p: ReflexGraspParameters = parameters
        return super().draw(p.handover, evaluator, record, folder)

    def time_figures(self, parameters: Any, record: Record) -> list[TimeFigure]:
        """Return the handover's figures, and what the fingers read and make of it."""
        from handover.scenarios.robots.helix.plots import figures_of_handover
        from handover.scenarios.robots.helix.reflex_grasp_plots import figure_of_reflex

        p: ReflexGraspParameters = parameters
        reflex = [figure_of_reflex(p, record)] if "reflex.p_GO_est" in record and "fingers.ticks" in record else []
        return [*reflex, *figures_of_handover(p.handover, record)]

    def replay(self, parameters: Any, record: Record) -> Replay:
        """Return arm, gripper, hand, ball and cameras in space."""
        p: ReflexGraspParameters = parameters
        return super().replay(p.handover, record)


def offered(p: ReflexGraspParameters, seed: int) -> Parameters:
    """Return the handover with the ball where it is offered; a place is drawn by the seed."""
    if p.offer is Offer.GIVEN:
        return p.handover
    # OpenCV is slow to import, and lists import this.
    from handover.scenarios.robots.helix.workspace import random_place

    azimuth, radius, height = random_place(np.random.default_rng(seed))
    return replace(p.handover, azimuth=azimuth, radius=radius, height=height)
