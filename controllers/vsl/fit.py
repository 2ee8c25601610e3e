"""Regressions by linear algebra: of a cubic polynomial, gear friction, what makes an arm differ, and a beam."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.vsl.beam import Beam, BentTip, Stiffness, Weights, stiffness_at
from handover.controllers.vsl.kinematics import VslKinematics
from handover.controllers.vsl.learned_model import (
    Adapted,
    Cubic,
    Domain,
    Regressor,
    all_powers,
    factors_of,
    friction_direction,
    hull_directions,
    monomials,
)
from handover.cosim.blocks.ports import Floats

PENALTIES = tuple(10.0**e for e in range(-10, 1))
"""Penalties tried, per training point and squared coefficient of standardised inputs (own choice)."""

_DIGITS = 12
"""Digits kept of every number: what follows is rounding noise, which linear algebra libraries disagree on."""

_FRICTION_ITERATIONS, _FRICTION_STRIDE, _FRICTION_TOLERANCE = 40, 1.5, 1e-5
"""Most steps, what each is multiplied by, and the change of a current, A, at which they end (own choice).

Steps are too short by about a third: a fit on currents with friction takes them for less than they are worth.
"""

_FRICTION_PENALTY = (1e-4,)
"""The one penalty of the cubics by which friction is found: they are compared, not used (own choice)."""

_FIRST_STIFFNESS = (1.0, 1e-5, 100.0)
"""EI_0, N m2, EI_p, N m2/Pa, and joint, N m/rad, from which the fit of a beam begins (own choice)."""

_BEAM_ITERATIONS, _LOG_STEP = 30, 1e-5
"""Gauss-Newton steps of that fit, and the change of a logarithm by which its derivatives are taken (own choice)."""

SMALLEST = 1e-12
"""Scale below which values count as constant: none is divided by less."""


@dataclass(frozen=True)
class Fit:
    """A fitted cubic, the penalty chosen, and its root mean square error on the validation points."""

    cubic: Cubic
    penalty: float
    validation_rms: float


def fit_cubic(
    x: Floats,
    y: Floats,
    x_validation: Floats,
    y_validation: Floats,
    penalties: Sequence[float] = PENALTIES,
) -> Fit:
    """Fit y(x) by least squares with a penalty on all coefficients but the constant's.

    Args:
        x: training inputs, shape (points, inputs); each input takes more than one value.
        y: training values, shape (points, values).
        x_validation: inputs to choose the penalty on, shape (points, inputs).
        y_validation: values that belong to them.
        penalties: from which to choose.
    """
    n = x.shape[1]
    domain = domain_of(x)
    mean, scale = domain.mean, domain.scale
    z = (x - mean) / scale
    powers = all_powers(n)
    features = monomials(z, factors_of(powers))[:, 1:]
    feature_mean, y_mean = np.mean(features, axis=0), np.mean(y, axis=0)
    left, singular, right = np.linalg.svd(features - feature_mean, full_matrices=False)
    projected: Floats = np.transpose(left) @ (y - y_mean)
    fits: list[Fit] = []
    for penalty in penalties:
        weights: Floats = np.transpose(right) @ (projected * (singular / (singular**2 + penalty * len(x)))[:, None])
        coefficients = rounded(np.vstack([y_mean - feature_mean @ weights, weights]))
        cubic = Cubic(mean, scale, domain.hull, powers, coefficients)
        error = cubic.predict(x_validation) - y_validation
        fits.append(Fit(cubic, penalty, float(np.sqrt(np.mean(error**2)))))
    return min(fits, key=lambda f: f.validation_rms)


def domain_of(x: Floats) -> Domain:
    """Return the range of inputs x, shape (points, inputs); each input takes more than one value."""
    mean, scale = rounded(np.mean(x, axis=0)), rounded(np.std(x, axis=0))
    farthest = np.max((x - mean) / scale @ np.transpose(hull_directions(x.shape[1])), axis=0)
    return Domain(mean, scale, rounded(rounded(farthest) + 1e-9))  # beyond what rounding may cut off


def directions_of(q_cmd: Floats, reversal: float) -> Floats:
    """Return which way the gears' friction acts after each of commands one after another, from -1 to 1.

    It grows with the turn, from -1 to 1 over `reversal`, and stays while the joint turns on: over the past that
    is as long as it takes to turn by so much.

    Args:
        q_cmd: commanded angles, shape (points, joints), rad; friction begins at 0.
        reversal: rad.
    """
    directions = np.zeros_like(q_cmd)
    for k in range(1, len(q_cmd)):
        directions[k] = friction_direction(directions[k - 1], q_cmd[k] - q_cmd[k - 1], reversal)
    return directions


def fit_friction(inputs_at: Callable[[Floats], Floats], directions: Floats, y: Floats) -> tuple[float, float]:
    """Return the currents that turn with the direction of motion, A, of joints 2 and 3.

    y = f(x) has x of currents i - c directions: with f fitted for some c, what is left of y gives a better c.

    Args:
        inputs_at: gives the inputs for a c of shape (2,), whose last two are the currents, shape (points, inputs).
        directions: shape (points, 2).
        y: shape (points, values).
    """
    c = np.zeros(2)
    for _ in range(_FRICTION_ITERATIONS):
        x = inputs_at(c)
        cubic = fit_cubic(x, y, x, y, penalties=_FRICTION_PENALTY).cubic
        by_c = np.reshape(-cubic.jacobian(x)[..., -2:] * directions[:, None, :], (-1, 2))
        change = np.linalg.lstsq(by_c, np.ravel(y - cubic.predict(x)), rcond=None)[0]
        c = c + _FRICTION_STRIDE * change
        if np.max(np.abs(change)) < _FRICTION_TOLERANCE:
            break
    first, second = (float(f"{v:.6g}") for v in c.tolist())
    return first, second


def fit_adapted(base: Regressor, x: Floats, y: Floats) -> Adapted:
    """Correct a regressor by few points of another arm, by ridge regression.

    The penalty on all but the offset is the one with the least error of points left out one by one.

    Args:
        base: as trained.
        x: inputs, shape (points, inputs).
        y: values, shape (points, values).
    """
    predicted = base.predict(x)
    magnitude = np.maximum(np.std(predicted, axis=0), SMALLEST)
    features = np.concatenate([base.domain.standardised(x), predicted / magnitude], axis=1)
    feature_mean, left = np.mean(features, axis=0), y - predicted
    centred = left - np.mean(left, axis=0)
    U, singular, right = np.linalg.svd(features - feature_mean, full_matrices=False)
    fits: list[tuple[float, Floats]] = []
    for penalty in PENALTIES[4:]:
        shares = singular**2 / (singular**2 + penalty * len(x))
        taken = np.sum(U**2 * shares, axis=1) + 1.0 / len(x)  # what each point has of its own prediction
        errors: Floats = (centred - (U * shares) @ (np.transpose(U) @ centred)) / (1.0 - taken)[:, None]
        weights = np.transpose(right) @ (
            (shares / np.maximum(singular, SMALLEST))[:, None] * (np.transpose(U) @ centred)
        )
        fits.append((float(np.mean(errors**2)), weights))
    weights = min(fits, key=lambda f: f[0])[1]
    n = x.shape[1]
    return Adapted(
        base=base,
        offset=rounded(np.mean(left, axis=0) - feature_mean @ weights),
        weights=rounded(np.transpose(weights[:n])),
        gain=rounded(np.transpose(weights[n:] / magnitude[:, None])),
    )


def fit_beam(kinematics: VslKinematics, x: Floats, y: Floats) -> Beam:
    """Fit the three stiffnesses of a beam to residuals of the tip, by the Gauss-Newton method in their logarithms.

    Args:
        kinematics: of rigid links.
        x: inputs, shape (points, 7).
        y: measured minus rigid tips in the arm's plane, shape (points, 3), m.
    """
    domain, known = domain_of(x), Weights()

    def left(logarithms: Floats) -> Floats:
        tip = BentTip(domain.mean, domain.scale, domain.hull, Beam(kinematics, stiffness_at(logarithms), known))
        return np.ravel((y - tip.predict(x))[:, ::2])  # sideways a beam in the plane says nothing

    at: Any = np.log(_FIRST_STIFFNESS)
    for _ in range(_BEAM_ITERATIONS):
        e = left(at)
        J = np.transpose([(left(at + step) - e) / _LOG_STEP for step in _LOG_STEP * np.eye(3)])
        change = np.linalg.lstsq(J, -e, rcond=None)[0]
        at = at + change * min(1.0, 1.0 / float(np.max(np.abs(change))))
        if np.max(np.abs(change)) < 1e-9:
            break
    return Beam(kinematics, Stiffness(*(float(f"{v:.{_DIGITS}g}") for v in stiffness_at(at))), known)


def rounded(values: Floats) -> Floats:
    """Return values to twelve digits, as a model is written to its file."""
    return np.array([float(f"{v:.{_DIGITS}g}") for v in values.ravel().tolist()]).reshape(values.shape)
