"""Blocks that do not return in a step, one of them until somebody opens a named pipe and closes it."""

import os
import re
from pathlib import Path

from support.cosim.master_blocks import Counter, CounterInputs, CounterOutputs

GO_ON = "ENDLESS_BLOCKS_GO_ON"
"""Environment variable: the pipe."""


class HangsInStep(Counter):
    """Counts until its fourth step."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            Path(os.environ[GO_ON]).read_bytes()
        return super().step(t, dt, u)


class HoldsTheInterpreter(Counter):
    """Counts until its fourth step, in which no other thread of its process comes to its turn."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            re.match(r"(a+)+$", "a" * 60 + "b")  # takes 2^60 tries, without a break
        return super().step(t, dt, u)
