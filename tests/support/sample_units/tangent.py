"""A block that knows the derivatives of its outputs by its inputs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector3, output, parameter, port
from handover.cosim.blocks.units import Metre, Number, Radian
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    gain: Number = parameter(3.0, "gain of y")


@dataclass(kw_only=True)
class Inputs:
    a: Radian = port(0.4, "angle")
    n: int = port(2, "number that y is multiplied with")
    r: Vector3[Metre] = port(np.array([1.0, 2.0, 3.0]), "arm")
    s: Vector3[Number] = port(np.array([0.5, -1.0, 0.25]), "axis")


@dataclass(kw_only=True)
class Outputs:
    y: Number = output("gain n sin(a) |r|^2")
    t_y: Number = output("the time")
    p: Vector3[Metre] = output("s x r")


class Tangent(Memoryless):
    """y = gain n sin(a) |r|^2, p = s x r."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"y": ("a", "n", "r"), "p": ("r", "s")}

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        k = self.params.gain * u.n
        return Outputs(y=k * math.sin(u.a) * float(u.r @ u.r), t_y=t + dt, p=np.cross(u.s, u.r))

    def directional_derivative(self, t: float, u: Inputs, du: Mapping[str, Any]) -> Mapping[str, Any]:  # noqa: ARG002
        k = self.params.gain * u.n
        da, dr, ds = du.get("a", 0.0), du.get("r", np.zeros(3)), du.get("s", np.zeros(3))
        if da == 666.0:
            return {"q": 1.0}
        dy = k * (math.cos(u.a) * da * float(u.r @ u.r) + 2.0 * math.sin(u.a) * float(u.r @ dr))
        return {"y": dy, "p": np.cross(ds, u.r) + np.cross(u.s, dr)}
