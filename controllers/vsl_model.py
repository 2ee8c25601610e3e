"""The learned part of the hybrid kinematics of the VSL arm. [Gandarias2020] eqs. (10), (11)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.vsl_cubic import Cubic
from handover.controllers.vsl_kinematics import VslKinematics
from handover.cosim.blocks.ports import Floats

FORWARD_INPUTS = ("q_meas[1]", "q_meas[2]", "q_meas[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
INVERSE_INPUTS = ("q_ref[1]", "q_ref[2]", "q_ref[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
"""Inputs in rad, Pa and A; the current of joint 1, which carries no weight, is left out."""

VALUES = 3
"""What each residual has: an angle a joint, or a coordinate an axis."""


@dataclass(frozen=True)
class VslModel:
    """Residuals of rigid kinematics as cubic polynomials, in place of the networks of [Gandarias2020] sec. IV.

    Attributes:
        inverse: commanded minus rigid angles, rad, at the wanted rigid angles, shape (3,).
        forward: true minus rigid position, m, at the measured angles, shape (3,): outwards, sideways, upwards in the
            arm's own plane, in which it deforms wherever joint 1 turns that.
        kinematics: the rigid kinematics that is corrected.
        provenance: what it was trained on, and with what errors.
    """

    inverse: Cubic
    forward: Cubic
    kinematics: VslKinematics
    provenance: Mapping[str, Any]

    def command(self, q_ref: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        """Return q_cmd, shape (3,), that brings the tip to where q_ref would bring a rigid arm's: eq. (11)."""
        return q_ref + self.inverse.predict(inputs_of(q_ref, p_meas, i_meas))

    def tip(self, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        """Return p_WG, shape (3,), m, of the arm as it bends: eq. (10), of q instead of X = f(q)."""
        residual = self.forward.predict(inputs_of(q_meas, p_meas, i_meas))
        return self.kinematics.forward(q_meas) + turned(residual, float(q_meas[0]))

    def outside(self, q_ref: Floats, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> bool:
        """Tell whether either residual is asked about what it was not trained on."""
        return self.inverse.outside(inputs_of(q_ref, p_meas, i_meas)) or self.forward.outside(
            inputs_of(q_meas, p_meas, i_meas)
        )


def inputs_of(q: Floats, p: Floats, i: Floats) -> Floats:
    """Return what the polynomials take, shape (..., 7): angles (..., 3), pressures (..., 2), currents (..., 3)."""
    return np.concatenate([q, p, i[..., 1:]], axis=-1)


def turned(v: Floats, theta_1: float) -> Floats:
    """Return v, shape (3,), turned by theta_1 about z."""
    c, s = math.cos(theta_1), math.sin(theta_1)
    x, y, z = v.tolist()
    return np.array([c * x - s * y, s * x + c * y, z])
