"""An arm of which every output is zero all the time, as of a unit that is not wired inside."""

import dataclasses
from typing import Any

import numpy as np

from handover.plants.vsl.arm import Inputs, Outputs, VslArm


class ZeroArm(VslArm):
    """Gives zeros."""

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return _zeros(super().outputs(t, u))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return _zeros(super().step(t, dt, u))


def _zeros(y: Outputs) -> Outputs:
    values: dict[str, Any] = {f.name: np.zeros_like(getattr(y, f.name)) for f in dataclasses.fields(y)}
    plain: dict[str, Any] = {n: float(v) if v.shape == () else v for n, v in values.items()}
    return dataclasses.replace(y, **plain)
