"""Blocks that crash or block the process that steps them, at an unusual input."""

import ctypes
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from handover.cosim.blocks.ports import output, parameter, port
from handover.cosim.blocks.units import Number
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    limit: Number = parameter(0.5, "an input above is fatal")


@dataclass(kw_only=True)
class Inputs:
    u: Number = port(0.1, "input", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    y: Number = output("the input")


class Crashing(Memoryless):
    """y = u, while u is small; then nothing any more."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"y": ("u",)}

    def __init__(self, params: Params) -> None:
        self.params = params

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(y=u.u)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if u.u > self.params.limit:
            self.die()
        return self.outputs(t + dt, u)

    def die(self) -> None:
        """Read where no memory is."""
        ctypes.string_at(0)


class Hanging(Crashing):
    """y = u, while u is small; then it never returns."""

    def die(self) -> None:
        """Wait for what nobody does."""
        threading.Event().wait()
