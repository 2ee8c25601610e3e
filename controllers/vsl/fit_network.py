"""Trains networks: small ones by numpy, the published one by PyTorch. [Gandarias2020] sec. IV-B."""

import importlib
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.vsl.fit import SMALLEST, domain_of, rounded
from handover.controllers.vsl.learned_model import Domain, Learned
from handover.controllers.vsl.network import ACTIVATIONS, LAYERS, Activation, Network, Weights
from handover.cosim.blocks.ports import Floats

DECAYS = (3e-6, 3e-5)
"""Penalties tried on squared weights, per training point and standardised value (own choice)."""

STEPS = 600
"""Quasi-Newton steps for each penalty (own choice)."""

EPOCHS, BATCH, RATE = 200, 128, 1e-3
"""Passes over the points, points for a step, and the first step's rate, which falls to 0 by a cosine; [Gandarias2020]
gives none of its hyperparameters."""


class NoPyTorch(ValueError):
    """PyTorch, which alone trains the published network in reasonable time, is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "the published network of 1.6 million weights is trained by PyTorch, which is not installed: "
            '`pip install "handover-cosim[train]"`; it is evaluated without'
        )


@dataclass(frozen=True)
class NetworkFit:
    """A trained network, its root mean square error on the validation points, and how it was trained."""

    network: Network
    validation_rms: float
    facts: dict[str, Any]


@dataclass(frozen=True)
class Points:
    """Inputs x and values y to train on and to choose by, shapes (points, inputs) and (points, values)."""

    x: Floats
    y: Floats
    x_validation: Floats
    y_validation: Floats


def fit_small(points: Points, seed: int, steps: int = STEPS) -> NetworkFit:
    """Train a network with two layers of 32 by the L-BFGS method, with the gradient of its layers in numpy.

    Of the penalties, the one with the least error of the validation points is taken.
    """
    import scipy  # of the training alone
    from scipy.optimize import minimize

    frame = _Frame.of(points)
    sizes = (points.x.shape[1], *LAYERS[Learned.SMALL], points.y.shape[1])
    first = _pack(_first_weights(sizes, np.random.default_rng(seed)))
    fits: list[NetworkFit] = []
    for decay in DECAYS:
        value = _objective(frame.z, frame.y, sizes, decay)
        found = minimize(value, first, jac=True, method="L-BFGS-B", options={"maxiter": steps, "maxcor": 30})
        parts = _unpack(found.x.astype(np.float32).astype(np.float64), sizes)  # as its file has them
        network = frame.network(parts, ACTIVATIONS[Learned.SMALL])
        fits.append(
            NetworkFit(
                network, rms(network, points), {"decay": decay, "steps": int(found.nit), "scipy": scipy.__version__}
            )
        )
    return min(fits, key=lambda f: f.validation_rms)


def fit_published(points: Points, seed: int, epochs: int, progress: Callable[[float, float], None]) -> NetworkFit:
    """Train a network of the published size by Adam, on one core or several; the best epoch is kept.

    Raises:
        NoPyTorch: it is not installed.
    """
    torch = torch_or_refusal()
    frame = _Frame.of(points)
    generator = torch.Generator().manual_seed(seed)
    sizes = (points.x.shape[1], *LAYERS[Learned.PUBLISHED], points.y.shape[1])
    first = _first_weights(sizes, np.random.default_rng(seed))
    z, y, z_validation = (torch.tensor(a, dtype=torch.float32) for a in (frame.z, frame.y, frame.z_validation))
    y_validation = torch.tensor(frame.y_validation, dtype=torch.float32)
    module = published_module(torch, first)
    optimizer = torch.optim.Adam(module.parameters(), lr=RATE, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs)
    best, kept, best_epoch = math.inf, [np.array(w) for w in first], 0
    for epoch in range(epochs):
        order = torch.randperm(len(z), generator=generator)
        for batch in torch.split(order, BATCH):
            optimizer.zero_grad()
            loss = torch.mean((module(z[batch]) - y[batch]) ** 2)
            loss.backward()
            optimizer.step()
        schedule.step()
        with torch.no_grad():
            error = float(torch.mean((module(z_validation) - y_validation) ** 2))
        if error < best:
            best, best_epoch = error, epoch + 1
            kept = [np.array(p.detach().numpy()) for p in module.parameters()]
        progress(epoch + 1, epochs)
    parts: list[Weights] = list(map(_transposed, kept))
    network = frame.network(parts, ACTIVATIONS[Learned.PUBLISHED])
    facts = {"epochs": epochs, "best_epoch": best_epoch, "batch": BATCH, "rate": RATE, "torch": str(torch.__version__)}
    return NetworkFit(network, rms(network, points), facts)


def torch_or_refusal() -> Any:
    """Return PyTorch.

    Raises:
        NoPyTorch: it is not installed.
    """
    try:
        return importlib.import_module("torch")
    except ImportError as e:
        raise NoPyTorch from e


def published_module(torch: Any, parts: list[Weights]) -> Any:
    """Return layers of PyTorch with ReLU in between, of weights (inputs, outputs) and biases in turn."""
    layers: list[Any] = []
    for W, b in zip(parts[0::2], parts[1::2], strict=True):
        layer = torch.nn.Linear(*W.shape)
        with torch.no_grad():
            layer.weight.copy_(torch.tensor(np.transpose(W)))
            layer.bias.copy_(torch.tensor(b))
        layers += [layer, torch.nn.ReLU()]
    return torch.nn.Sequential(*layers[:-1])


def rms(network: Network, points: Points) -> float:
    """Return the root mean square error of the validation points, in the values' unit."""
    return float(np.sqrt(np.mean((network.predict(points.x_validation) - points.y_validation) ** 2)))


@dataclass(frozen=True)
class _Frame:
    """Standardised inputs and values."""

    domain: Domain
    mean_y: Floats
    scale_y: Floats
    z: Floats
    y: Floats
    z_validation: Floats
    y_validation: Floats

    @classmethod
    def of(cls, points: Points) -> "_Frame":
        domain = domain_of(points.x)
        mean_y = rounded(np.mean(points.y, axis=0))
        largest = max(float(np.max(np.std(points.y, axis=0))), SMALLEST)
        scale_y = rounded(np.full(len(mean_y), largest))  # one for all: what is noise alone is not blown up
        y, y_validation = ((v - mean_y) / scale_y for v in (points.y, points.y_validation))
        z, z_validation = domain.standardised(points.x), domain.standardised(points.x_validation)
        return cls(domain, mean_y, scale_y, z, y, z_validation, y_validation)

    def network(self, parts: list[Weights], activation: Activation) -> Network:
        d = self.domain
        weights, biases = tuple(parts[0::2]), tuple(parts[1::2])
        return Network(d.mean, d.scale, d.hull, weights, biases, activation, self.mean_y, self.scale_y)


def _transposed(part: Any) -> Weights:
    """Return weights as PyTorch does not have them, (inputs, outputs); biases as they are."""
    return np.ascontiguousarray(np.transpose(part))


def _first_weights(sizes: tuple[int, ...], rng: np.random.Generator) -> list[Weights]:
    """Return weights and biases in turn: normal, such that neurons keep the size of what comes in; biases 0."""
    parts: list[Weights] = []
    for k, (n, m) in enumerate(itertools.pairwise(sizes)):
        gain = 2.0 if len(sizes) > _DEEP and 0 < k < len(sizes) - 2 else 1.0  # ReLU lets half through
        parts += [rng.normal(0.0, math.sqrt(gain / n), (n, m)), np.zeros(m)]
    return parts


_DEEP = 5
"""Layers, inputs and outputs included, from which it matters that signals do not fade."""


def _objective(z: Floats, y: Floats, sizes: tuple[int, ...], decay: float) -> Callable[[Floats], tuple[float, Floats]]:
    """Return the mean square error with its penalty, and the gradient, of packed weights of a network with tanh."""

    def value(packed: Floats) -> tuple[float, Floats]:
        parts = _unpack(packed, sizes)
        signals: list[Any] = [z]
        for W, b in zip(parts[0:-2:2], parts[1:-2:2], strict=True):
            signals.append(np.tanh(signals[-1] @ W + b))
        error: Any = signals[-1] @ parts[-2] + parts[-1] - y
        penalty = decay * sum(float(np.sum(W * W)) for W in parts[0::2])
        back: Any = 2.0 * error / error.size
        gradient: list[Any] = []
        for k in range(len(signals) - 1, -1, -1):
            weights: Any = parts[2 * k]
            gradient = [np.transpose(signals[k]) @ back + 2.0 * decay * weights, np.sum(back, axis=0), *gradient]
            if k:
                back = (back @ np.transpose(weights)) * (1.0 - signals[k] ** 2)
        squares: Floats = error**2
        return float(np.mean(squares)) + penalty, _pack(gradient)

    return value


def _pack(parts: list[Any]) -> Floats:
    return np.concatenate([np.ravel(p) for p in parts])


def _unpack(packed: Floats, sizes: tuple[int, ...]) -> list[Weights]:
    parts: list[Weights] = []
    at = 0
    for n, m in itertools.pairwise(sizes):
        parts += [packed[at : at + n * m].reshape(n, m), packed[at + n * m : at + n * m + m]]
        at += n * m + m
    return parts
