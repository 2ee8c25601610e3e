"""Protocols of a run's progress, `Stepper` through time and `Coupling` at a communication point, and fixed steps.

A stepper decides when communication points are and which units are due there; its coupling decides in which order
these get inputs, step and give outputs.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.stepping.solvers import InterfaceNewton, InterfaceSolver, MakeSolver
from handover.cosim.system.loops import Group
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


@dataclass(frozen=True, kw_only=True)
class Traits:
    """What help, checks and steppers ask of a coupling algorithm; a subclass says all of its own anew.

    Attributes:
        summary: which values units step from, in words that follow the algorithm's name in the help.
        solver: solves algebraic loops, also at the start, and whatever else is iterated.
        iterates: whether all units that are connected in a cycle repeat steps, which needs rollback, not loops alone.
        parallel: whether all units step from the values at one time; else one after another.
        in_plan: whether the loop in C does the same, as `PlanMaker` lays it out; else runs take the general path.
    """

    summary: str
    solver: type[InterfaceSolver] = InterfaceNewton
    iterates: bool = False
    parallel: bool = False
    in_plan: bool = False


class Coupling(Protocol):
    """A coupling algorithm: takes units from one communication point to the next.

    At a communication point t, `arrive` is called, then observers see the signals, then `depart`. Both get the units
    that are due there, in the schedule's order. A slot's `period` is the step to take, in seconds. Sampled units act
    once at an instant: those that have acted are not in a later `arrive` at it, but in `depart`. With events, both can
    be called several times at one instant.

    Args:
        ensemble: the units.
        sampled, continuous: groups of all units, each in the order in which they step. Those of algebraic loops are
            together, or where the algorithm iterates, all that are connected in a cycle.
        make_solver: makes a solver for each cycle.
        late: units whose steps may span communication points of others, so that their results count when they end.

    Attributes:
        count: iterated steps, their iterations and rollbacks; all zero where nothing is iterated.
    """

    traits: ClassVar[Traits]
    count: IterationCount

    def __init__(
        self, ensemble: Ensemble, sampled: Sequence[Group], continuous: Sequence[Group], make_solver: MakeSolver,
        late: Collection[str],
    ) -> None: ...  # fmt: skip

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


class GridStepper:
    """Communication points are whole ticks of the schedule's grid at which a unit is due: counted, so without drift."""

    def __init__(self, schedule: Schedule, coupling: Coupling, ensemble: Ensemble) -> None:
        self.time = schedule.time(0)
        self._schedule, self._coupling, self._ensemble = schedule, coupling, ensemble
        self._tick = 0
        self._due: dict[str, int] = {s.unit: 0 for s in schedule.slots}
        self._acted: dict[str, int] = {s.unit: -1 for s in schedule.sampled}

    def arrive(self, last: int) -> bool:
        """Go to the next tick at which a unit is due; see `Stepper`."""
        self._tick = min((last, *self._due.values()))
        self.time = self._schedule.time(self._tick)
        self._ensemble.external_inputs.ask(self.time)
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
        """Return the ticks, and the states of the coupling and of inputs; see `Stepper`."""
        ticks = {"tick": self._tick, "due": dict(self._due), "acted": dict(self._acted)}
        return {**ticks, "coupling": self._coupling.get_state(), **self._ensemble.get_input_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore the ticks that `get_state` returned."""
        self._tick = state["tick"]
        self._due, self._acted = dict(state["due"]), dict(state["acted"])
        self._coupling.set_state(state["coupling"])
        self._ensemble.set_input_state(state)
        self.time = self._schedule.time(self._tick)
