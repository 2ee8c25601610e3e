"""What a host with event mode does: the unit's clock at its ticks and events. FMI 3.0 sections 2.3.5, 4.2."""

import ctypes
from typing import Any

from support.faults.subject import Subject


def tick_is_due(s: Subject) -> bool:
    """Tell whether the host is to activate the clock at the instance's time."""
    return abs(s.next_tick - s.t) <= 1e-9 * max(1.0, abs(s.t))


def activate_clock(s: Subject) -> None:
    """Activate the clock."""
    s.demand("SetClock", s.unit.clock, 1, (ctypes.c_bool * 1)(True))


def update_arguments(s: Subject) -> tuple[Any, ...]:
    """Return the arguments of fmi3UpdateDiscreteStates."""
    s.kept = memory = ctypes.create_string_buffer(16)
    at = ctypes.addressof(memory)
    return (at + 8, at + 9, at + 10, at + 11, at + 12, at)


def settle(s: Subject) -> bool:
    """Activate the clock if it ticks and handle what is due; return whether the block did."""
    ticks = tick_is_due(s)
    if ticks:
        activate_clock(s)
    if not s.attempt("UpdateDiscreteStates", *update_arguments(s)):
        return False
    s.ticks += ticks
    s.needs_event = False
    return True


def to_step_mode(s: Subject) -> bool:
    """Go to step mode if not there, after what is due; return whether the block did that."""
    if s.mode == "stepping" and (s.needs_event or tick_is_due(s)):
        enter_event_mode(s)
    if s.mode != "event":
        return True
    if (s.needs_event or tick_is_due(s)) and not settle(s):
        return False
    s.demand("EnterStepMode")
    s.mode = "stepping"
    return True


def enter_event_mode(s: Subject) -> None:
    """Go to event mode."""
    s.demand("EnterEventMode")
    s.mode = "event"


def advance(s: Subject, dt: float) -> bool:
    """Do a step of at most `dt`, up to the clock's next tick; return whether the block did."""
    return to_step_mode(s) and s.step(min(dt, s.next_tick - s.t))
