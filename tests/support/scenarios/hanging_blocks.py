"""Blocks that hang in a step, in Python or in native code, to test that Ctrl-C ends the run.

The file that HANGING_BLOCK_TELLS names is made just before.
"""

import ctypes
import os
from pathlib import Path

from support.cosim.master_blocks import Counter, CounterInputs, CounterOutputs


class HangsInPython(Counter):
    """Counts until its fourth step."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            Path(os.environ["HANGING_BLOCK_TELLS"]).touch()
        while t > 0.29:
            pass
        return super().step(t, dt, u)


class HangsInNativeCode(Counter):
    """Counts until its fourth step, in which it takes a lock twice."""

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        if t > 0.29:
            Path(os.environ["HANGING_BLOCK_TELLS"]).touch()
            lock = ctypes.create_string_buffer(256)  # zeros are an open lock
            system = ctypes.CDLL(None)
            system.pthread_mutex_lock(lock)
            system.pthread_mutex_lock(lock)
        return super().step(t, dt, u)
