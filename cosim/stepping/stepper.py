"""Protocols of a run's progress, `Stepper` through time and `Coupling` at a communication point, and fixed steps.

A stepper decides when communication points are and which units are due there; its coupling decides in which order
these get inputs, step and give outputs.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from handover.cosim.stepping.external_inputs import ExternalInputs
from handover.cosim.stepping.extrapolation import LinearExtrapolation
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.system.schedule import Schedule, Slot


class Stepper(Protocol):
    """Advances an ensemble through time."""

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
        """Return what a run that resumes from here needs besides the units' states, as JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        ...


class Coupling(Protocol):
    """Takes units from one communication point to the next.

    At a communication point t, `arrive` is called, then observers see the signals, then `depart`. Both get the units
    that are due there, in the schedule's order. A slot's `period` is the step to take, in seconds. Sampled units act
    once at an instant: those that have acted are not in a later `arrive` at it, but in `depart`. With events, both can
    be called several times at one instant.

    Attributes:
        count: iterated steps, their iterations and rollbacks; all zero where nothing is iterated.
    """

    count: IterationCount

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Bring the signals to what observers see at t."""
        ...

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Step the units that are due, from t."""
        ...

    def get_state(self) -> Mapping[str, Any]:
        """Return what a run that resumes from here needs besides the units' states, as JSON can hold it."""
        ...

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        ...


class AskingCoupling:
    """A coupling that asks for the inputs from outside before it arrives at a communication point.

    Args:
        coupling: passes them on, and does all else.
        inputs: what is asked for.
    """

    def __init__(self, coupling: Coupling, inputs: ExternalInputs) -> None:
        self._coupling, self._inputs = coupling, inputs
        self.count: IterationCount = coupling.count

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Ask, then bring the signals to what observers see at t.

        Raises:
            InvalidExternalValue: an input cannot take what its source gave.
        """
        self._inputs.ask(t)
        self._coupling.arrive(t, sampled, continuous)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Step the units that are due, from t."""
        self._coupling.depart(t, sampled, continuous)

    def get_state(self) -> Mapping[str, Any]:
        """Return the coupling's state, and the values that hold."""
        return {"coupling": self._coupling.get_state(), "external": self._inputs.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._coupling.set_state(state["coupling"])
        self._inputs.set_state(state["external"])


class GridStepper:
    """Communication points are whole ticks of the schedule's grid at which a unit is due: counted, so without drift.

    `extrapolation` sets the inputs that are extrapolated; None where all are held.
    """

    def __init__(
        self, schedule: Schedule, coupling: Coupling, extrapolation: LinearExtrapolation | None = None
    ) -> None:
        self._extrapolation = extrapolation
        self.time = schedule.time(0)
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
        """Return the ticks, the coupling's state and that of extrapolated inputs; see `Stepper`."""
        inputs = self._extrapolation
        extrapolation = {} if inputs is None else {"lines": inputs.get_state()}
        ticks = {"tick": self._tick, "due": dict(self._due), "acted": dict(self._acted)}
        return {**ticks, "coupling": self._coupling.get_state(), **extrapolation}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore the ticks that `get_state` returned."""
        self._tick = state["tick"]
        self._due, self._acted = dict(state["due"]), dict(state["acted"])
        self._coupling.set_state(state["coupling"])
        if self._extrapolation is not None:
            self._extrapolation.set_state(state["lines"])
        self.time = self._schedule.time(self._tick)
