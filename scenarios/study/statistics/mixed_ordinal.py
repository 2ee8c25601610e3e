"""A cumulative link model with an intercept of each participant, for ratings: a supplement to the exact tests.

No maintained Python library fits one by maximum likelihood (statsmodels' ordered model has no random effects; Bayesian
ones need priors and a sampler), so the marginal likelihood is here. It agrees with R's `ordinal::clmm` on its own
example, to which the tests compare it.

[Agresti2010] Agresti, Analysis of ordinal categorical data, ch. 10.
[Christensen2019] Christensen, Cumulative link models for ordinal regression with the R package ordinal.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit
from scipy.stats import norm

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import LEVEL

_NODES: Floats = np.linspace(-8.0, 8.0, 161)
"""Of the trapezoidal rule over a standard normal variable, whose error falls exponentially with the spacing: below 1e-8
where the intercepts' deviation is below 5. Nodes of Gauss and Hermite would have to be moved to each person."""
_WEIGHTS: Floats = norm.pdf(_NODES) * (_NODES[1] - _NODES[0])
_logistic = cast(Callable[[Floats], Floats], expit)
_TINY = 1e-300
_MAX_GRADIENT = 1e-2
_MAX_ERROR = 50.0
"""Standard errors above which the data do not bound an effect, as where one behaviour has all the highest ratings."""


@dataclass(frozen=True)
class Effect:
    """An effect on the log-odds of a higher rating, with its Wald interval at 95 % and p-value."""

    estimate: float
    error: float
    low: float
    high: float
    p: float


@dataclass(frozen=True)
class MixedModel:
    """A fitted model.

    Attributes:
        effects: of the columns of x, in order.
        thresholds: between the categories that were used, in order.
        deviation: of the participants' intercepts.
        log_likelihood: at its maximum.
    """

    effects: Sequence[Effect]
    thresholds: Sequence[float]
    deviation: float
    log_likelihood: float


class NotFitted(ValueError):
    """Data that do not determine the model, with the reason."""


def fit_mixed_ordinal(y: Sequence[int], x: ArrayLike, group: Sequence[object]) -> MixedModel:
    """Fit logit P(y <= k) = theta_k - (x beta + u), u ~ N(0, sigma^2) of each group, by maximum likelihood.

    [Agresti2010] eq. (10.1), with the sign of [Christensen2019]: a positive beta makes higher ratings more probable.
    Categories that nobody used are left out: their thresholds would coincide.

    Args:
        y: ratings.
        x: shape (ratings, effects), without a constant.
        group: whose rating it is.

    Raises:
        NotFitted: only one category was used, effects cannot be told apart, or the maximum is at infinity.
    """
    likelihood = _Likelihood(y, np.asarray(x, dtype=np.float64).reshape(len(y), -1), group)
    start = likelihood.start()
    found = minimize(likelihood, start, jac=True, method="BFGS", options={"gtol": 1e-6, "maxiter": 500})
    at: Floats = found.x
    value, gradient = likelihood(at)
    if not np.isfinite(value) or np.abs(gradient).max() > _MAX_GRADIENT:
        raise NotFitted("the likelihood has no maximum that could be found")
    k = likelihood.thresholds
    covariance = _inverse(_jacobian(likelihood, at))
    errors = np.sqrt(np.diagonal(covariance))[k : k + likelihood.x.shape[1]]
    if not np.all(np.isfinite(errors)) or np.any(errors > _MAX_ERROR):
        raise NotFitted("an effect is not bounded by the data: all ratings of one kind are beyond those of another")
    effects = [_effect(float(b), float(e)) for b, e in zip(at[k : k + len(errors)], errors, strict=True)]
    return MixedModel(effects, likelihood.theta(at).tolist(), abs(float(at[-1])), -value)


def _effect(estimate: float, error: float) -> Effect:
    half = float(norm.ppf(1.0 - LEVEL / 2)) * error
    p = 2.0 * float(norm.sf(abs(estimate) / error))
    return Effect(estimate, error, estimate - half, estimate + half, p)


class _Likelihood:
    """The negative marginal log-likelihood and its gradient, by (theta_1, log steps of theta, beta, sigma)."""

    def __init__(self, y: Sequence[int], x: Floats, group: Sequence[object]) -> None:
        used, self.y = np.unique(np.asarray(y), return_inverse=True)
        if len(used) < 2:
            raise NotFitted("all ratings are the same")
        if np.linalg.matrix_rank(x - x.mean(axis=0)) < x.shape[1]:
            raise NotFitted("the data do not tell its effects apart")
        self.x, self.thresholds = x, len(used) - 1
        names = list(dict.fromkeys(group))
        self._members: NDArray[np.float64] = np.array([[g == name for g in group] for name in names], dtype=np.float64)

    def start(self) -> Floats:
        """Return parameters that fit the categories' frequencies, without effects."""
        shares = np.cumsum(np.bincount(self.y))[:-1] / len(self.y)
        theta = np.log(shares / (1.0 - shares))
        return np.concatenate([theta[:1], np.log(np.diff(theta)), np.zeros(self.x.shape[1]), [1.0]])

    def theta(self, at: Floats) -> Floats:
        """Return the thresholds."""
        return at[0] + np.concatenate([[0.0], np.cumsum(np.exp(at[1 : self.thresholds]))])

    def __call__(self, at: Floats) -> tuple[float, Floats]:
        k = self.thresholds
        theta, beta, sigma = self.theta(at), at[k:-1], at[-1]
        bounds = np.concatenate([[-np.inf], theta, [np.inf]])
        eta = (self.x @ beta)[:, None] + sigma * _NODES
        upper, lower = _logistic(bounds[self.y + 1][:, None] - eta), _logistic(bounds[self.y][:, None] - eta)
        p: Floats = np.maximum(upper - lower, _TINY)
        density_up: Floats = upper * (1.0 - upper) / p
        density_low: Floats = lower * (1.0 - lower) / p
        log_p: Floats = self._members @ np.log(p)  # of each group at each node
        largest: Floats = log_p.max(axis=1, keepdims=True)
        at_nodes: Floats = _WEIGHTS * np.exp(log_p - largest)
        marginal: Floats = at_nodes.sum(axis=1, keepdims=True)
        value = -float((np.log(marginal) + largest).sum())
        posterior: Floats = np.matmul(np.transpose(self._members), at_nodes / marginal)  # of each rating's group
        up: Floats = (posterior * density_up).sum(axis=1)
        low: Floats = (posterior * density_low).sum(axis=1)
        by_theta = np.bincount(self.y, up, k + 1)[:-1] - np.bincount(self.y, low, k + 1)[1:]
        steps = np.exp(at[1:k])
        by_first = np.concatenate([[by_theta.sum()], steps * by_theta[::-1].cumsum()[::-1][1:]])
        by_eta: Floats = posterior * (density_low - density_up)
        by_beta: Floats = np.matmul(np.transpose(self.x), by_eta.sum(axis=1))
        return value, -np.concatenate([by_first, by_beta, [float((by_eta * _NODES).sum())]])


def _jacobian(function: _Likelihood, at: Floats) -> Floats:
    """Return the second derivatives by central differences of the gradient."""
    steps = 1e-5 * np.maximum(1.0, np.abs(at))
    rows = [
        (function(at + h * unit)[1] - function(at - h * unit)[1]) / (2.0 * h)
        for h, unit in zip(steps, np.eye(len(at)), strict=True)
    ]
    return np.add(rows, np.transpose(rows)) / 2.0


def _inverse(hessian: Floats) -> Floats:
    try:
        covariance: Floats = np.asarray(np.linalg.inv(hessian), dtype=np.float64)
    except np.linalg.LinAlgError as e:
        raise NotFitted("the data do not determine all its parameters") from e
    if np.any(np.diagonal(covariance)[:-1] <= 0.0):
        raise NotFitted("the data do not determine all its parameters")
    return covariance
