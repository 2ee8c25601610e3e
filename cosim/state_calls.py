"""The standards' calls for the state of one instance: saved, restored, freed, and as bytes."""

import ctypes
from collections.abc import Callable
from typing import Any

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
