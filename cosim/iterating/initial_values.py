"""Works out the values of all signals at the start, algebraic loops included."""

from collections.abc import Sequence

from handover.cosim.blocks.ports import Floats
from handover.cosim.ensemble import Ensemble
from handover.cosim.iterating.chained_derivatives import ChainedDerivatives
from handover.cosim.iterating.group_stepping import MakeSolver
from handover.cosim.iterating.interface import Interface
from handover.cosim.iterating.interface_solver import Unsolved
from handover.cosim.iterating.not_converged import not_converged
from handover.cosim.system.loops import Group


class InitialValues:
    """Goes through units in initialisation mode, where inputs may be set and outputs fetched as often as one likes.

    Each unit gets the outputs of those before it; inputs whose source is not known yet keep their start values. The
    units of an algebraic loop are gone over until they agree, from the values that start values lead to; with
    directional derivatives where all of them give those.

    Args:
        ensemble: the units, to be in initialisation mode when this is called.
        groups: all units, those of loops together, in an order in which values can be worked out.
        passes: how often to go through them.
        make_solver: gives a loop its solver.
    """

    def __init__(self, ensemble: Ensemble, groups: Sequence[Group], passes: int, make_solver: MakeSolver) -> None:
        self._ensemble = ensemble
        self._groups = groups
        self._passes = passes
        self._make_solver = make_solver
        self._known: set[str] = set()

    def __call__(self) -> None:
        """Set inputs and get outputs.

        Raises:
            UnitFailure: a unit's call failed. NotConverged: a loop has no solution, or none was found.
        """
        for _ in range(self._passes):
            for group in self._groups:
                for unit in group.units:
                    self._ensemble.feed_known(unit, self._known)
                    self._ensemble.publish(unit)
                    self._known.add(unit)
                if group.circle:
                    self._solve(group)

    def _solve(self, group: Group) -> None:
        interface = Interface(self._ensemble, group.back(group.units))
        derivatives = ChainedDerivatives(self._ensemble, group, interface)

        def g(x: Floats) -> Floats:
            for unit in group.units:
                self._ensemble.gather(unit, 0.0)
                interface.write(unit, x)
                self._ensemble.set_known(unit, self._known)
                self._ensemble.publish(unit)
            return interface.read(0.0)

        def jacobian() -> Floats | None:
            return derivatives() if derivatives.are_given else None

        solver = self._make_solver(interface)
        try:
            solver.solve(g, interface.read(0.0), jacobian)
        except Unsolved as e:
            raise not_converged(group.units, 0.0, e, interface, solver.magnitudes, group.told) from e
