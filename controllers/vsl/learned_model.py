"""The learned part of the VSL arm's hybrid kinematics: residuals as cubic polynomials. [Gandarias2020] eqs. (10), (11).

`Cubic` is a polynomial of several inputs with the range of inputs that it was fitted on; `VslModel` has two of them.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.vsl.kinematics import VslKinematics
from handover.cosim.blocks.ports import Floats

FORWARD_INPUTS = ("q_meas[1]", "q_meas[2]", "q_meas[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
INVERSE_INPUTS = ("q_ref[1]", "q_ref[2]", "q_ref[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
"""Inputs in rad, Pa and A; the current of joint 1, which carries no weight, is left out."""

VALUES = 3
"""What each residual has: an angle a joint, or a coordinate an axis."""

DEGREE = 3

Integers = NDArray[np.int64]


def all_powers(inputs: int) -> Integers:
    """Return the exponents of all monomials of at most third degree, shape (monomials, inputs), the constant first."""
    factors = itertools.combinations_with_replacement(range(inputs + 1), DEGREE)
    return np.array([[monomial.count(i + 1) for i in range(inputs)] for monomial in factors], dtype=np.int64)


def hull_directions(inputs: int) -> Floats:
    """Return the normals of the half-spaces that bound the inputs, shape (2 inputs^2, inputs), of unit length.

    They are the axes and the bisectors of all pairs of axes, both ways: +-e_i, then (+-e_i +- e_j) / sqrt(2). Seven
    inputs have 98.
    """
    eye = np.eye(inputs)
    rows = [sign * e for e in eye for sign in (1.0, -1.0)]
    for i, j in itertools.combinations(range(inputs), 2):
        rows += [(a * eye[i] + b * eye[j]) / np.sqrt(2.0) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    return np.array(rows)


@dataclass(frozen=True)
class Cubic:
    """y(x) = sum_k coefficients[k] prod_i z_i^powers[k, i] of the standardised inputs z = (x - mean) / scale.

    The inputs that it was fitted on lie in the polytope directions z <= hull, none of whose sides can be moved inwards.
    For the polynomial each z_i is held between the two sides that are square to its axis: outside, a cubic that runs
    away is worse than one that stays.

    Attributes:
        mean, scale: shape (inputs,), in the inputs' units.
        powers: exponents, shape (monomials, inputs), each row's sum from 0 to 3.
        coefficients: shape (monomials, values), in the values' units.
        hull: offsets of the sides with the normals `hull_directions`, shape (2 inputs^2,).
    """

    mean: Floats
    scale: Floats
    powers: Integers
    coefficients: Floats
    hull: Floats

    def predict(self, x: Floats) -> Floats:
        """Return y of inputs x, shape (..., inputs), as shape (..., values)."""
        z = np.minimum(np.maximum((x - self.mean) / self.scale, self._low), self._high)
        return monomials(z, self._factors) @ self.coefficients

    def outside(self, x: Floats) -> bool:
        """Return whether inputs x, shape (inputs,), lie outside the polytope, that is, surely beyond the training."""
        return bool(np.any(self._directions @ ((x - self.mean) / self.scale) > self.hull))

    @cached_property
    def _low(self) -> Floats:
        return -self.hull[1 : 2 * len(self.mean) : 2]

    @cached_property
    def _high(self) -> Floats:
        return self.hull[0 : 2 * len(self.mean) : 2]

    @cached_property
    def _factors(self) -> Integers:
        return factors_of(self.powers)

    @cached_property
    def _directions(self) -> Floats:
        return hull_directions(len(self.mean))


def factors_of(powers: Integers) -> Integers:
    """Return what to multiply for each monomial, shape (3, monomials): 0 for 1, i + 1 for input i."""
    factors = [[i + 1 for i, power in enumerate(row) for _ in range(power)] for row in powers.tolist()]
    padded = np.array([row + [0] * (DEGREE - len(row)) for row in factors], dtype=np.int64)
    return np.ascontiguousarray(np.transpose(padded))


def monomials(z: Floats, factors: Integers) -> Floats:
    """Return the monomials of inputs z, shape (..., inputs), as shape (..., monomials)."""
    padded = np.concatenate([np.ones((*z.shape[:-1], 1)), z], axis=-1)
    return padded[..., factors[0]] * padded[..., factors[1]] * padded[..., factors[2]]


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
        return self.kinematics.forward(q_meas) + rotate_about_z(residual, float(q_meas[0]))

    def outside(self, q_ref: Floats, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> bool:
        """Return whether either residual is evaluated outside the polytope of its training."""
        return self.inverse.outside(inputs_of(q_ref, p_meas, i_meas)) or self.forward.outside(
            inputs_of(q_meas, p_meas, i_meas)
        )


def inputs_of(q: Floats, p: Floats, i: Floats) -> Floats:
    """Return what the polynomials take, shape (..., 7): angles (..., 3), pressures (..., 2), currents (..., 3)."""
    return np.concatenate([q, p, i[..., 1:]], axis=-1)


def rotate_about_z(v: Floats, theta_1: float) -> Floats:
    """Return v, shape (3,), turned by theta_1 about z."""
    c, s = math.cos(theta_1), math.sin(theta_1)
    x, y, z = v.tolist()
    return np.array([c * x - s * y, s * x + c * y, z])
