"""Instances that cannot be, no instance at all, and what a unit does not support."""

import ctypes
import random
from typing import Any

from support.faults.subject import DISCARD, ERROR, Fault, Subject

WITHOUT_INSTANCE = ("GetVersion", "GetTypesPlatform", "FreeInstance")

NEVER_OFFERED = {
    2: "CancelStep GetStatus GetIntegerStatus GetStringStatus SetRealInputDerivatives GetRealOutputDerivatives "
    "EnterEventMode EnterContinuousTimeMode NewDiscreteStates CompletedIntegratorStep SetTime SetContinuousStates "
    "GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates",
    3: "EnterConfigurationMode ExitConfigurationMode EnterContinuousTimeMode CompletedIntegratorStep SetTime "
    "SetContinuousStates GetContinuousStateDerivatives GetEventIndicators GetContinuousStates "
    "GetNominalsOfContinuousStates GetNumberOfEventIndicators GetNumberOfContinuousStates ActivateModelPartition",
}
"""Functions of model exchange, of scheduled execution, of asynchronous steps."""

CLOCKS = (
    "GetClock SetClock GetIntervalDecimal GetIntervalFraction GetShiftDecimal GetShiftFraction SetIntervalDecimal "
    "SetIntervalFraction SetShiftDecimal SetShiftFraction"
)


def not_offered(s: Subject, rng: random.Random) -> None:
    names = NEVER_OFFERED[s.unit.fmi].split()
    if s.unit.fmi == 3 and not s.unit.has_clocks:
        names += CLOCKS.split()
    function = rng.choice(names)
    status = DISCARD if function.endswith("Status") else ERROR
    s.expect_refusal(function, *anything(s, function)[1:], status=status)


def no_instance(s: Subject, rng: random.Random) -> None:
    names = [n for n in s.unit.functions if n not in WITHOUT_INSTANCE and "Instantiate" not in n]
    function = rng.choice(names)
    status = s.bare(function, None, *anything(s, function)[1:])
    if status != ERROR:
        raise Fault(f"{function} without an instance is answered with {status}")
    s.bare("FreeInstance", None)


def anything(s: Subject, function: str) -> list[Any]:
    """Return arguments of the right types; memory holds references that no variable has."""
    memory = ctypes.create_string_buffer(b"\xff" * 512)
    s.kept = memory
    values = {ctypes.c_void_p: ctypes.addressof(memory), ctypes.c_size_t: 1, ctypes.c_double: 0.0, ctypes.c_bool: False}
    return [values.get(kind, 0) for kind in s.unit.signatures[function]]


def instance_that_cannot_be(s: Subject, rng: random.Random) -> None:
    """A wrong token or folder, or another kind of unit; reported in the log, if there is one."""
    if rng.random() > 0.3:
        return
    wrong: dict[str, Any] = rng.choice(
        [
            {"token": b"{0}"},
            {"token": None},
            {"token": b"\xff\xfe"},
            {"resources": None},
            {"resources": b"file:///nowhere/at/all"},
            {"resources": b""},
            {"resources": b"\xff%n%s%00%zz"},
            {"resources": b"x" * 100_000},
            {"token": b"{0}", "logger": None},
            {"kind": 0, "token": b"{0}"},
            {"callbacks": None, "token": b"{0}"},
        ]
    )
    del s.log[:]
    if s.instantiate(**wrong):
        raise Fault(f"an instance is made with {wrong}")
    silent = ("logger" in wrong and s.unit.fmi == 3) or ("callbacks" in wrong and s.unit.fmi == 2)
    if not silent:
        s.expect_log_line("Instantiate" if s.unit.fmi == 2 else "InstantiateCoSimulation")


def instance_of_another_kind(s: Subject, rng: random.Random) -> None:
    if s.unit.fmi == 2:
        return
    function = rng.choice(["InstantiateModelExchange", "InstantiateScheduledExecution"])
    given = anything(s, function)
    logger = [i for i, kind in enumerate(given) if kind == given[-1]]
    del s.log[:]
    for i in logger:
        given[i] = None
    if s.bare(function, *given):
        raise Fault(f"{function} makes an instance")


REFUSALS = (not_offered, not_offered, no_instance, no_instance, instance_that_cannot_be, instance_of_another_kind)
