"""Fully connected networks in place of polynomials, evaluated by numpy alone. [Gandarias2020] secs. IV-B and IV-C."""

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.vsl.learned_model import Domain, Learned
from handover.cosim.blocks.ports import Floats

Weights = NDArray[np.float32] | NDArray[np.float64]

LAYERS: Mapping[Learned, tuple[int, ...]] = {
    Learned.SMALL: (32, 32),
    Learned.PUBLISHED: (64, 256, 1024, 1024, 256, 64),
}
"""Neurons of the hidden layers. [Gandarias2020] sec. IV-B names seven layers and six widths: the seventh is the output
of 3, which is linear."""


class Activation(enum.Enum):
    """What each hidden neuron does with its sum: the published ones cut off below 0, smooth ones need fewer."""

    RELU = "relu"
    TANH = "tanh"


ACTIVATIONS: Mapping[Learned, Activation] = {Learned.SMALL: Activation.TANH, Learned.PUBLISHED: Activation.RELU}


@dataclass(frozen=True)
class Network(Domain):
    """y(x) = mean_y + scale_y N(z): N is one matrix after another on the standardised inputs, bent in between.

    It is computed in the precision of its weights, float32 or float64: half the bytes take half the time, and 1.6
    million weights are read for each y.

    Attributes:
        weights: of each layer, shape (neurons of the layer before, neurons).
        biases: of each layer, shape (neurons,).
        activation: of all layers but the last.
        mean_y, scale_y: shape (values,), in the values' units.
    """

    weights: tuple[Weights, ...]
    biases: tuple[Weights, ...]
    activation: Activation
    mean_y: Floats
    scale_y: Floats

    @property
    def domain(self) -> Domain:
        """The inputs that it was fitted on."""
        return self

    @property
    def neurons(self) -> tuple[int, ...]:
        """Numbers of neurons of the hidden layers."""
        return tuple(len(b) for b in self.biases[:-1])

    def predict(self, x: Floats) -> Floats:
        """Return y of inputs x, shape (..., inputs), as shape (..., values)."""
        a: Any = self.standardised(x).astype(self.weights[0].dtype)
        bend = _BENDS[self.activation]
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            a = bend(a @ W + b)
        return self.mean_y + self.scale_y * (a @ self.weights[-1] + self.biases[-1])

    def jacobian(self, x: Floats) -> Floats:
        """Return dy/dx at inputs x, shape (inputs,), as shape (values, inputs)."""
        a: Any = self.standardised(x).astype(self.weights[0].dtype)
        slopes: Any = np.eye(len(x), dtype=a.dtype)
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            a = _BENDS[self.activation](a @ W + b)
            slopes = (slopes @ W) * _SLOPES[self.activation](a)
        return np.transpose(slopes @ self.weights[-1]) * self.scale_y[:, None] * self.slopes(x)


def _relu(a: Any) -> Any:
    return np.maximum(a, 0.0, dtype=a.dtype)


_BENDS: Mapping[Activation, Callable[[Any], Any]] = {Activation.RELU: _relu, Activation.TANH: np.tanh}
_SLOPES: Mapping[Activation, Callable[[Any], Any]] = {  # by what the neuron gives
    Activation.RELU: lambda a: (a > 0.0).astype(a.dtype),
    Activation.TANH: lambda a: 1.0 - a * a,
}
