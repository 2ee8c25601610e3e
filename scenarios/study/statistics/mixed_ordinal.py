"""A cumulative link model with intercepts and slopes of the participants, for ratings: a supplement to the exact tests.

Participants differ in how much a behaviour matters to them. A model with intercepts alone takes their ratings for
independent evidence of the behaviour, and rejects without an effect far more often than its level says.

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
from scipy.stats import norm, t

from handover.cosim.blocks.ports import Floats
from handover.scenarios.runs.campaign.statistics import LEVEL

_NODES: Floats = np.linspace(-8.0, 8.0, 161)
"""Of the trapezoidal rule over a standard normal variable, whose error falls exponentially with the spacing: below 1e-8
where the intercepts' deviation is below 5. Nodes of Gauss and Hermite would have to be moved to each person."""
_COARSE: Floats = np.linspace(-4.9, 4.9, 29)
"""Of the intercepts beside slopes, and of the slopes below: the same rule, coarser, as there is a product of both; a
test compares it to the fine one. Slopes are known less sharply from the few ratings of a block."""
_SLOPES: Floats = np.linspace(-4.5, 4.5, 19)
_logistic = cast(Callable[[Floats], Floats], expit)
_TINY = 1e-300
_MAX_GRADIENT = 1e-2
_MAX_ERROR = 50.0
"""Standard errors above which the data do not bound an effect, as where one behaviour has all the highest ratings."""


@dataclass(frozen=True)
class Effect:
    """An effect on the log-odds of a higher rating.

    Attributes:
        estimate: by maximum likelihood.
        error: its standard error.
        low, high: its Wald interval at 95 %.
        p: of Wald's test that there is no effect.
    """

    estimate: float
    error: float
    low: float
    high: float
    p: float


@dataclass(frozen=True)
class MixedModel:
    """A fitted model.

    Attributes:
        effects: beta, of the columns of x, in order.
        thresholds: theta, between the categories that were used, in order.
        deviation: standard deviation sigma of the participants' intercepts, on the scale of log-odds.
        slope_deviation: tau, likewise of their slopes; None of a model without them.
        log_likelihood: at its maximum.
    """

    effects: Sequence[Effect]
    thresholds: Sequence[float]
    deviation: float
    slope_deviation: float | None
    log_likelihood: float


class NotFitted(ValueError):
    """Data that do not determine the model, with the reason."""


@dataclass(frozen=True)
class Slopes:
    """Random slopes of groups.

    Attributes:
        covariate: z of each rating, such as 0.5 and -0.5 of two behaviours.
        block: in which block a rating is, such as its task: a group has a slope of its own in each.
    """

    covariate: Sequence[float]
    block: Sequence[object]


def fit_mixed_ordinal(
    y: Sequence[int], x: ArrayLike, group: Sequence[object], slopes: Slopes | None = None
) -> MixedModel:
    """Fit logit P(y <= k) = theta_k - (x beta + u + z v), u ~ N(0, sigma^2), v ~ N(0, tau^2), by maximum likelihood.

    [Agresti2010] eq. (10.1), with the sign of [Christensen2019]: a positive beta makes higher ratings more probable.
    Each group has an intercept u, and with `slopes` a slope v of z in each block; all are independent. Were the slopes
    of a group in several blocks alike, the effect in one block would still have its right error. Categories that
    nobody used are left out: their thresholds would coincide.

    Intervals and p-values are Wald's by Student's t with one degree of freedom fewer than groups, as slopes are known
    by so many; without slopes by the normal distribution.

    Args:
        y: ratings.
        x: shape (ratings, effects), without a constant.
        group: whose rating it is.
        slopes: without them groups differ by their intercepts alone.

    Raises:
        NotFitted: only one category was used, effects cannot be told apart, or the maximum is at infinity.
    """
    likelihood = _Likelihood(y, np.asarray(x, dtype=np.float64).reshape(len(y), -1), group, slopes)
    start = likelihood.start()
    found = minimize(
        likelihood, start, jac=True, method="BFGS", options={"gtol": 1e-6 if slopes is None else 1e-4, "maxiter": 500}
    )
    at: Floats = found.x
    value, gradient = likelihood(at)
    if not np.isfinite(value) or np.abs(gradient).max() > _MAX_GRADIENT:
        raise NotFitted("the likelihood has no maximum that could be found")
    k, n = likelihood.thresholds, likelihood.x.shape[1]
    covariance = _inverse(_jacobian(likelihood, at), k + n)
    errors = np.sqrt(np.diagonal(covariance))[k : k + n]
    if not np.all(np.isfinite(errors)) or np.any(errors > _MAX_ERROR):
        raise NotFitted("an effect is not bounded by the data: all ratings of one kind are beyond those of another")
    freedom = np.inf if slopes is None else len(set(group)) - 1
    effects = [_effect(float(b), float(e), freedom) for b, e in zip(at[k : k + n], errors, strict=True)]
    deviations = [abs(float(s)) for s in at[k + n :]]
    slope = None if slopes is None else deviations[1]
    return MixedModel(effects, likelihood.theta(at).tolist(), deviations[0], slope, -value)


def _effect(estimate: float, error: float, freedom: float) -> Effect:
    half = float(t.ppf(1.0 - LEVEL / 2, freedom)) * error
    p = 2.0 * float(t.sf(abs(estimate) / error, freedom))
    return Effect(estimate, error, estimate - half, estimate + half, p)


class _Likelihood:
    """The negative marginal log-likelihood and its gradient, by (theta_1, log steps of theta, beta, sigma, tau).

    Given the intercept, the blocks of a group are independent: slopes are integrated in each block, then intercepts.
    Ratings that are alike, with the same x and z, are computed once, and counted in each block of a group.
    """

    def __init__(self, y: Sequence[int], x: Floats, group: Sequence[object], slopes: Slopes | None) -> None:
        used, of = np.unique(np.asarray(y), return_inverse=True)
        if len(used) < 2:
            raise NotFitted("all ratings are the same")
        if np.linalg.matrix_rank(x - x.mean(axis=0)) < x.shape[1]:
            raise NotFitted("the data do not tell its effects apart")
        self.thresholds, self.has_slopes = len(used) - 1, slopes is not None
        self._shares = np.bincount(of) / len(of)
        z = np.zeros(len(of)) if slopes is None else np.asarray(slopes.covariate, dtype=np.float64)
        kinds, kind = np.unique(np.column_stack([of, x, z]), axis=0, return_inverse=True)
        self.y: NDArray[np.int64] = kinds[:, 0].astype(np.int64)
        self.x, self._z = kinds[:, 1:-1], kinds[:, -1]
        blocks = list(zip(group, [None] * len(of) if slopes is None else slopes.block, strict=True))
        places = {block: k for k, block in enumerate(dict.fromkeys(blocks))}
        self._counts: Floats = np.zeros((len(places), len(kinds)))
        for block, k in zip(blocks, kind.reshape(-1), strict=True):
            self._counts[places[block], k] += 1.0
        names = list(dict.fromkeys(group))
        self._members: Floats = np.array([[float(g == name) for g, _ in places] for name in names])
        self._nodes, self._weights = _normal(_COARSE if slopes is not None else _NODES)
        self._slopes, self._slope_weights = _normal(_SLOPES) if slopes is not None else (np.zeros(1), np.ones(1))

    def start(self) -> Floats:
        """Return parameters that fit the categories' frequencies, without effects."""
        shares = np.cumsum(self._shares)[:-1]
        theta = np.log(shares / (1.0 - shares))
        return np.concatenate([theta[:1], np.log(np.diff(theta)), np.zeros(self.x.shape[1]), self._deviations()])

    def _deviations(self) -> list[float]:
        return [1.0, 1.0] if self.has_slopes else [1.0]

    def theta(self, at: Floats) -> Floats:
        """Return the thresholds."""
        return at[0] + np.concatenate([[0.0], np.cumsum(np.exp(at[1 : self.thresholds]))])

    def __call__(self, at: Floats) -> tuple[float, Floats]:
        k, n = self.thresholds, self.x.shape[1]
        theta, beta, sigma, tau = self.theta(at), at[k : k + n], at[k + n], at[-1] if self.has_slopes else 0.0
        bounds = np.concatenate([[-np.inf], theta, [np.inf]])
        shape = (len(self.y), len(self._nodes), len(self._slopes))
        slope: Floats = self._z[:, None] * self._slopes  # of each kind of rating, at each node of slopes
        eta = (self.x @ beta)[:, None, None] + sigma * self._nodes[:, None] + tau * slope[:, None, :]
        upper = _logistic(bounds[self.y + 1][:, None, None] - eta)
        lower = _logistic(bounds[self.y][:, None, None] - eta)
        p: Floats = np.maximum(upper - lower, _TINY)
        log_p: Floats = (self._counts @ np.log(p).reshape(shape[0], -1)).reshape(-1, *shape[1:])  # of each block
        in_block, log_blocks = _integrated(log_p, self._slope_weights)
        in_group, log_groups = _integrated(self._members @ log_blocks, self._weights)
        at_nodes: Floats = (np.transpose(self._members) @ in_group)[:, :, None] * in_block  # posterior of each block
        posterior: Floats = (np.transpose(self._counts) @ at_nodes.reshape(len(at_nodes), -1)).reshape(shape)
        weighted: Floats = posterior / p
        up: Floats = weighted * upper * (1.0 - upper)
        low: Floats = weighted * lower * (1.0 - lower)
        by_theta = np.bincount(self.y, up.sum(axis=(1, 2)), k + 1)[:-1]
        by_theta = by_theta - np.bincount(self.y, low.sum(axis=(1, 2)), k + 1)[1:]
        by_first = np.concatenate([[by_theta.sum()], np.exp(at[1:k]) * by_theta[::-1].cumsum()[::-1][1:]])
        by_eta: Floats = low - up
        by_beta: Floats = np.transpose(self.x) @ by_eta.sum(axis=(1, 2))
        by_deviations = [float(by_eta.sum(axis=(0, 2)) @ self._nodes), float((by_eta.sum(axis=1) * slope).sum())]
        by_deviations = by_deviations[: len(self._deviations())]
        return -float(log_groups.sum()), -np.concatenate([by_first, by_beta, by_deviations])


def _normal(nodes: Floats) -> tuple[Floats, Floats]:
    """Return nodes with the weights of the trapezoidal rule over a standard normal variable."""
    return nodes, np.asarray(norm.pdf(nodes) * (nodes[1] - nodes[0]), dtype=np.float64)


def _integrated(log_p: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the posterior over the nodes of the last axis, and the logarithm of the integral over them."""
    largest: Floats = log_p.max(axis=-1, keepdims=True)
    each: Floats = weights * np.exp(log_p - largest)
    total: Floats = each.sum(axis=-1, keepdims=True)
    return each / total, (np.log(total) + largest)[..., 0]


def _jacobian(function: _Likelihood, at: Floats) -> Floats:
    """Return the second derivatives by central differences of the gradient."""
    steps = 1e-5 * np.maximum(1.0, np.abs(at))
    rows = [
        (function(at + h * unit)[1] - function(at - h * unit)[1]) / (2.0 * h)
        for h, unit in zip(steps, np.eye(len(at)), strict=True)
    ]
    return np.add(rows, np.transpose(rows)) / 2.0


def _inverse(hessian: Floats, n: int) -> Floats:
    """Return the covariance; the first n parameters must be determined, deviations may be at their bound of 0."""
    try:
        covariance: Floats = np.asarray(np.linalg.inv(hessian), dtype=np.float64)
    except np.linalg.LinAlgError as e:
        raise NotFitted("the data do not determine all its parameters") from e
    if np.any(np.diagonal(covariance)[:n] <= 0.0):
        raise NotFitted("the data do not determine all its parameters")
    return covariance
