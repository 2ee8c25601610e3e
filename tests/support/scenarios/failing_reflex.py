"""Reflexes that crash, hang or otherwise fail, to test how a campaign handles it."""

import ctypes
import os
import resource
import signal
import sys
import time
from pathlib import Path

from handover.controllers.ir_grasp.ir_reflex import Inputs, IrReflex, Outputs, Params

T_BAD = 0.1
"""From when on they misbehave, s."""


class BadReflex(IrReflex):
    """The reflex, until it does something else."""

    def misbehave(self) -> None: ...

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > T_BAD:
            self.misbehave()
        return super().step(t, dt, u)


class Raises(BadReflex):
    def misbehave(self) -> None:
        raise RuntimeError("a sensor broke")


class Crashes(BadReflex):
    def misbehave(self) -> None:
        ctypes.string_at(0)


class Hangs(BadReflex):
    def misbehave(self) -> None:
        while True:
            time.sleep(0.01)


class IsKilled(BadReflex):
    def misbehave(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class KillsItsServer(BadReflex):
    def misbehave(self) -> None:
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60)


class KillsItsWorker(BadReflex):
    def misbehave(self) -> None:
        worker = int(Path(f"/proc/{os.getppid()}/stat").read_text().rpartition(")")[2].split()[1])
        os.kill(worker, signal.SIGKILL)
        time.sleep(60)


class FillsTheDisk(BadReflex):
    def misbehave(self) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1, 1))


class Prints(BadReflex):
    printed = False

    def misbehave(self) -> None:
        if not self.printed:
            print("from Python", flush=True)
            os.write(2, b"from native code\n")
            print("input:", repr(sys.stdin.read()), flush=True)
        self.printed = True


class RefusesToStart(IrReflex):
    def __init__(self, params: Params) -> None:
        raise ValueError(f"no sensor is there for a {params.strategy.name.lower()}")


class CrashesAtStart(IrReflex):
    def __init__(self, params: Params) -> None:
        ctypes.string_at(0)
        super().__init__(params)
