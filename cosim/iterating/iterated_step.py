"""One step of units that act on each other in a circle, gone over again until they agree."""

import time
from collections.abc import Sequence

from handover.cosim.blocks.ports import Floats
from handover.cosim.ensemble import Ensemble
from handover.cosim.fmu.calls import State
from handover.cosim.iterating.interface import Interface
from handover.cosim.iterating.interface_solver import InterfaceSolver, Unsolved
from handover.cosim.iterating.iteration_count import IterationCount
from handover.cosim.iterating.not_converged import not_converged
from handover.cosim.system.schedule import Slot


class IteratedStep:
    """Lets units step one after another until the inputs that lead back have the values that come out at the end.

    Each goes from t with its inputs held at the values of the end of the step, or where inputs are extrapolated with
    inputs that lie on the line from the values of t to those. States are saved before and restored for each further
    iteration. Inputs that lead back but are not real keep the values of t. FMI leaves no other way to outputs for other
    inputs: after a step, outputs may not be fetched again once inputs are set.

    Args:
        ensemble: the units.
        interface: the inputs that lead back.
        solver: finds their values; it keeps what it learns from step to step.
        count: is told of each step.
        loop: the algebraic loop spelled out where they are in one.
    """

    def __init__(
        self, ensemble: Ensemble, interface: Interface, solver: InterfaceSolver, count: IterationCount, loop: str = ""
    ) -> None:
        self.solver = solver
        self._ensemble = ensemble
        self._interface = interface
        self._count = count
        self._loop = loop

    def step(self, t: float, slots: Sequence[Slot]) -> None:
        """Step the units, in the order given.

        Raises:
            UnitFailure: a unit's call failed. NotConverged: they do not agree.
        """
        with self._ensemble.saved([s.unit for s in slots]) as states:
            self._iterate(t, slots, states)

    def _iterate(self, t: float, slots: Sequence[Slot], states: "dict[str, State]") -> None:
        spent = {s.unit: 0.0 for s in slots}
        rollbacks = -1

        def g(x: Floats) -> Floats:
            nonlocal rollbacks
            rollbacks += 1
            if rollbacks:
                self._ensemble.restore(states)
            for slot in slots:
                began = time.process_time()
                self._step_one(t, slot, x)
                spent[slot.unit] += time.process_time() - began
            return self._interface.read(t)

        try:
            solution = self.solver.solve(g, self._interface.read(t))
        except Unsolved as e:
            raise not_converged(list(spent), t, e, self._interface, self.solver.magnitudes, self._loop) from e
        if self._ensemble.measures_cpu:
            for unit, seconds in spent.items():
                self._ensemble.cpu[unit].append(seconds)
        self._count.add(solution.iterations, rollbacks)

    def _step_one(self, t: float, slot: Slot, x: Floats) -> None:
        self._ensemble.gather(slot.unit, t)
        self._interface.write(slot.unit, x)
        if self._ensemble.lines is not None:
            self._ensemble.lines.feed(slot.unit, t, slot.period, self._interface.parts(slot.unit, x))
        self._ensemble.instances[slot.unit].set_inputs()
        self._ensemble.step(slot.unit, t, slot.period)
        self._ensemble.publish(slot.unit)
