"""Residuals of the VSL arm's rigid kinematics at measured points, and what is left of them. [Gandarias2020] sec. IV."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import ForwardInput, Learned, VslModel, inputs_of, rotate_about_z
from handover.cosim.blocks.ports import Floats
from handover.scenarios.robots.vsl.training_data import Dataset

Pairs = tuple[Floats, Floats]
"""Inputs and values of points, shapes (points, inputs) and (points, values)."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Mean errors of the test points, of rigid kinematics and with what was learned.

    Attributes:
        forward_model_based, forward_hybrid: distance of the tip from where the kinematics take it to be, m.
        inverse_model_based, inverse_hybrid: distance by which the command for the measured tip would miss it, m, by the
            Jacobian.
        forward_other_input: forward_hybrid of what takes X = f(q) in place of q, or q in place of X; None if it was not
            trained.
    """

    forward_model_based: float
    forward_hybrid: float
    inverse_model_based: float
    inverse_hybrid: float
    forward_other_input: float | None = None


@dataclass(frozen=True, kw_only=True)
class Residuals:
    """What is to be learned of measured points, and the error of a model on them.

    Attributes:
        kinematics: of rigid links, which is corrected.
        learned: what corrects.
        forward_input: what eq. (10) takes.
    """

    kinematics: VslKinematics
    learned: Learned
    forward_input: ForwardInput

    def inverse_pairs(self, data: Dataset) -> Pairs:
        """Return inputs, the rigid angles of the measured tips first, and commanded minus rigid angles, rad.

        The *measured* angles in place of the commanded ones would leave the servos' droop in. Of a published network
        the values are the commanded angles themselves.
        """
        q_rigid = np.array([self.kinematics.inverse(p) for p in data.p_WG])
        values = data.q_cmd if self.learned is Learned.PUBLISHED else data.q_cmd - q_rigid
        return inputs_of(q_rigid, data.p, data.i), values

    def forward_pairs(self, data: Dataset) -> Pairs:
        """Return inputs, the measured angles or X = f(q) first, and measured minus rigid tips in the arm's plane, m.

        Of a published network the values are the measured tips themselves, in the world.
        """
        rigid = np.array([self.kinematics.forward(q) for q in data.q])
        inputs = inputs_of(data.q if self.forward_input is ForwardInput.Q else rigid, data.p, data.i)
        if self.learned is Learned.PUBLISHED:
            return inputs, data.p_WG
        residuals = [
            rotate_about_z(r, -theta_1) for r, theta_1 in zip(data.p_WG - rigid, data.q[:, 0].tolist(), strict=True)
        ]
        return inputs, np.array(residuals)

    def errors(self, model: VslModel, test: Dataset) -> Errors:
        """Return the errors of points that were not trained on; their currents are without friction if its are."""
        rigid = np.array([self.kinematics.forward(q) for q in test.q])
        q_rigid = np.array([self.kinematics.inverse(p) for p in test.p_WG])
        commands = np.array([model.command(*point) for point in zip(q_rigid, test.p, test.i, strict=True)])
        return Errors(
            forward_model_based=_mean_length(test.p_WG - rigid),
            forward_hybrid=self.forward_error(model, test),
            inverse_model_based=_mean_length(self._moved(q_rigid, test.q_cmd - q_rigid)),
            inverse_hybrid=_mean_length(self._moved(q_rigid, test.q_cmd - commands)),
        )

    def forward_error(self, model: VslModel, test: Dataset) -> float:
        """Return the mean distance of the tip from where a model takes it to be, m."""
        return _mean_length(test.p_WG - [model.tip(*point) for point in zip(test.q, test.p, test.i, strict=True)])

    def _moved(self, q: Floats, angles: Floats) -> Floats:
        """Return the displacements of the tip by small joint rotations, shape (n, 3), m, by the Jacobian."""
        return np.array([self.kinematics.jacobian(at) @ dq for at, dq in zip(q, angles, strict=True)])


def lengths_of(vectors: Floats) -> Floats:
    """Return the lengths of vectors, shape (n, 3)."""
    return np.sqrt(np.sum(vectors**2, axis=1))


def _mean_length(vectors: Floats) -> float:
    return float(np.mean(lengths_of(vectors)))
