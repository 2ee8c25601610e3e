"""An arm that hangs while it runs, in Python or in native code, to test that Ctrl-C ends the run.

The file that HANGING_ARM_TELLS names is made just before.
"""

import ctypes
import os
from pathlib import Path

from handover.plants.helix.arm.tendon_arm import Inputs, Outputs, TendonArm


class HangingArm(TendonArm):
    """The Helix until it hangs in Python."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > 0.09:
            Path(os.environ["HANGING_ARM_TELLS"]).touch()
        while t > 0.09:
            pass
        return super().step(t, dt, u)


class NativelyHangingArm(TendonArm):
    """The Helix until it hangs in native code, by taking a lock twice."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > 0.09:
            Path(os.environ["HANGING_ARM_TELLS"]).touch()
            lock = ctypes.create_string_buffer(256)  # zeros are an open lock
            system = ctypes.CDLL(None)
            system.pthread_mutex_lock(lock)
            system.pthread_mutex_lock(lock)
        return super().step(t, dt, u)
