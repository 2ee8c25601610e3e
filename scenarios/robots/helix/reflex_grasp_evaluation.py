"""Evaluates a grasp by infrared reflex: besides the handover, where the ball was as the gripper began to close."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.robots.helix.evaluation import HandoverEvaluator, beside_and_along
from handover.scenarios.robots.helix.parameters import Parameters


class ReflexGraspEvaluator(HandoverEvaluator):
    """Follows the handover as its base does, and what the controller believes of the ball's place in the gripper.

    Args:
        parameters: of the handover.
        pictures: those that were kept, where a record is evaluated; None: they are taken.
    """

    def __init__(self, parameters: Parameters, pictures: Sequence[CameraPicture] | None = None) -> None:
        super().__init__(parameters, pictures)
        self._p_GO_closing: Floats | None = None  # when the gripper began to close, the last time
        self._believed: Floats | None = None  # likewise, by the controller

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
