"""An instance under test and what a host that keeps to the standard knows of it."""

import ctypes
import math
import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from support.faults.call_ring import CallRing
from support.faults.foreign_unit import ForeignUnit, Variable

OK, WARNING, DISCARD, ERROR = range(4)
NUMBERS: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Float32": ctypes.c_float,
    "Float64": ctypes.c_double,
    "Integer": ctypes.c_int,
    **{f"{sign}Int{n}": getattr(ctypes, f"c_{sign.lower()}int{n}") for sign in ("", "U") for n in (8, 16, 32, 64)},
    "String": ctypes.c_char_p,
}
Log2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
Log3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", Log2),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


class Fault(Exception):
    """A unit did not do what the standard, or this project, promises."""


@dataclass(frozen=True)
class Saved:
    """A saved state and what the host knew of the instance then."""

    pointer: int
    mode: str
    t: float
    stop: float
    start: float
    ticks: int
    needs_event: bool


class Subject:
    """An instance. Its calls are noted in the ring before they are made; what is legal must be answered with OK.

    Attributes:
        mode: instantiated, initialisation, stepping, event, terminated; or failed after an error that is not at odds
            with the standard, when only reset, a saved state or the instance's end may follow.
        start: its time at initialisation.
        ticks: how often the host has activated its clock, if the host does; `next_tick` is the time of the next.
        needs_event: whether the last step asked for event mode.
        log: messages since it was last emptied.
        refused: how often legal values were answered with an error.
    """

    def __init__(
        self, unit: ForeignUnit, ring: CallRing, name: str, *, event_mode: bool = False, early_return: bool = False
    ) -> None:
        self.unit, self.ring, self.name = unit, ring, name
        self.log: list[str] = []
        self._forget_times()
        self.event_mode, self.early_return = event_mode, early_return
        self.refused = self.answered = 0
        self.kept: Any = None  # memory that a call's arguments point into
        self._log2, self._log3 = Log2(self._keep), Log3(self._keep)
        self.callbacks = Callbacks(logger=self._log2)
        self.handle: int | None = self.instantiate()
        if not self.handle:
            raise Fault(f"the unit was not instantiated: {self.log}")

    def _keep(self, *arguments: Any) -> None:
        self.log.append(arguments[-1].decode("utf-8", "replace"))

    def instantiate(self, **changed: Any) -> int | None:
        """Make an instance, with other arguments by their names here if wanted; return its handle."""
        given = {"name": b"x", "token": self.unit.token, "resources": self.unit.resources, **changed}
        logger = ctypes.cast(self._log3, ctypes.c_void_p)
        if self.unit.fmi == 2:
            host = given.get("callbacks", ctypes.byref(self.callbacks))
            kind = given.get("kind", 1)
            return self.bare("Instantiate", given["name"], kind, given["token"], given["resources"], host, 0, 0)
        more = (None, 0, None, given.get("logger", logger), None)
        flags = (False, False, self.event_mode, self.early_return)
        return self.bare("InstantiateCoSimulation", given["name"], given["token"], given["resources"], *flags, *more)

    def bare(self, function: str, *arguments: Any) -> Any:
        """Call a function that takes these arguments and no others."""
        self.ring.note(f"{self.name} [{self.mode}] {function}({shown(arguments)})")
        return self.unit.functions[function](*arguments)

    def call(self, function: str, *arguments: Any) -> int:
        """Call a function with the instance; return its status."""
        self.answered += 1
        return self.bare(self.spelt(function), self.handle, *arguments)

    def spelt(self, function: str) -> str:
        """Return a function's name as the standard's version spells it."""
        if self.unit.fmi == 2:
            return function.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")
        return function

    def demand(self, function: str, *arguments: Any) -> None:
        """Call a function that must be answered with OK."""
        status = self.call(function, *arguments)
        if status != OK:
            raise Fault(f"{function} in {self.mode} is answered with {status}; log: {self.log[-1:]}")

    def attempt(self, function: str, *arguments: Any) -> bool:
        """Call a function that runs the block, which may reject impossible values, but not silently."""
        del self.log[:]
        status = self.call(function, *arguments)
        if status == OK:
            return True
        if status != ERROR:
            raise Fault(f"{function} is answered with {status}")
        self.expect_log_line(function)
        self.refused += 1
        self.mode = "failed"
        return False

    def expect_log_line(self, function: str) -> None:
        """Raise a fault if no message names the function and the reason."""
        name = f"fmi{self.unit.fmi}{self.spelt(function)}: "
        if not any(len(line.partition(name)[2]) > 5 for line in self.log):
            raise Fault(f"{function} is answered with an error and no log line: {self.log}")

    def expect_refusal(self, function: str, *arguments: Any, status: int = ERROR) -> None:
        """Call a function that must be answered with that status, an error, and a log line that names it."""
        del self.log[:]
        answer = self.call(function, *arguments)
        if answer != status:
            raise Fault(f"{function}({shown(arguments)}) in {self.mode} is answered with {answer}, not with {status}")
        self.expect_log_line(function)

    def set(self, variables: Sequence[Variable], values: Sequence[Sequence[Any]]) -> int:
        """Set variables of one type; return the status."""
        kind, entries = variables[0].type, [x for value in values for x in value]
        references, n = references_of(variables)
        if kind == "Binary":
            sizes = (ctypes.c_size_t * len(entries))(*map(len, entries))
            pointers = (ctypes.c_char_p * len(entries))(*entries)
            return self.call("SetBinary", references, n, sizes, pointers, n)
        data = (self.type_of(kind) * len(entries))(*entries)
        more = (len(entries),) if self.unit.fmi == 3 else ()
        return self.call(f"Set{kind}", references, n, data, *more)

    def get(self, variables: Sequence[Variable]) -> list[Any] | None:
        """Get variables of one type; None if the block rejected its inputs. Real values are finite."""
        kind, (references, n) = variables[0].type, references_of(variables)
        if kind == "Binary":
            sizes, pointers = (ctypes.c_size_t * n)(), (ctypes.c_void_p * n)()
            if not self.attempt("GetBinary", references, n, sizes, pointers, n):
                return None
            return [ctypes.string_at(p or 0, s) if s else b"" for p, s in zip(pointers, sizes, strict=True)]
        count = sum(v.size for v in variables)
        data = (self.type_of(kind) * count)()
        more = (count,) if self.unit.fmi == 3 else ()
        if not self.attempt(f"Get{kind}", references, n, data, *more):
            return None
        found = list(data)
        if kind in ("Real", "Float32", "Float64") and not all(map(math.isfinite, found)):
            raise Fault(f"not finite after OK: {[v.name for v in variables]} = {found}")
        return found

    def type_of(self, kind: str) -> Any:
        """Return the type of C of a variable's entries."""
        if kind == "Boolean":
            return ctypes.c_int if self.unit.fmi == 2 else ctypes.c_bool
        return NUMBERS[kind]

    def save(self) -> Saved:
        """Save the state."""
        pointer = ctypes.c_void_p()
        self.demand("GetFMUState", ctypes.byref(pointer))
        return Saved(pointer.value or 0, self.mode, self.t, self.stop, self.start, self.ticks, self.needs_event)

    def restore(self, saved: Saved) -> None:
        """Go back to a saved state."""
        self.demand("SetFMUState", saved.pointer)
        self.mode, self.t, self.stop = saved.mode, saved.t, saved.stop
        self.start, self.ticks, self.needs_event = saved.start, saved.ticks, saved.needs_event

    def forget(self, saved: Saved) -> None:
        """Free a saved state."""
        self.demand("FreeFMUState", ctypes.byref(ctypes.c_void_p(saved.pointer)))

    def serialised(self, saved: Saved) -> bytes:
        """Return a saved state's bytes."""
        size = ctypes.c_size_t()
        self.demand("SerializedFMUStateSize", saved.pointer, ctypes.byref(size))
        data = ctypes.create_string_buffer(size.value)
        self.demand("SerializeFMUState", saved.pointer, data, size.value)
        return data.raw

    def deserialised(self, data: bytes, like: Saved) -> Saved:
        """Return a state made from bytes."""
        pointer = ctypes.c_void_p()
        self.demand("DeserializeFMUState", data, len(data), ctypes.byref(pointer))
        return replace(like, pointer=pointer.value or 0)

    def reset(self) -> None:
        """Reset, which must always help."""
        self.demand("Reset")
        self._forget_times()

    def _forget_times(self) -> None:
        self.mode, self.t, self.start, self.stop = "instantiated", 0.0, 0.0, math.inf
        self.ticks, self.needs_event = 0, False

    @property
    def next_tick(self) -> float:
        """The time of the clock's next tick; infinity if the host has no clock to activate."""
        if not self.event_mode or self.mode in ("instantiated", "initialisation"):
            return math.inf
        return self.start + self.ticks * self.unit.period if self.unit.has_clocks else math.inf

    def enter(self, start: float = 0.0, stop: float = math.inf, tolerance: float | None = None) -> None:
        """Enter initialisation mode."""
        has_stop, tolerances = math.isfinite(stop), (tolerance is not None, tolerance or 0.0)
        times = (*tolerances, start, has_stop, stop if has_stop else 0.0)
        if self.unit.fmi == 2:
            self.demand("SetupExperiment", *times)
            self.demand("EnterInitializationMode")
        else:
            self.demand("EnterInitializationMode", *times)
        self.mode, self.t, self.start, self.stop = "initialisation", start, start, stop

    def exit(self) -> bool:
        """Leave initialisation mode; return whether the block accepted the values that were set."""
        if self.attempt("ExitInitializationMode"):
            self.mode = "event" if self.event_mode else "stepping"
            return True
        return False

    def step(self, dt: float) -> bool:
        """Advance; return whether the block did. The time advances by less than `dt` if the unit returns early."""
        if not self.attempt("DoStep", *self.step_arguments(self.t, dt)):
            return False
        last, early = self.t + dt, False
        if self.unit.fmi == 3:
            last, needs_event, _, early = struct.unpack_from("=d???", self.kept)
            self.needs_event = self.event_mode and needs_event
        if early and not self.t <= last <= self.t + dt:
            raise Fault(f"a step from {self.t!r} s by {dt!r} s returned early at {last!r} s")
        self.t = last if early else self.t + dt
        result = self.time()
        if abs(result - self.t) > 1e-9 * max(1.0, abs(self.t)):
            raise Fault(f"the time is {result!r} after a step to {self.t!r}")
        return True

    def step_arguments(self, t: float, dt: float) -> tuple[Any, ...]:
        """Return the arguments of a step."""
        if self.unit.fmi == 2:
            return (t, dt, 0)
        self.kept = memory = ctypes.create_string_buffer(16)
        at = ctypes.addressof(memory)
        return (t, dt, False, at + 8, at + 9, at + 10, at)

    def time(self) -> float:
        """Return the instance's time."""
        value = ctypes.c_double()
        if self.unit.fmi == 2:
            self.demand("GetRealStatus", 2, ctypes.byref(value))
        else:
            references, _ = references_of(self.unit.of("independent"))
            self.demand("GetFloat64", references, 1, ctypes.byref(value), 1)
        return value.value

    def free(self) -> None:
        """End the instance."""
        self.bare("FreeInstance", self.handle)
        self.handle = None


def shown(arguments: Sequence[Any]) -> str:
    """Return arguments as text: of memory its size or what it begins with."""
    texts = [f"<{len(a)} bytes>" if isinstance(a, bytes) and len(a) > 40 else _shown(a) for a in arguments]
    return ", ".join(texts)


def _shown(argument: Any) -> str:
    if issubclass(type(argument), ctypes.Array):
        return f"<{type(argument).__name__} {argument[:4]!r:.60}>"
    return f"{argument!r:.60}"


def references_of(variables: Sequence[Variable]) -> tuple[Any, int]:
    """Return value references as an array, and their number."""
    references = [r for v in variables for r in v.references]
    return (ctypes.c_uint32 * len(references))(*references), len(references)


def of_one_type(variables: Sequence[Variable], rng: random.Random) -> list[Variable]:
    """Return a random choice of variables that one call can take."""
    kind = rng.choice(sorted({v.type for v in variables}))
    some = [v for v in variables if v.type == kind]
    return rng.sample(some, rng.randint(1, len(some)))
