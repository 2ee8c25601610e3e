"""Jacobi coupling: all units step from the values at a communication point, as if in parallel; loops are solved."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, ClassVar

from handover.cosim.stepping.ensemble import Ensemble, LastStep
from handover.cosim.stepping.gauss_seidel import GroupStepping
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.stepping.pending_steps import PendingSteps
from handover.cosim.stepping.solvers import MakeSolver
from handover.cosim.stepping.stepper import Traits
from handover.cosim.system.loops import Group
from handover.cosim.system.schedule import Slot


class Jacobi:
    """A step's results count from the time where it ends, for sampled units too.

    Direct feedthrough takes effect a step later here. In an algebraic loop that delay would make another system of it,
    which may grow without bound although the loop has a solution: so the units of a loop step together, iterated until
    they converge as with Gauss-Seidel, from the values that all others have at the communication point. Where loops
    feed each other, later ones get the results of those before.

    Also called the parallel scheme: C. Gomes et al., Co-simulation: a survey, ACM Comput. Surv. 51 (2018) 49.
    """

    traits: ClassVar = Traits(summary="all from those of one time", parallel=True, in_plan=True)

    def __init__(
        self, ensemble: Ensemble, sampled: Sequence[Group], continuous: Sequence[Group], make_solver: MakeSolver,
        late: Collection[str],  # noqa: ARG002
    ) -> None:  # fmt: skip
        """Couple units; all are `late` here."""
        self._ensemble = ensemble
        self.count = IterationCount()
        loops = [group for group in (*continuous, *sampled) if group.cycle]
        self._in_loops = {name for group in loops for name in group.units}
        self._loops = GroupStepping(ensemble, loops, make_solver, self.count)

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Fetch what steps that end at t have computed."""
        for slot in (*sampled, *continuous):
            self._ensemble.publish(slot.unit)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Set all inputs, then step, isolated units all at the same time.

        Units of loops come last, so that their results reach no other input.
        """
        due = [slot for slot in (*sampled, *continuous) if slot.unit not in self._in_loops]
        for slot in sampled:
            if slot.unit not in self._in_loops:
                self._ensemble.feed(slot.unit, t)
        for slot in continuous:
            if slot.unit not in self._in_loops:
                self._ensemble.feed(slot.unit, t, slot.period)
        last = LastStep()
        with self._ensemble.stopwatch() as charge:

            def finish(slot: Slot) -> None:
                with last.completed():
                    self._ensemble.step(slot.unit, t, slot.period)
                charge(slot.unit)

            pending = PendingSteps(self._ensemble, finish)
            here = [slot for slot in due if not pending.begin(slot, t)]
            for slot in here:
                with pending.failing_first(due[: due.index(slot)]):
                    finish(slot)
            pending.finish()
        self._loops.step(t, [slot for slot in (*sampled, *continuous) if slot.unit in self._in_loops])
        last.end()

    def get_state(self) -> Mapping[str, Any]:
        """Return the solvers' states and the counts, nothing where no unit iterates; see `Coupling`."""
        return {"loops": self._loops.get_state(), "count": self.count.get_state()} if self.count.steps else {}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._loops.set_state(state.get("loops", []))
        self.count.set_state(state.get("count", IterationCount().get_state()))
