"""Units step one after another, each from the newest values."""

from collections.abc import Mapping, Sequence
from typing import Any

from handover.cosim.ensemble import Ensemble
from handover.cosim.iterating.group_stepping import GroupStepping, MakeSolver
from handover.cosim.iterating.iteration_count import IterationCount
from handover.cosim.system.loops import Group
from handover.cosim.system.schedule import Slot


class GaussSeidel:
    """At t, sampled units act on the values at t, then observers see all signals, then the others go on from t.

    Units of a group with a circle are gone over again until they agree, see `IteratedStep`. With groups that hold the
    algebraic loops only, this solves those and is Gauss-Seidel for the rest; with groups of all units whose data flow
    in a circle, it is the iterated (strong, implicit) coupling.

    Source: C. Gomes et al., Co-simulation: a survey, ACM Comput. Surv. 51 (2018) 49; the iterated coupling R. Kuebler,
    W. Schiehlen, Two methods of simulator coupling, Math. Comput. Model. Dyn. Syst. 6 (2000) 93-113.

    Args:
        ensemble: the units.
        sampled, continuous: groups of all units, each in the order in which they step.
        make_solver: gives a circle its solver.
    """

    def __init__(
        self, ensemble: Ensemble, sampled: Sequence[Group], continuous: Sequence[Group], make_solver: MakeSolver
    ) -> None:
        self.count = IterationCount()
        self._sampled = GroupStepping(ensemble, sampled, make_solver, self.count)
        self._continuous = GroupStepping(ensemble, continuous, make_solver, self.count)

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Let sampled units turn the values at t into further values at t."""
        self._sampled.step(t, sampled)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Step the others; what they give counts for those that follow."""
        self._continuous.step(t, continuous)

    def get_state(self) -> Mapping[str, Any]:
        """Return what was learnt and counted, nothing where no unit iterates; see `Coupling`."""
        if not self.count.steps:
            return {}
        sampled, continuous = self._sampled.get_state(), self._continuous.get_state()
        return {"sampled": sampled, "continuous": continuous, "count": self.count.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go back to what `get_state` gave."""
        self._sampled.set_state(state.get("sampled", []))
        self._continuous.set_state(state.get("continuous", []))
        self.count.set_state(state.get("count", IterationCount().get_state()))
