"""The learned part of the VSL arm's hybrid kinematics. [Gandarias2020] eqs. (10), (11).

`VslModel` has two regressors, one for each equation: polynomials (`Cubic`), networks or a beam, which stand in files of
their own. All know the range of inputs that they were fitted on, `Domain`.
"""

import enum
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handover.controllers.vsl.kinematics import VslKinematics
from handover.cosim.blocks.ports import Floats


class Learned(enum.IntEnum):
    """What rigid kinematics are corrected by.

    CUBIC: polynomials of third degree on residuals. SMALL: networks of two layers of 32 on residuals. PUBLISHED: the
    networks of [Gandarias2020] sec. IV-B, which give positions and angles themselves. PHYSICS: a chain of rigid pieces
    with three fitted stiffnesses, and the servos' droop.
    """

    CUBIC = 0
    SMALL = 1
    PUBLISHED = 2
    PHYSICS = 3


class ForwardInput(enum.Enum):
    """What eq. (10) takes of the arm's posture: the measured angles, or as printed X = f(q)."""

    Q = "q"
    X = "X"


FORWARD_INPUTS = ("q_meas[1]", "q_meas[2]", "q_meas[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
FORWARD_INPUTS_X = tuple(f"p_WG_model[{k + 1}]" for k in range(3)) + FORWARD_INPUTS[3:]
INVERSE_INPUTS = ("q_ref[1]", "q_ref[2]", "q_ref[3]", "p_meas[1]", "p_meas[2]", "i_meas[2]", "i_meas[3]")
"""Inputs in rad or m, Pa and A; the current of joint 1, which carries no weight, is left out."""

NOMINAL_INPUTS = ("q_meas[2]", "q_meas[3]", "p_meas[1]", "p_meas[2]")

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
class Domain:
    """The inputs that something was fitted on: standardised, z = (x - mean) / scale, they lie in a polytope.

    None of the sides of directions z <= hull can be moved inwards.

    Attributes:
        mean, scale: shape (inputs,), in the inputs' units.
        hull: offsets of the sides with the normals `hull_directions`, shape (2 inputs^2,).
    """

    mean: Floats
    scale: Floats
    hull: Floats

    def standardised(self, x: Floats) -> Floats:
        """Return z of inputs x, shape (..., inputs), each held between the two sides that are square to its axis.

        What runs away outside is worse than what stays.
        """
        return np.minimum(np.maximum((x - self.mean) / self.scale, self._low), self._high)

    def slopes(self, x: Floats) -> Floats:
        """Return dz/dx of `standardised` at inputs x, shape (..., inputs): 0 where an input is held."""
        z = (x - self.mean) / self.scale
        return np.where((z < self._low) | (z > self._high), 0.0, 1.0 / self.scale)

    def outside(self, x: Floats, *, turned: bool = False) -> bool:
        """Return whether inputs x, shape (inputs,), lie outside the polytope, that is, surely beyond the training.

        What is not a number lies outside. If `turned`, the first input is an angle about an axis of symmetry, which
        decides nothing: the polytope is that of the other inputs.
        """
        rows = self._directions[:, 0] == 0.0 if turned else slice(None)
        inside = self._directions[rows] @ ((x - self.mean) / self.scale) <= self.hull[rows]
        return not bool(np.all(inside) and np.isfinite(x[0]))

    @cached_property
    def _low(self) -> Floats:
        return -self.hull[1 : 2 * len(self.mean) : 2]

    @cached_property
    def _high(self) -> Floats:
        return self.hull[0 : 2 * len(self.mean) : 2]

    @cached_property
    def _directions(self) -> Floats:
        return hull_directions(len(self.mean))


class Regressor(Protocol):
    """A function of posture, pressures and currents that was fitted to measured points."""

    @property
    def domain(self) -> Domain:
        """The inputs that it was fitted on."""
        ...

    def predict(self, x: Floats) -> Floats:
        """Return y of inputs x, shape (..., inputs), as shape (..., values)."""
        ...

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (inputs,), as shape (values, inputs)."""
        ...


@dataclass(frozen=True)
class Cubic(Domain):
    """y(x) = sum_k coefficients[k] prod_i z_i^powers[k, i] of the standardised inputs.

    Attributes:
        powers: exponents, shape (monomials, inputs), each row's sum from 0 to 3.
        coefficients: shape (monomials, values), in the values' units.
    """

    powers: Integers
    coefficients: Floats

    @property
    def domain(self) -> Domain:
        """The inputs that it was fitted on."""
        return self

    def predict(self, x: Floats) -> Floats:
        """Return y of inputs x, shape (..., inputs), as shape (..., values)."""
        return monomials(self.standardised(x), self._factors) @ self.coefficients

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (..., inputs), as shape (..., values, inputs)."""
        pairs, by_pair = self._derivative
        padded = np.concatenate([np.ones((*x.shape[:-1], 1)), self.standardised(x)], axis=-1)
        J = (padded[..., pairs[0]] * padded[..., pairs[1]]) @ by_pair
        return J.reshape(*x.shape[:-1], self.coefficients.shape[1], len(self.mean)) * self.slopes(x)[..., None, :]

    @cached_property
    def _derivative(self) -> tuple[Integers, Floats]:
        """Pairs of what to multiply, shape (2, pairs), and dy/dz by their products, shape (pairs, values x inputs)."""
        n = len(self.mean)
        numbers = {pair: k for k, pair in enumerate(itertools.combinations_with_replacement(range(n + 1), 2))}
        by_pair = np.zeros((len(numbers), self.coefficients.shape[1], n))
        rows: list[list[int]] = np.transpose(self._factors).tolist()
        for factors, coefficients in zip(rows, self.coefficients, strict=True):
            for place, factor in enumerate(factors):
                if factor:
                    a, b = sorted(factors[:place] + factors[place + 1 :])
                    by_pair[numbers[a, b], :, factor - 1] += coefficients
        return np.transpose(list(numbers)), by_pair.reshape(len(numbers), -1)

    @cached_property
    def _factors(self) -> Integers:
        return factors_of(self.powers)


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
class Adapted:
    """A regressor b, corrected on an arm that differs: y = b(x) + offset + weights z + gain b(x).

    Attributes:
        base: b.
        offset: shape (values,).
        weights: shape (values, inputs), of the base's standardised inputs.
        gain: shape (values, values): links that are stiffer by a tenth bend less by an eleventh.
    """

    base: Regressor
    offset: Floats
    weights: Floats
    gain: Floats

    @property
    def domain(self) -> Domain:
        """The inputs that the base was fitted on."""
        return self.base.domain

    def predict(self, x: Floats) -> Floats:
        """Return y of inputs x, shape (..., inputs), as shape (..., values)."""
        y, z = self.base.predict(x), self.domain.standardised(x)
        return y + self.offset + z @ np.transpose(self.weights) + y @ np.transpose(self.gain)

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (inputs,), as shape (values, inputs)."""
        J = self.base.jacobian(x)
        return J + self.weights * self.domain.slopes(x) + self.gain @ J


@dataclass(frozen=True)
class VslModel:
    """What corrects rigid kinematics, [Gandarias2020] sec. IV.

    Attributes:
        inverse: commanded minus rigid angles, rad, at the wanted rigid angles, shape (3,).
        forward: true minus rigid position, m, shape (3,): outwards, sideways, upwards in the arm's own plane, in which
            it deforms wherever joint 1 turns that.
        kinematics: the rigid kinematics that is corrected.
        provenance: what it was trained on, and with what errors.
        kind: what the two are.
        forward_input: what `forward` takes of the posture.
        friction: currents by the friction of the gears of joints 2 and 3, A, shape (2,), which turn with the direction
            of motion and which is to be taken off the currents before; 0 if it was trained on the currents as measured.
        nominal: currents of joints 2 and 3 without friction under the mean of the loads that it was trained on, A, by
            `NOMINAL_INPUTS`; None if it was trained on the currents as measured.
    """

    inverse: Regressor
    forward: Regressor
    kinematics: VslKinematics
    provenance: Mapping[str, Any]
    kind: Learned = Learned.CUBIC
    forward_input: ForwardInput = ForwardInput.Q
    friction: tuple[float, float] = (0.0, 0.0)
    nominal: Cubic | None = None

    @property
    def is_absolute(self) -> bool:
        """Whether it gives angles, and the position in the world, themselves and not what is to be added."""
        return self.kind is Learned.PUBLISHED

    def command(self, q_ref: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        """Return q_cmd, shape (3,), that brings the tip to where q_ref would bring a rigid arm's: eq. (11)."""
        learned = self.inverse.predict(inputs_of(q_ref, p_meas, i_meas))
        return learned if self.is_absolute else q_ref + learned

    def tip(self, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        """Return p_WG, shape (3,), m, of the arm as it bends: eq. (10)."""
        learned = self.forward.predict(self._forward_inputs(q_meas, p_meas, i_meas))
        if self.is_absolute:
            return learned
        return self.kinematics.forward(q_meas) + rotate_about_z(learned, float(q_meas[0]))

    def tip_jacobian(self, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        """Return d tip / d q_meas, shape (3, 3), m: J of eq. (8) and what bending adds, at constant currents."""
        x = self._forward_inputs(q_meas, p_meas, i_meas)
        J = self.kinematics.jacobian(q_meas)
        by_posture = self.forward.jacobian(x)[:, :3]
        if self.forward_input is ForwardInput.X:
            by_posture = by_posture @ J
        if self.is_absolute:
            return by_posture
        theta_1 = float(q_meas[0])
        c, s = math.cos(theta_1), math.sin(theta_1)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turning = np.cross([0.0, 0.0, 1.0], R @ self.forward.predict(x))
        return J + R @ by_posture + np.outer(turning, [1.0, 0.0, 0.0])

    def currents(self, q_meas: Floats, p_meas: Floats) -> tuple[Floats, Floats]:
        """Return the nominal currents of joints 2 and 3, shape (2,), A, and a load's levers on them, shape (2,), m.

        Raises:
            ValueError: it was trained on the currents as measured.
        """
        if self.nominal is None:
            raise ValueError("it was trained on the currents as measured, and has no nominal ones")
        theta_2, theta_23 = float(q_meas[1]), float(q_meas[1] + q_meas[2])
        lever_3 = self.kinematics.L_3 * math.cos(theta_23)
        lever_2 = self.kinematics.L_2 * math.cos(theta_2) + lever_3
        return self.nominal.predict(np.concatenate([q_meas[1:], p_meas])), np.array([lever_2, lever_3])

    def outside(self, q_ref: Floats, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> bool:
        """Return whether either is evaluated outside the polytope of its training.

        Joint 1 turns the arm about the vertical, by which residuals in the arm's plane do not change: its angle decides
        nothing, except of networks that give angles and positions themselves.
        """
        turned, forward = not self.is_absolute, self.forward.domain
        if self.inverse.domain.outside(inputs_of(q_ref, p_meas, i_meas), turned=turned):
            return True
        if self.forward_input is ForwardInput.Q or self.is_absolute:
            return forward.outside(self._forward_inputs(q_meas, p_meas, i_meas), turned=turned)
        bearing = math.atan2(float(forward.mean[1]), float(forward.mean[0]))  # X turned back to the training's middle
        return forward.outside(self._forward_inputs(np.array([bearing, *q_meas[1:]]), p_meas, i_meas))

    def _forward_inputs(self, q_meas: Floats, p_meas: Floats, i_meas: Floats) -> Floats:
        posture = q_meas if self.forward_input is ForwardInput.Q else self.kinematics.forward(q_meas)
        return inputs_of(posture, p_meas, i_meas)


def inputs_of(q: Floats, p: Floats, i: Floats) -> Floats:
    """Return inputs of a regressor, shape (..., 7): of posture (..., 3), pressures (..., 2) and currents (..., 3)."""
    return np.concatenate([q, p, i[..., 1:]], axis=-1)


def friction_direction(direction: Floats, turn: Floats, reversal: float) -> Floats:
    """Return which way friction acts, from -1 to 1, after a further turn, rad: all of `reversal` turns it round."""
    return np.minimum(np.maximum(direction + 2.0 * turn / reversal, -1.0), 1.0)


def rotate_about_z(v: Floats, theta_1: float) -> Floats:
    """Return v, shape (3,), turned by theta_1 about z."""
    c, s = math.cos(theta_1), math.sin(theta_1)
    x, y, z = v.tolist()
    return np.array([c * x - s * y, s * x + c * y, z])
