"""The FMI calls that `Instance` makes besides setting and getting: states, directional derivatives, steps.

States are saved, restored, freed and turned into bytes by `StateCalls`, derivatives come from `derivatives_along`. Of
steps: what C code needs to make the call (`NativeStep`), how a step ended (`StepEnd`), and how far a discarded one got
(`discarded_step`). The two standards differ in names and arguments, which only this file and `buffers` need to know.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.fmu.file.description import FmuDescription, FmuPort

State = ctypes.c_void_p
"""A saved state of one instance: a pointer whose meaning only the unit knows."""

Call = Callable[..., None]
"""Calls an FMI function by its name without `fmi2` or `fmi3`; raises `UnitFailure` above status Warning."""


class StateCalls:
    """Saves and restores an instance's state; all methods raise `UnitFailure` where the unit fails."""

    def __init__(self, call: Call, fmi: int) -> None:
        self._call = call
        self._name = "FMUstate" if fmi == 2 else "FMUState"
        self._deserialise = "DeSerializeFMUstate" if fmi == 2 else "DeserializeFMUState"
        self._byte: Any = ctypes.c_char if fmi == 2 else ctypes.c_uint8

    def save(self) -> State:
        """Let the unit save its state; it is freed by `free`."""
        state = State()
        self._call(f"Get{self._name}", ctypes.byref(state))
        return state

    def restore(self, state: State) -> None:
        """Restore a saved state, which may be used again."""
        self._call(f"Set{self._name}", state)

    def free(self, state: State) -> None:
        """Free a saved state."""
        self._call(f"Free{self._name}", ctypes.byref(state))

    def serialise(self, state: State) -> bytes:
        """Return a saved state as bytes that are valid in another process too."""
        size = ctypes.c_size_t()
        self._call(f"Serialized{self._name}Size", state, ctypes.byref(size))
        data = (self._byte * size.value)()
        self._call(f"Serialize{self._name}", state, data, size)
        return bytes(data)

    def deserialise(self, data: bytes) -> State:
        """Return the state that was serialised to these bytes; it is freed by `free`."""
        state = State()
        buffer = (self._byte * len(data)).from_buffer_copy(data)
        self._call(self._deserialise, buffer, ctypes.c_size_t(len(data)), ctypes.byref(state))
        return state


def derivatives_along(
    call: Call, fmi: int, description: FmuDescription, outputs: Sequence[str], inputs: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Return directional derivatives of outputs; see `Instance.directional_derivative`."""
    unknowns, knowns = [description.outputs[y] for y in outputs], [description.inputs[u] for u in inputs]
    seed = np.concatenate([np.asarray(inputs[p.name], dtype=np.float64) for p in knowns])
    sensitivity = np.zeros(sum(p.size for p in unknowns))
    references = (_references(unknowns), _references(knowns))
    lengths = ((), ()) if fmi == 2 else ((len(seed),), (len(sensitivity),))
    vectors = (_doubles(seed), *lengths[0], _doubles(sensitivity), *lengths[1])
    call("GetDirectionalDerivative", *(a for r in references for a in (r, len(r))), *vectors)
    ends = np.cumsum([p.size for p in unknowns])[:-1]
    return dict(zip(outputs, np.split(sensitivity, ends), strict=True))


def _references(ports: Sequence[FmuPort]) -> Any:
    references = [r for p in ports for r in p.references]
    return (ctypes.c_uint * len(references))(*references)


def _doubles(values: Floats) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@dataclass(frozen=True)
class NativeStep:
    """Addresses that C code needs to call DoStep; `flags` are those of FMI 3's output arguments.

    `begin` is the function that begins the step of an isolated instance, with the arguments of FMI 2's DoStep; 0 for
    others.
    """

    fmi: int
    function: int
    component: int
    flags: tuple[int, ...]
    begin: int = 0


_LAST_SUCCESSFUL_TIME, _TERMINATED = ctypes.c_int(2), ctypes.c_int(3)  # of fmi2StatusKind


def discarded_step(function: Callable[[str], Any], component: Any, t: float, fmi: int) -> tuple[float, bool]:
    """Ask a unit how far a discarded step got, and whether it wants to end the simulation. FMI 2.0.4, sec. 4.2.3.

    In FMI 3 it has not advanced, and there is nothing to ask (FMI 3.0, sec. 2.2.4).

    Args:
        function: returns the unit's functions by their names without `fmi2`.
        component: the instance.
        t: the step's begin in seconds, which is returned where the unit gives no other time.
        fmi: version of its standard.
    """
    if fmi == 3:
        return t, False
    reached, terminated = ctypes.c_double(t), ctypes.c_int()
    if function("GetRealStatus")(component, _LAST_SUCCESSFUL_TIME, ctypes.byref(reached)) > 1:
        reached.value = t
    status = function("GetBooleanStatus")(component, _TERMINATED, ctypes.byref(terminated))
    return reached.value, status <= 1 and bool(terminated.value)


_TOLERATED = 1e-3
"""Part of a step by which the time that a unit says to have reached may be off: units add up steps of their own."""
_ROUNDING = 16 * 2.0**-52
"""Relative error of times that is rounding."""


def is_rounding(difference: float, t: float) -> bool:
    """Return whether a difference of two times near t, in seconds, is rounding."""
    return abs(difference) <= _ROUNDING * abs(t)


class StepReturns:
    """What fmi3DoStep returns besides a status. FMI 2 has nothing like it; there a step without Discard is complete.

    Attributes:
        arguments: what DoStep takes for it.
        addresses: where it lies, for C code.
    """

    def __init__(self, fmi: int) -> None:
        self._event, self._ends, self._early = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool()
        self._last = ctypes.c_double()
        of_fmi3 = (self._event, self._ends, self._early, self._last) if fmi == 3 else ()
        self.arguments: tuple[Any, ...] = tuple(ctypes.byref(c) for c in of_fmi3)
        self.addresses = tuple(ctypes.addressof(c) for c in of_fmi3)

    def clear(self, end: float) -> None:
        """Hold what a unit leaves as it is in a step to `end` that is complete."""
        self._event.value = self._ends.value = self._early.value = False
        self._last.value = end

    @property
    def event(self) -> bool:
        """Whether the unit has an event that is to be handled in event mode."""
        return self._event.value

    @property
    def ends(self) -> bool:
        """Whether the unit asks to end the simulation."""
        return self._ends.value

    @property
    def last(self) -> float:
        """Until which time the unit says to have stepped, s."""
        return self._last.value

    def time_reached(self, t: float, dt: float, *, early_allowed: bool) -> float | str:
        """Return which time a step of dt from t has reached, s, or what is wrong if it cannot have reached that.

        A unit that does not return early may give less than the step's end: some advance by whole steps of their own.
        To end the simulation it may return early in any case. What is asked here, `carry_out.c` asks in C.
        """
        end, last = t + dt, self.last
        if last == end or not self.addresses:
            return end
        slack = _TOLERATED * dt + _ROUNDING * abs(end)
        if not t - slack <= last <= end + slack:
            step = f"its step went from {t:.9g} s to {end:.9g} s"
            return f"returned t = {last:.9g} s as its last successful time, but {step}"
        if self.ends or (self._early.value and early_allowed):
            return min(max(t, last), end)
        if self._early.value and last < end - slack:
            return f"returned early, at t = {last:.9g} s of a step to {end:.9g} s, which was not allowed"
        return end


@dataclass(frozen=True)
class StepEnd:
    """How a unit's step ended.

    Attributes:
        reached: the time that the unit has reached, s.
        early: whether that is before the step's end.
        event: whether it has an event there, which is to be handled in event mode.
        discarded: whether it discarded the step; `reached` is then how far it got in FMI 2, and the step's begin in
            FMI 3.
    """

    reached: float
    early: bool = False
    event: bool = False
    discarded: bool = False
