"""The memory that a plan's loop works on, as the structs of `plan.h`, and the functions of its library."""

import ctypes
import functools
import logging
import weakref
from pathlib import Path

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.native_libraries import CompilationError
from handover.cosim.plan.compile import plan_library

_log = logging.getLogger(__name__)


class Kept(ctypes.Structure):
    """Memory that the loop enlarges as it needs."""

    _fields_ = (("memory", ctypes.c_void_p), ("size", ctypes.c_size_t))


class Segment(ctypes.Structure):
    """Operations of units that are due together: those from `first` until before `end`."""

    _fields_ = (("group", ctypes.c_int64), ("first", ctypes.c_int64), ("end", ctypes.c_int64))


class Group(ctypes.Structure):
    """Units with the same step, which are due together, and when; in ticks."""

    _fields_ = tuple((name, ctypes.c_int64) for name in ("every", "due", "acted", "sampled"))


class Part(ctypes.Structure):
    """Where a part of a record's rows comes from and where it goes; see `RecordBlock`."""

    _fields_ = (("values", ctypes.c_void_p), ("rows", ctypes.c_void_p), ("bytes", ctypes.c_size_t))


class Rows(ctypes.Structure):
    """Where rows of a record go."""

    _fields_ = (
        ("filled", ctypes.c_void_p),
        ("time", ctypes.c_void_p),
        ("capacity", ctypes.c_int64),
        ("parts", ctypes.POINTER(Part)),
        ("n_parts", ctypes.c_int64),
    )


class Warned(ctypes.Structure):
    """How often a call answered Warning, and the simulated time of the first in seconds."""

    _fields_ = (("n", ctypes.c_int64), ("first", ctypes.c_double))


class Plan(ctypes.Structure):
    """All state of the loop."""

    _fields_ = (
        ("operations", ctypes.c_void_p),
        ("arrive", ctypes.POINTER(Segment)),
        ("depart", ctypes.POINTER(Segment)),
        ("groups", ctypes.POINTER(Group)),
        ("n_arrive", ctypes.c_int64),
        ("n_depart", ctypes.c_int64),
        ("n_groups", ctypes.c_int64),
        ("offset", ctypes.c_int64),
        ("numerator", ctypes.c_uint64),
        ("denominator", ctypes.c_uint64),
        ("tick", ctypes.c_int64),
        ("time", ctypes.c_double),
        ("unit_times", ctypes.POINTER(ctypes.c_double)),
        ("spent", ctypes.POINTER(ctypes.c_double)),
        ("n_spent", ctypes.POINTER(ctypes.c_int64)),
        ("spent_capacity", ctypes.c_int64),
        ("clock", ctypes.c_double),
        ("heartbeat", ctypes.c_void_p),
        ("stopped_at", ctypes.c_int64),
        ("status", ctypes.c_int64),
        ("identity", ctypes.c_void_p),
        ("float_control", ctypes.c_uint64),
        ("warned", ctypes.POINTER(Warned)),
    )


@functools.cache
def loop() -> "ctypes.CDLL | None":
    """Return the plan's library, loaded; None where this machine has none, with a line in the log."""
    try:
        file = plan_library()
    except CompilationError as e:
        _log.warning("%s", e)
        return None
    return None if file is None else _loaded(file)


def note_crashes(heartbeat: Heartbeat) -> None:
    """Let this process note in a heartbeat, if it crashes, which thread did so and where; see `Heartbeat.crash`."""
    library = loop()
    if library is not None:
        library.plan_note_crash(heartbeat.crash_address)


class KeptMemory:
    """An array of n `Kept`, empty at first; their memory is freed with the last reference to this."""

    def __init__(self, library: ctypes.CDLL, n: int) -> None:
        array = (Kept * n)()
        self.address = ctypes.addressof(array)
        weakref.finalize(self, library.plan_free_kept, array, n)


def _loaded(file: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(file))
    plan = ctypes.POINTER(Plan)
    library.plan_time.restype = ctypes.c_double
    library.plan_time.argtypes = (ctypes.c_int64, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_uint64)
    library.plan_free_kept.argtypes = (ctypes.POINTER(Kept), ctypes.c_int64)
    library.plan_free_kept.restype = None
    library.plan_arrive.argtypes = (plan, ctypes.c_int64)
    library.plan_depart.argtypes = (plan,)
    library.plan_carry_out.argtypes = (plan, ctypes.c_int64, ctypes.c_int64)
    library.plan_note_crash.argtypes = (ctypes.c_void_p,)
    library.plan_note_crash.restype = None
    library.plan_run.argtypes = (plan, ctypes.c_int64, ctypes.c_int64, ctypes.c_bool, ctypes.POINTER(Rows))
    return library
