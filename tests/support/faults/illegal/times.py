"""Modes and times against the standards."""

import ctypes
import math
import random
from typing import Any

from support.faults.event_mode import to_step_mode
from support.faults.subject import DISCARD, Fault, Subject

MODES = {
    "SetupExperiment": ("instantiated",),
    "EnterInitializationMode": ("instantiated",),
    "ExitInitializationMode": ("initialisation",),
    "Terminate": ("stepping", "event"),
    "DoStep": ("stepping",),
    "EnterStepMode": ("event",),
    "EnterEventMode": ("stepping",),
    "UpdateDiscreteStates": ("event",),
    "EvaluateDiscreteStates": ("initialisation", "event"),
    "GetRealStatus": ("stepping", "terminated"),
    "GetBooleanStatus": ("stepping", "terminated"),
}
"""Where a function is allowed."""

NOT_FINITE = (math.nan, math.inf, -math.inf)


def wrong_mode(s: Subject, rng: random.Random) -> None:
    forbidden = [f for f, modes in MODES.items() if f in s.unit.functions and s.mode not in modes]
    function = rng.choice(forbidden)
    s.expect_refusal(function, *in_order(s, function))


def event_mode_that_was_not_wanted(s: Subject, rng: random.Random) -> None:  # noqa: ARG001
    if s.unit.fmi == 3 and s.mode == "stepping" and not s.event_mode:
        s.expect_refusal("EnterEventMode")


def in_order(s: Subject, function: str) -> tuple[Any, ...]:
    """Return arguments that are right in the right mode."""
    memory = ctypes.create_string_buffer(64)
    at = ctypes.addressof(memory)
    s.kept = memory
    if function == "DoStep":
        return s.step_arguments(s.t, s.unit.step)
    if function == "UpdateDiscreteStates":
        return tuple(at + 8 * i for i in range(6))
    if function in ("GetRealStatus", "GetBooleanStatus"):
        return (2 if function == "GetRealStatus" else 3, at)
    times = (False, 0.0, 0.0, False, 0.0)
    return times if function == "SetupExperiment" or (function[:9] == "EnterInit" and s.unit.fmi == 3) else ()


def wrong_step(s: Subject, rng: random.Random) -> None:
    if s.mode != "stepping":
        return
    t, dt = s.t, s.unit.step
    wrong_time = rng.choice([t + dt, t - dt, t + 0.01 * dt, *NOT_FINITE, 1e300])
    wrong_dt = rng.choice([0.0, -dt, -0.0, *NOT_FINITE, -1e300])
    s.expect_refusal("DoStep", *s.step_arguments(*rng.choice([(wrong_time, dt), (t, wrong_dt)])))


def step_without_place_for_its_answers(s: Subject, rng: random.Random) -> None:
    if s.mode == "stepping" and s.unit.fmi == 3:
        given = list(s.step_arguments(s.t, s.unit.step))
        given[rng.randrange(3, 7)] = None
        s.expect_refusal("DoStep", *given)


def wrong_start(s: Subject, rng: random.Random) -> None:
    if s.mode != "instantiated":
        return
    function = "SetupExperiment" if s.unit.fmi == 2 else "EnterInitializationMode"
    start, stop = rng.choice([(rng.choice(NOT_FINITE), 1.0), (0.0, -1.0), (0.0, math.nan), (5.0, 4.999)])
    s.expect_refusal(function, False, 0.0, start, True, stop)


def wrong_status_kind(s: Subject, rng: random.Random) -> None:
    if s.unit.fmi == 2 and s.mode in ("stepping", "terminated"):
        value = ctypes.c_double()
        s.expect_refusal("GetRealStatus", rng.choice([0, 1, 3, 4, -1, 1 << 30]), ctypes.byref(value), status=DISCARD)
        s.expect_refusal("GetBooleanStatus", rng.choice([0, 1, 2, 4, -1]), ctypes.byref(value), status=DISCARD)
        s.expect_refusal("GetRealStatus", 2, None)


def wrong_categories(s: Subject, rng: random.Random) -> None:
    names = (ctypes.c_char_p * 2)(b"logAll", rng.choice([b"logNothing", b"", None, b"\xff%n#"]))
    s.expect_refusal("SetDebugLogging", True, 2, rng.choice([names, None]))


def step_past_the_end(s: Subject, rng: random.Random) -> None:
    """However huge: the stop time is the end."""
    if s.mode == "instantiated":
        s.enter(0.0, 1.5 * s.unit.step)
        if s.exit():
            to_step_mode(s)
            s.expect_refusal("DoStep", *s.step_arguments(s.t, rng.choice([2.0 * s.unit.step, 1e9, 1e300])))


REFUSALS = (
    wrong_mode,
    wrong_mode,
    wrong_mode,
    event_mode_that_was_not_wanted,
    wrong_step,
    wrong_step,
    step_without_place_for_its_answers,
    wrong_start,
    wrong_status_kind,
    wrong_categories,
)


def enter_without_setup(s: Subject, rng: random.Random) -> None:  # noqa: ARG001
    """FMI 2.0 has hosts call fmi2SetupExperiment before; hosts that do not are let through: the time begins with 0."""
    if s.unit.fmi == 2 and s.mode == "instantiated":
        s.demand("EnterInitializationMode")
        s.mode = "initialisation"
        if not s.exit() or s.time() != 0.0:
            raise Fault("the unit does not begin at 0 without fmi2SetupExperiment")


POISONS = (step_past_the_end, enter_without_setup)
