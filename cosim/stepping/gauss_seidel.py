"""Gauss-Seidel coupling: units step one after another, each from the newest values; those of a cycle iterate."""

import itertools
from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

from handover.cosim.stepping.ensemble import Ensemble, LastStep
from handover.cosim.stepping.interface import Interface
from handover.cosim.stepping.iteration import IteratedStep, IterationCount
from handover.cosim.stepping.pending_steps import PendingSteps
from handover.cosim.stepping.solvers import FixedPoint, MakeSolver
from handover.cosim.stepping.stepper import Traits
from handover.cosim.system.loops import Group
from handover.cosim.system.schedule import Slot


class GroupStepping:
    """Steps groups in the order given. Of a cycle whose units have several rates, those that are due iterate.

    Args:
        ensemble: the units.
        groups: all units that may be due.
        make_solver: makes a solver for each cycle.
        count: counts the iterated steps.
        late: units whose results are not published after their step, unless they iterate.
    """

    def __init__(
        self,
        ensemble: Ensemble,
        groups: Sequence[Group],
        make_solver: MakeSolver,
        count: IterationCount,
        late: Collection[str] = (),
    ) -> None:
        self._ensemble = ensemble
        self._groups = groups
        self._make_solver = make_solver
        self._count = count
        self._late = late
        self._place = {name: (i, j) for i, group in enumerate(groups) for j, name in enumerate(group.units)}
        self._iterated: dict[tuple[str, ...], IteratedStep | None] = {}
        for name, (i, _) in self._place.items():
            if groups[i].cycle:
                ensemble.instances[name].can_roll_back = True

    def step(self, t: float, due: Sequence[Slot]) -> None:
        """Step units that are due.

        Raises:
            UnitTerminated: a unit asks to end the simulation. UnitFailure: a unit's call failed. NotConverged: a cycle
                did not converge.
        """
        last = LastStep()
        in_order = sorted(due, key=lambda slot: self._place[slot.unit])
        for cycle, members in itertools.groupby(in_order, key=self._cycle_index):
            slots = list(members)
            iterated = None if cycle is None else self._iterated_step(self._groups[cycle], slots)
            if iterated is None:
                self._one_after_another(t, slots, last)
            else:
                iterated.step(t, slots)
        last.end()

    def get_state(self) -> list[Any]:
        """Return the state of each solver with the units that iterate with it, as JSON can hold it."""
        return [[list(units), step.solver.get_state()] for units, step in self._iterated.items() if step is not None]

    def set_state(self, state: list[Any]) -> None:
        """Restore what `get_state` returned."""
        self._iterated.clear()
        for units, solver_state in state:
            step = self._make(self._groups[self._place[units[0]][0]], units)
            if step is not None:
                step.solver.set_state(solver_state)
            self._iterated[tuple(units)] = step

    def _cycle_index(self, slot: Slot) -> int | None:
        """Return the index of the group that a unit iterates with; None for one that steps by itself."""
        i, _ = self._place[slot.unit]
        return i if self._groups[i].cycle else None

    def _iterated_step(self, group: Group, slots: Sequence[Slot]) -> IteratedStep | None:
        units = tuple(s.unit for s in slots)
        if units not in self._iterated:
            self._iterated[units] = self._make(group, units)
        return self._iterated[units]

    def _make(self, group: Group, units: Sequence[str]) -> IteratedStep | None:
        interface = Interface(self._ensemble, group.back(units))
        if not len(interface):
            return None
        return IteratedStep(self._ensemble, interface, self._make_solver(interface), self._count, group.message)

    def _one_after_another(self, t: float, due: Sequence[Slot], last: LastStep) -> None:
        with self._ensemble.stopwatch() as charge:

            def finish(slot: Slot) -> None:
                with last.completed():
                    self._ensemble.step(slot.unit, t, slot.period)
                if slot.unit not in self._late:
                    self._ensemble.publish(slot.unit)
                charge(slot.unit)

            pending = PendingSteps(self._ensemble, finish)
            for slot in due:
                pending.finish_sources(slot.unit)
                with pending.failing_first():
                    self._ensemble.feed(slot.unit, t, slot.period)
                    if not pending.begin(slot, t):
                        finish(slot)
            pending.finish()


class GaussSeidel:
    """At t, sampled units act on the values at t, then observers see all signals, then the others step from t.

    Units of a group with a cycle are iterated until they converge, see `IteratedStep`: here those of algebraic loops.

    Source: C. Gomes et al., Co-simulation: a survey, ACM Comput. Surv. 51 (2018) 49.
    """

    traits: ClassVar = Traits(summary="one after another, each from the newest", in_plan=True)

    def __init__(
        self,
        ensemble: Ensemble,
        sampled: Sequence[Group],
        continuous: Sequence[Group],
        make_solver: MakeSolver,
        late: Collection[str],
    ) -> None:
        self.count = IterationCount()
        self._ensemble, self._late = ensemble, late
        self._sampled = GroupStepping(ensemble, sampled, make_solver, self.count)
        self._continuous = GroupStepping(ensemble, continuous, make_solver, self.count, late)

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Fetch results that count from t on, and step the sampled units, whose outputs count at t itself."""
        for slot in continuous:
            if slot.unit in self._late:
                self._ensemble.publish(slot.unit)
        self._sampled.step(t, sampled)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Step the others, each with the outputs of those before it at the end of the step, but for late ones."""
        self._continuous.step(t, continuous)

    def get_state(self) -> Mapping[str, Any]:
        """Return the solvers' states and the counts, nothing where no unit iterates; see `Coupling`."""
        if not self.count.steps:
            return {}
        sampled, continuous = self._sampled.get_state(), self._continuous.get_state()
        return {"sampled": sampled, "continuous": continuous, "count": self.count.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._sampled.set_state(state.get("sampled", []))
        self._continuous.set_state(state.get("continuous", []))
        self.count.set_state(state.get("count", IterationCount().get_state()))


class IteratedNewton(GaussSeidel):
    """The iterated (strong, implicit) coupling: all units whose data flow is cyclic are iterated, not loops alone.

    Source: R. Kuebler, W. Schiehlen, Two methods of simulator coupling, Math. Comput. Model. Dyn. Syst. 6 (2000)
    93-113.
    """

    traits: ClassVar = Traits(summary="as fixed-point, but by Newton's method", iterates=True)


class IteratedFixedPoint(GaussSeidel):
    """The same, by relaxed fixed-point iteration, which solves algebraic loops here too."""

    traits: ClassVar = Traits(
        summary="in a cycle from values at its end, by iteration with rollback",
        iterates=True,
        solver=FixedPoint,
    )
