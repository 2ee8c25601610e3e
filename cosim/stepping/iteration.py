"""One step of units that act on each other in a cycle, iterated until they converge, or the failure to do so."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import UnitFailure, counted
from handover.cosim.stepping.ensemble import Ensemble, SavedStates
from handover.cosim.stepping.interface import Interface, Magnitudes
from handover.cosim.stepping.solvers import InterfaceSolver, Unsolved
from handover.cosim.system.schedule import Slot


@dataclass
class IterationCount:
    """Counts of a run so far, those of its initialisation not included.

    Attributes:
        steps: steps that were iterated; units that act on each other in a cycle make one together.
        iterations: how often all units of a cycle stepped to see whether they have converged.
        rollbacks: how often they rolled back to the beginning of a step, to iterate or to take differences.
        most: the maximum of iterations of a step.
    """

    steps: int = 0
    iterations: int = 0
    rollbacks: int = 0
    most: int = 0

    def add(self, iterations: int, rollbacks: int) -> None:
        """Count a step."""
        self.steps += 1
        self.iterations += iterations
        self.rollbacks += rollbacks
        self.most = max(self.most, iterations)

    def get_state(self) -> dict[str, int]:
        """Return the counts, for `set_state`."""
        return asdict(self)

    def set_state(self, state: Mapping[str, int]) -> None:
        """Restore the counts that `get_state` returned."""
        for name, count in state.items():
            setattr(self, name, count)

    def __str__(self) -> str:
        if not self.steps:
            return "no step was iterated"
        mean = self.iterations / self.steps
        return (
            f"{self.steps} steps were iterated: {mean:.3g} iterations a step, {self.most} at most, "
            f"{self.rollbacks} rollbacks"
        )


class NotConverged(UnitFailure):
    """The iteration of units that act on each other in a cycle did not converge at a time.

    Attributes:
        units: their names.
        loop: the algebraic loop spelled out where it is one, or an empty text.
        why: the reason that the solver gives.
        iterations: how many it made.
        moving: the signals that have not converged, the worst first, each with its distance from its source's value.
    """

    kind: ClassVar[str] = "not_converged"
    verdict: ClassVar[str] = "coupled units did not converge"

    def __init__(
        self,
        units: Sequence[str],
        t: float,
        why: str,
        iterations: int,
        moving: Sequence[tuple[str, float]],
        loop: str = "",
    ) -> None:
        self.units, self.why, self.iterations, self.moving, self.loop = tuple(units), why, iterations, moving, loop
        lines = [f"algebraic loop: {loop}"] if loop else []
        lines += [f"{name} still moves by {by:.3g}" for name, by in moving]
        super().__init__(", ".join(units), "iterating", t, f"no solution: {why}", lines)

    @property
    def what(self) -> str:
        """What happened, to be read after the call."""
        count = counted(self.iterations, "iteration")
        return f"found no solution in {count}: {self.why}"

    @property
    def message(self) -> str:
        """What happened, the signal that moves most, and the loop."""
        fastest_moving = [f"{name} still moves by {by:.3g}" for name, by in self.moving[:1]]
        return "; ".join([self.what, *fastest_moving, *([f"algebraic loop: {self.loop}"] if self.loop else [])])

    def as_data(self) -> dict[str, Any]:
        """Return the failure as JSON can hold it."""
        return {**super().as_data(), "iterations": self.iterations, "moving": dict(self.moving)}


def not_converged(
    units: Sequence[str], t: float, e: Unsolved, interface: Interface, magnitudes: Magnitudes, loop: str = ""
) -> NotConverged:
    """Return the failure of a solver, with the signals by name."""
    still, shares = magnitudes.moving(e.x, e.residual), magnitudes.shares(e.x, e.residual)
    order: list[int] = np.argsort(-shares).tolist()
    moving = [(interface.names[i], float(e.residual[i])) for i in order if still[i]]
    return NotConverged(units, t, e.why, e.iterations, moving, loop)


class IteratedStep:
    """Steps units one after another until the inputs that lead back equal their sources at the end of the step.

    Each steps from t with its inputs held at the values of the end of the step, or where inputs are extrapolated, with
    inputs on the line from the values at t to those. States are saved before and restored for each further iteration:
    FMI knows no other way to the outputs for other inputs, as after a step outputs may not be fetched again once inputs
    are set. Inputs that lead back but are not real keep the values at t.

    Args:
        ensemble: the units.
        interface: the inputs that lead back.
        solver: finds their values; it keeps its state from step to step.
        count: counts the steps.
        loop: the algebraic loop spelled out, if they are in one.
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
            UnitFailure: a unit's call failed. NotConverged: they do not converge.
        """
        with self._ensemble.saved([s.unit for s in slots]) as states:
            self._iterate(t, slots, states)

    def _iterate(self, t: float, slots: Sequence[Slot], states: SavedStates) -> None:
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
                own = self._ensemble.instances[slot.unit].take_cpu()
                spent[slot.unit] += time.process_time() - began + own
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
        if self._ensemble.extrapolation is not None:
            self._ensemble.extrapolation.feed(slot.unit, t, slot.period, self._interface.parts(slot.unit, x))
        self._ensemble.instances[slot.unit].set_inputs()
        self._ensemble.step(slot.unit, t, slot.period)
        self._ensemble.publish(slot.unit)
