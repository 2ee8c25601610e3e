"""Clocks against the standard: at wrong times, by wrong references, of another interval than the constant one."""

import ctypes
import random
from typing import Any

from support.faults.event_mode import tick_is_due
from support.faults.subject import Subject

ASKED = ("GetClock", "GetIntervalDecimal", "GetIntervalFraction", "GetShiftDecimal", "GetShiftFraction")
CONSTANT = ("SetIntervalDecimal", "SetIntervalFraction", "SetShiftDecimal", "SetShiftFraction")


def values(s: Subject, function: str) -> list[Any]:
    """Return memory for a function's values, all valid but the references and their number."""
    s.kept = memory = ctypes.create_string_buffer(64)
    at = ctypes.addressof(memory)
    arrays = s.unit.signatures[function][3:]
    return [at + 16 * i if kind is ctypes.c_void_p else 1 for i, kind in enumerate(arrays)]


def change_of_a_constant_clock(s: Subject, rng: random.Random) -> None:
    if s.unit.has_clocks:
        function = rng.choice(CONSTANT)
        s.expect_refusal(function, s.unit.clock, 1, *values(s, function))


def clock_in_a_wrong_mode(s: Subject, rng: random.Random) -> None:
    if s.unit.has_clocks and s.mode not in ("event", "initialisation"):
        function = rng.choice([*ASKED, "SetClock"])
        s.expect_refusal(function, s.unit.clock, 1, *values(s, function))


def clock_that_is_none(s: Subject, rng: random.Random) -> None:
    if s.unit.has_clocks:
        function = rng.choice([*ASKED, "SetClock"])
        wrong = (ctypes.c_uint32 * 1)(rng.choice([0, 1, s.unit.clock[0] + 1, s.unit.clock[0] - 1, 0xFFFFFFFF]))
        s.expect_refusal(function, rng.choice([wrong, None]), 1, *values(s, function))


def clock_off_its_tick(s: Subject, rng: random.Random) -> None:  # noqa: ARG001
    if s.unit.has_clocks and s.mode == "event" and not tick_is_due(s):
        s.expect_refusal("SetClock", s.unit.clock, 1, (ctypes.c_bool * 1)(True))


REFUSALS = (change_of_a_constant_clock, clock_in_a_wrong_mode, clock_that_is_none, clock_off_its_tick)
