"""The standards' calls for the state of one instance: saved, restored, freed, and as bytes.

The standards' call for directional derivatives of one instance.

The call that lets a unit step, for programs in C.

What a unit tells of a step that it discarded.

How a step of a unit ended.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.fmu.description import FmuDescription, FmuPort

State = ctypes.c_void_p
"""A saved state of one instance, which alone knows what it points to."""

Call = Callable[..., None]
"""Calls a function of the standard by its name without `fmi2` or `fmi3`, and raises where it does not answer OK."""


class StateCalls:
    """Saves and restores an instance's state; each raises `UnitFailure` where the unit cannot."""

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
        """Go back to a saved state, which may be used again."""
        self._call(f"Set{self._name}", state)

    def free(self, state: State) -> None:
        """Free a saved state."""
        self._call(f"Free{self._name}", ctypes.byref(state))

    def serialise(self, state: State) -> bytes:
        """Return a saved state as bytes that mean the same in another process."""
        size = ctypes.c_size_t()
        self._call(f"Serialized{self._name}Size", state, ctypes.byref(size))
        data = (self._byte * size.value)()
        self._call(f"Serialize{self._name}", state, data, size)
        return bytes(data)

    def deserialise(self, data: bytes) -> State:
        """Return the state that `serialise` gave these bytes of; it is freed by `free`."""
        state = State()
        held = (self._byte * len(data)).from_buffer_copy(data)
        self._call(self._deserialise, held, ctypes.c_size_t(len(data)), ctypes.byref(state))
        return state


def derivatives_along(
    call: Call, fmi: int, description: FmuDescription, outputs: Sequence[str], inputs: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Return how outputs change with inputs; see `Instance.directional_derivative`."""
    unknowns, knowns = [description.outputs[y] for y in outputs], [description.inputs[u] for u in inputs]
    seed = np.concatenate([np.asarray(inputs[p.name], dtype=np.float64) for p in knowns])
    found = np.zeros(sum(p.size for p in unknowns))
    references = (_references(unknowns), _references(knowns))
    lengths = ((), ()) if fmi == 2 else ((len(seed),), (len(found),))
    vectors = (_doubles(seed), *lengths[0], _doubles(found), *lengths[1])
    call("GetDirectionalDerivative", *(a for r in references for a in (r, len(r))), *vectors)
    ends = np.cumsum([p.size for p in unknowns])[:-1]
    return dict(zip(outputs, np.split(found, ends), strict=True))


def _references(ports: Sequence[FmuPort]) -> Any:
    references = [r for p in ports for r in p.references]
    return (ctypes.c_uint * len(references))(*references)


def _doubles(values: Floats) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


@dataclass(frozen=True)
class NativeStep:
    """What a program in C needs to let a unit step: addresses; `flags` are what FMI 3 tells of a step."""

    fmi: int
    function: int
    component: int
    flags: tuple[int, ...]


_LAST_SUCCESSFUL_TIME, _TERMINATED = ctypes.c_int(2), ctypes.c_int(3)  # of fmi2StatusKind


def discarded_step(function: Callable[[str], Any], component: Any, t: float, fmi: int) -> tuple[float, bool]:
    """Ask a unit how far its step came, and whether it wants to end the simulation. FMI 2.0.4, sec. 4.2.3.

    In FMI 3 it stands where it stood, and there is nothing to ask (FMI 3.0, sec. 2.2.4).

    Args:
        function: gives the unit's functions by their names without `fmi2`.
        component: the instance.
        t: the step's begin in seconds, which stands where the unit does not tell.
        fmi: version of its standard.
    """
    if fmi == 3:
        return t, False
    reached, ended = ctypes.c_double(t), ctypes.c_int()
    if function("GetRealStatus")(component, _LAST_SUCCESSFUL_TIME, ctypes.byref(reached)) > 1:
        reached.value = t
    value = function("GetBooleanStatus")(component, _TERMINATED, ctypes.byref(ended))
    return reached.value, value <= 1 and bool(ended.value)


@dataclass(frozen=True)
class StepEnd:
    """What a unit answered to a step.

    Attributes:
        reached: the time where it stands, s.
        early: whether that is before the step's end.
        event: whether it has an event there, which event mode is to handle.
        discarded: whether it did not carry the step out; a unit of FMI 2 tells by `reached` how far it came, one of
            FMI 3 stands where it stood.
    """

    reached: float
    early: bool = False
    event: bool = False
    discarded: bool = False
