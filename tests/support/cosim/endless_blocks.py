"""Blocks that do not return: in a step, or as they are made, until a file appears whose path is a parameter."""

import os
import re
from pathlib import Path

from support.cosim.master_blocks import Counter, CounterInputs, CounterOutputs, CounterParams

GO_ON = "ENDLESS_BLOCKS_GO_ON"
"""Environment variable: the file whose appearance lets them go on."""


def _wait() -> None:
    while not Path(os.environ[GO_ON]).exists():
        pass


class HangsInStep(Counter):
    """Counts until its fourth step."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            _wait()
        return super().step(t, dt, u)


class HangsAtOnce(Counter):
    """Never starts."""

    def __init__(self, params: CounterParams) -> None:
        _wait()
        super().__init__(params)


class HoldsTheInterpreter(Counter):
    """Counts until its fourth step, in which no other thread of its process comes to its turn."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            re.match(r"(a+)+$", "a" * 60 + "b")  # takes 2^60 tries, without a break
        return super().step(t, dt, u)
