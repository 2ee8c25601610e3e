"""Ridge regression of a cubic polynomial; its penalty is chosen on points that were set aside."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.vsl.learned_model import Cubic, all_powers, factors_of, hull_directions, monomials
from handover.cosim.blocks.ports import Floats

PENALTIES = tuple(10.0**e for e in range(-10, 1))
"""Penalties tried, per training point and squared coefficient of standardised inputs (own choice)."""

_DIGITS = 12
"""Digits kept of every number: what follows is rounding noise, which linear algebra libraries disagree on."""


@dataclass(frozen=True)
class Fit:
    """A fitted cubic, the penalty chosen, and its root mean square error on the validation points."""

    cubic: Cubic
    penalty: float
    validation_rms: float


def fit_cubic(x: Floats, y: Floats, x_validation: Floats, y_validation: Floats) -> Fit:
    """Fit y(x) by least squares with a penalty on all coefficients but the constant's.

    Args:
        x: training inputs, shape (points, inputs); each input takes more than one value.
        y: training values, shape (points, values).
        x_validation: inputs to choose the penalty on, shape (points, inputs).
        y_validation: values that belong to them.
    """
    n = x.shape[1]
    mean, scale = rounded(np.mean(x, axis=0)), rounded(np.std(x, axis=0))
    z = (x - mean) / scale
    powers = all_powers(n)
    features = monomials(z, factors_of(powers))[:, 1:]
    feature_mean, y_mean = np.mean(features, axis=0), np.mean(y, axis=0)
    left, singular, right = np.linalg.svd(features - feature_mean, full_matrices=False)
    projected: Floats = np.transpose(left) @ (y - y_mean)
    hull = rounded(np.max(z @ np.transpose(hull_directions(n)), axis=0)) + 1e-9  # beyond what rounding may cut off
    fits: list[Fit] = []
    for penalty in PENALTIES:
        weights: Floats = np.transpose(right) @ (projected * (singular / (singular**2 + penalty * len(x)))[:, None])
        coefficients = rounded(np.vstack([y_mean - feature_mean @ weights, weights]))
        cubic = Cubic(mean, scale, rounded(hull), powers, coefficients)
        error = cubic.predict(x_validation) - y_validation
        fits.append(Fit(cubic, penalty, float(np.sqrt(np.mean(error**2)))))
    return min(fits, key=lambda f: f.validation_rms)


def rounded(values: Floats) -> Floats:
    """Return values to twelve digits, as a model is written to its file."""
    return np.array([float(f"{v:.{_DIGITS}g}") for v in values.ravel().tolist()]).reshape(values.shape)
