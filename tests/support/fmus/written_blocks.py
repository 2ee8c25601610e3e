"""Blocks that a test writes into a folder of its own."""

from pathlib import Path

BLOCK = """
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from handover.cosim.blocks.ports import output, parameter
from handover.cosim.blocks.units import Number

if TYPE_CHECKING:
    import cv2


@dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclass(kw_only=True)
class Inputs:
    pass


@dataclass(kw_only=True)
class Outputs:
    y: Number = output("answer")


class Small:
    "Answers."

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None: ...

    def outputs(self, t: float, u: Inputs) -> Outputs:
        from {helper} import answer

        return Outputs(y=answer())

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t, u)

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None: ...
"""


def write_block(folder: Path, name: str, answer: str, helper: str = "shared_helper") -> str:
    """Write a block and a module that it imports; return the block's path."""
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.py").write_text(BLOCK.replace("{helper}", helper))
    (folder / f"{helper}.py").write_text(f"def answer():\n    return {answer}\n")
    return f"{name}:Small"
