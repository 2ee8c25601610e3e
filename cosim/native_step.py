"""The call that lets a unit step, for programs in C."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NativeStep:
    """What a program in C needs to let a unit step: addresses; `flags` are what FMI 3 tells of a step."""

    fmi: int
    function: int
    component: int
    flags: tuple[int, ...]
