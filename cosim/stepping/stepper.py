"""How a run gets from one communication point to the next.

What an algorithm does to the units that are due at a communication point.

Fixed steps, each unit at its own rate, on one exact grid.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from handover.cosim.stepping.extrapolation import LinearExtrapolation
from handover.cosim.system.schedule import Schedule, Slot


class Stepper(Protocol):
    """Moves an ensemble through time."""

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        ...

    def arrive(self, last: int) -> bool:
        """Go to the next communication point, tick `last` at the latest; return whether that tick is reached."""
        ...

    def depart(self) -> None:
        """Step what is due at the communication point."""
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return what a run that goes on from here must know besides the units' states; JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to where `get_state` was called."""
        ...


class Coupling(Protocol):
    """Takes units from one communication point to the next.

    At a communication point t, `arrive` is called, then observers see the signals, then `depart`. Both get the units
    that are due there, in the schedule's order. A slot's `period` is the step to take, in seconds.
    """

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Bring the signals to what observers see at t."""
        ...

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Step the units that are due, from t."""
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return what a run that goes on from here must know besides the units' states; JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to where `get_state` was called."""
        ...


class GridStepper:
    """Communication points are whole ticks of the schedule's grid at which a unit is due: counted, so without drift.

    `lines` is what extrapolated inputs follow, if any are.
    """

    def __init__(
        self, schedule: Schedule, coupling: Coupling, extrapolated_inputs: LinearExtrapolation | None = None
    ) -> None:
        self._extrapolated_inputs = extrapolated_inputs
        self.time = 0.0
        self._schedule = schedule
        self._coupling = coupling
        self._tick = 0
        self._due: dict[str, int] = {s.unit: 0 for s in schedule.slots}
        self._acted: dict[str, int] = {s.unit: -1 for s in schedule.sampled}

    def arrive(self, last: int) -> bool:
        """Go to the next tick at which a unit is due; see `Stepper`."""
        self._tick = min((last, *self._due.values()))
        self.time = self._schedule.time(self._tick)
        sampled = [s for s in self._schedule.sampled if self._due[s.unit] == self._tick > self._acted[s.unit]]
        continuous = [s for s in self._schedule.continuous if self._due[s.unit] == self._tick]
        self._coupling.arrive(self.time, sampled, continuous)
        for slot in sampled:
            self._acted[slot.unit] = self._tick
        return self._tick == last

    def depart(self) -> None:
        """Step what is due at the tick."""
        sampled = [s for s in self._schedule.sampled if self._due[s.unit] == self._tick]
        continuous = [s for s in self._schedule.continuous if self._due[s.unit] == self._tick]
        self._coupling.depart(self.time, sampled, continuous)
        for slot in (*sampled, *continuous):
            self._due[slot.unit] += slot.every

    def get_state(self) -> Mapping[str, Any]:
        """Return the ticks, what the coupling keeps and what inputs follow; see `Stepper`."""
        extrapolated_inputs = (
            {} if self._extrapolated_inputs is None else {"lines": self._extrapolated_inputs.get_state()}
        )
        ticks = {"tick": self._tick, "due": dict(self._due), "acted": dict(self._acted)}
        return {**ticks, "coupling": self._coupling.get_state(), **extrapolated_inputs}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to ticks that `get_state` gave."""
        self._tick = state["tick"]
        self._due, self._acted = dict(state["due"]), dict(state["acted"])
        self._coupling.set_state(state["coupling"])
        if self._extrapolated_inputs is not None:
            self._extrapolated_inputs.set_state(state["lines"])
        self.time = self._schedule.time(self._tick)
