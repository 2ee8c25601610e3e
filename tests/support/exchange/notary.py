"""A block that writes numbers down as text with all their digits, for hosts whose own records are rounded."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats, Shape, output, port

ENTRIES = 160
"""As many numbers as any unit of the catalog has real outputs, and some more."""


@dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclass(kw_only=True)
class Inputs:
    x: Annotated[Floats, Shape((ENTRIES,))] = port(np.zeros(ENTRIES), "numbers")


@dataclass(kw_only=True)
class Outputs:
    text: str = output("the numbers, in hexadecimal, with blanks between them")


class Notary:
    """Writes down the numbers that hold when a step begins."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"text": ("x",)}
    period: float | None = None

    def __init__(self, params: Params) -> None:
        pass

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(text=" ".join(number.hex() for number in u.x.tolist()))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None:
        pass
