"""A block that does something harmful to its interpreter, chosen by a parameter or an input."""

import ctypes
import enum
import os
import struct
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from handover.cosim.blocks.ports import output, parameter, port
from handover.cosim.blocks.units import Number


class Deed(enum.IntEnum):
    NONE = 0
    EXIT = 1
    CRASH = 2
    HANG = 3
    CHATTER = 4
    SYSTEM_EXIT = 5
    INTERRUPT = 6
    LEAVE_A_CHILD = 7
    FAIL_DEEP_DOWN = 8


@dataclass(frozen=True, kw_only=True)
class Params:
    deed_at_start: Deed = parameter(Deed.NONE, "what to do when the block is made")


@dataclass(kw_only=True)
class Inputs:
    deed: Deed = port(Deed.NONE, "what to do in a step")


@dataclass(kw_only=True)
class Outputs:
    count: Number = output("steps done")
    process: Number = output("the interpreter's process")
    word: str = output("some words")


class Trouble:
    """Counts its steps."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self._count = 0.0
        do(params.deed_at_start)

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(count=self._count, process=float(os.getpid()), word=f"{self._count:g} steps")

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        do(u.deed)
        self._count += 1.0
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return struct.pack("d", self._count)

    def set_state(self, state: bytes) -> None:
        (self._count,) = struct.unpack("d", state)


def do(deed: Deed) -> None:
    if deed is Deed.EXIT:
        os._exit(7)
    if deed is Deed.CRASH:
        ctypes.string_at(0)
    if deed is Deed.HANG:
        threading.Event().wait()
    if deed is Deed.CHATTER:
        for i in range(20000):
            print("words, words, words", i)
    if deed is Deed.SYSTEM_EXIT:
        raise SystemExit(3)
    if deed is Deed.INTERRUPT:
        raise KeyboardInterrupt
    if deed is Deed.FAIL_DEEP_DOWN:
        even(30)
    if deed is Deed.LEAVE_A_CHILD:
        if os.fork() == 0:
            threading.Event().wait()  # with the channel open
        os._exit(7)


def even(depth: int) -> None:
    odd(depth - 1)


def odd(depth: int) -> None:
    if depth < 0:
        raise RuntimeError("the deepest reason")
    even(depth - 1)
