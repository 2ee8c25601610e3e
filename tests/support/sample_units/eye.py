"""A block with pictures and raw bytes."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import BLACK_1280X720, Picture1280x720, output, parameter, port
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    offset: int = parameter(1, "added to every byte", minimum=0, maximum=255)


@dataclass(kw_only=True)
class Inputs:
    picture: Picture1280x720 = port(BLACK_1280X720, "picture")
    note: bytes = port(b"", "any bytes")


@dataclass(kw_only=True)
class Outputs:
    brighter: Picture1280x720 = output("picture with the offset added")
    note_back: bytes = output("the bytes backwards")


class Eye(Memoryless):
    """Adds an offset to a picture."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"brighter": ("picture",), "note_back": ("note",)}
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(brighter=u.picture + np.uint8(self.params.offset), note_back=u.note[::-1])
