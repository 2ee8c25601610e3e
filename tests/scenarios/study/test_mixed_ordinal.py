"""The mixed ordinal model beside R's `ordinal::clmm`, numerical integration, and data of known parameters."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import norm
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.scenarios.study.statistics.mixed_ordinal import MixedModel, NotFitted, Slopes, fit_mixed_ordinal

WINE = """
23344455 12132354 23325544 32323253 23433333
32322454 11222323 22233334 12323244
"""
"""Bitterness of wine from 1 to 5, [Randall1989]: a group each judge; bottles 5 to 8 warm, 3, 4, 7, 8 with contact."""
JUDGES = WINE.split()
RATINGS = [int(c) for judge in JUDGES for c in judge]
DESIGN = [[b // 4, b // 2 % 2] for _ in JUDGES for b in range(8)]
WHO = [j for j in range(9) for _ in range(8)]


def test_the_example_of_rs_ordinal_package():
    """Printed in [Christensen2019]: `clmm(rating ~ temp + contact + (1 | judge), nAGQ = 10)`."""
    model = fit_mixed_ordinal(RATINGS, DESIGN, WHO)
    warm, contact = model.effects
    assert (warm.estimate, warm.error) == pytest.approx((3.062, 0.595), abs=1e-3)
    assert (contact.estimate, contact.error) == pytest.approx((1.833, 0.512), abs=1e-3)
    assert model.log_likelihood == pytest.approx(-81.53, abs=5e-3)
    assert model.deviation**2 == pytest.approx(1.288, abs=1e-3)
    assert model.thresholds == pytest.approx([-1.623, 1.513, 4.227, 6.086], abs=1e-3)
    assert warm.p < 1e-6


def test_the_marginal_likelihood_is_that_of_adaptive_integration():
    model = fit_mixed_ordinal(RATINGS, DESIGN, WHO)
    beta = np.array([e.estimate for e in model.effects])
    bounds = np.concatenate([[-np.inf], model.thresholds, [np.inf]])
    total = 0.0
    for judge in range(9):
        rows = [k for k, who in enumerate(WHO) if who == judge]
        y, eta = np.array(RATINGS)[rows], np.array(DESIGN)[rows] @ beta

        def integrand(u: float, above: Floats = bounds[y] - eta, below: Floats = bounds[y - 1] - eta) -> float:
            each: Floats = expit(above - u) - expit(below - u)
            return float(np.prod(each)) * float(norm.pdf(u, scale=model.deviation))

        total += float(np.log(quad(integrand, -12.0, 12.0, epsabs=1e-14, limit=200)[0]))
    assert model.log_likelihood == pytest.approx(total, abs=1e-6)


def drawn(
    rng: np.random.Generator, people: int, effect: float, deviation: float, slope_deviation: float = 0.0
) -> tuple[list[int], list[list[float]]]:
    y: list[int] = []
    x: list[list[float]] = []
    bounds = np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5, 4.5])
    for _ in range(people):
        u = rng.normal(0.0, deviation)
        own = effect + (rng.normal(0.0, slope_deviation) if slope_deviation else 0.0)
        for k in range(12):
            behaviour = 0.5 - k % 2
            y.append(1 + int((bounds < own * behaviour + u + rng.logistic()).sum()))
            x.append([behaviour])
    return y, x


def with_slopes(y: list[int], x: list[list[float]]) -> MixedModel:
    who = [k // 12 for k in range(len(y))]
    return fit_mixed_ordinal(y, x, who, Slopes([line[0] for line in x], ["task"] * len(y)))


def test_the_likelihood_with_slopes_is_that_of_integration_in_two_dimensions():
    y, x = drawn(np.random.default_rng(4), 8, 1.0, 1.5, 2.0)
    model = with_slopes(y, x)
    assert model.slope_deviation is not None
    node: Floats = np.linspace(-8.0, 8.0, 401)
    weights = norm.pdf(node) * (node[1] - node[0])
    u: Floats = model.deviation * node[:, None]
    v: Floats = model.slope_deviation * node[None, :]
    bounds = np.concatenate([[-np.inf], model.thresholds, [np.inf]])
    used = sorted(set(y))
    total = 0.0
    for who in range(8):
        product: Floats = np.ones((len(node), len(node)))
        for k in range(12 * who, 12 * who + 12):
            eta = model.effects[0].estimate * x[k][0] + u + v * x[k][0]
            place = used.index(y[k])
            each = 1.0 / (1.0 + np.exp(eta - bounds[place + 1])) - 1.0 / (1.0 + np.exp(eta - bounds[place]))
            product = product * each
        total += float(np.log(weights @ product @ weights))
    assert model.log_likelihood == pytest.approx(total, abs=1e-3)


@pytest.mark.slow
def test_slopes_of_people_are_found_and_widen_the_interval():
    studies = [drawn(np.random.default_rng(seed), 60, 1.0, 1.5, 2.0) for seed in range(4)]
    found = [with_slopes(y, x).slope_deviation for y, x in studies]
    assert np.mean([d for d in found if d is not None]) == pytest.approx(2.0, abs=0.3)
    y, x = studies[0]
    model, intercepts = with_slopes(y, x), fit_mixed_ordinal(y, x, [k // 12 for k in range(len(y))])
    assert intercepts.slope_deviation is None
    assert model.log_likelihood > intercepts.log_likelihood + 5.0
    assert model.effects[0].error > 1.3 * intercepts.effects[0].error


def test_without_differences_of_people_the_intercepts_do_not_vary():
    y, x = drawn(np.random.default_rng(3), 60, 0.8, 0.0)
    model = fit_mixed_ordinal(y, x, [k // 12 for k in range(len(y))])
    assert model.deviation < 0.35
    assert model.effects[0].low < 0.8 < model.effects[0].high


@pytest.mark.parametrize(
    ("y", "x"), [([5] * 6, [[0], [1]] * 3), ([1, 2, 3, 4, 5, 6], [[1], [1]] * 3), ([1, 9] * 6, [[0], [1]] * 6)]
)
def test_data_that_do_not_determine_it_are_refused_with_the_reason(
    y: list[int], x: list[list[float]], wording: Wording
):
    with pytest.raises(NotFitted) as refused:
        fit_mixed_ordinal(y, x, [k // 2 for k in range(len(y))])
    wording.check(refused.value)
