"""Networks: evaluated by numpy as PyTorch does, with their Jacobian, and trained."""

import functools
import itertools

import numpy as np
import pytest

from handover.controllers.vsl.fit_network import Points, fit_published, fit_small, torch_or_refusal
from handover.controllers.vsl.learned_model import Learned
from handover.controllers.vsl.network import ACTIVATIONS, LAYERS, Network, Weights
from handover.cosim.blocks.ports import Floats

RNG = np.random.default_rng(2)
X = RNG.normal(size=(300, 7)) * [0.3, 0.3, 0.3, 5e4, 5e4, 0.2, 0.1] + [0.0, 0.5, -1.0, 1e5, 1e5, 0.5, 0.2]


def values(x: Floats) -> Floats:
    z = (x - X.mean(axis=0)) / X.std(axis=0)
    return np.column_stack([np.sin(z[:, 1]) + z[:, 3] * z[:, 5], z[:, 2] ** 2, 0.1 * z[:, 6]]) * 0.01


def network(kind: Learned, dtype: str = "float64") -> Network:
    rng, made = np.random.default_rng(4), list[Weights]()
    for n, m in itertools.pairwise((7, *LAYERS[kind], 3)):
        made += [(rng.normal(size=(n, m)) / np.sqrt(n)).astype(dtype), rng.normal(size=m).astype(dtype) * 0.1]
    domain, values = (X.mean(axis=0), X.std(axis=0), np.full(98, 9.0)), (np.array([0.3, 0.0, 0.2]), np.full(3, 0.1))
    return Network(*domain, tuple(made[0::2]), tuple(made[1::2]), ACTIVATIONS[kind], *values)


PYTORCH = {
    Learned.SMALL: [
        [0.3696721905, -0.03792145459, 0.2472669683],
        [0.247579561, 0.01423280558, 0.1786145249],
        [0.2937694895, 0.03373690076, 0.2226560204],
    ],
    Learned.PUBLISHED: [
        [0.3013777374, -0.003745548213, 0.1913357933],
        [0.3033868518, -0.01871085012, 0.2052437186],
        [0.2977430685, -0.009081727016, 0.2018960016],
    ],
}
"""What PyTorch 2.13 gives for the first three inputs, in double precision."""


@pytest.mark.parametrize("kind", list(PYTORCH))
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_numpy_gives_what_pytorch_gave(kind: Learned, dtype: str):
    np.testing.assert_allclose(network(kind, dtype).predict(X[:3]), PYTORCH[kind], atol=1e-6, rtol=0.0)


def test_the_published_networks_jacobian_is_the_derivative():
    """The small one's is among the models' of `test_feedback`."""
    made, x = network(Learned.PUBLISHED), X[7]
    step = 1e-6 * X.std(axis=0)
    J = [(made.predict(x + h) - made.predict(x - h)) / (2.0 * h.sum()) for h in np.diag(step)]
    np.testing.assert_allclose(made.jacobian(x) * X.std(axis=0), np.transpose(J) * X.std(axis=0), atol=1e-7)


def test_beyond_the_training_a_network_stays_what_it_is_there():
    made = network(Learned.SMALL)
    far = X[0] + np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(made.predict(far), made.predict(far + np.eye(7)[1]))
    assert made.outside(far)
    assert np.all(made.jacobian(far)[:, 1] == 0.0)


@functools.cache
def points() -> Points:
    return Points(X[:220], values(X[:220]), X[220:], values(X[220:]))


def test_a_small_network_learns():
    fit = fit_small(points(), seed=1, steps=150)
    assert fit.network.neurons == (32, 32)
    assert fit.validation_rms < 0.3 * float(np.std(values(X)))
    assert set(fit.facts) == {"decay", "steps", "scipy"}
    first, again, other = (fit_small(points(), seed=seed, steps=10).network.predict(X) for seed in (1, 1, 2))
    np.testing.assert_array_equal(again, first)
    assert np.any(other != first)


@pytest.mark.slow
def test_a_published_network_learns():
    pytest.importorskip("torch")
    seen: list[float] = []
    fit = fit_published(points(), seed=1, epochs=6, progress=lambda t, _end: seen.append(t))
    assert seen == [1, 2, 3, 4, 5, 6]
    assert fit.network.neurons == LAYERS[Learned.PUBLISHED]
    assert fit.validation_rms < 0.8 * float(np.std(values(X)))
    assert 1 <= fit.facts["best_epoch"] <= 6
    assert fit.facts["torch"] == str(torch_or_refusal().__version__)
