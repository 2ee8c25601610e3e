"""Computes consistent values of all signals at the start; algebraic loops are solved, with derivatives if possible."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Kind
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.interface import Interface
from handover.cosim.stepping.iteration import not_converged
from handover.cosim.stepping.solvers import MakeSolver, Unsolved
from handover.cosim.system.loops import Group
from handover.cosim.system.system import Connection


class ChainedDerivatives:
    """dg/dx, where x are the inputs that lead back in a cycle, and g(x) their sources after all units are evaluated.

    By the chain rule, a direction passes the cycle as values do: each unit by its directional derivative, each
    connection by the factor of its conversion. It holds at an instant, with the units' states as they are. How outputs
    at the end of a step depend on inputs that are held over it is another derivative, which FMI does not give.
    """

    def __init__(self, ensemble: Ensemble, group: Group, interface: Interface) -> None:
        self._ensemble = ensemble
        self._units = group.units
        self._interface = interface
        back = set(group.back(group.units))
        self._forward: dict[str, list[Connection]] = {name: [] for name in group.units}
        self._outputs: dict[str, list[str]] = {name: [] for name in group.units}
        real = [c for c in group.cycle if self._kind(c) is Kind.REAL]
        for c in real:
            if c not in back:
                self._forward[c.target.unit].append(c)
            if c.source.port not in self._outputs[c.source.unit]:
                self._outputs[c.source.unit].append(c.source.port)
        self._back = [c for c in real if c in back]
        self._factor = {c: change.factor if (change := ensemble.system.transformation_of(c)) else 1.0 for c in real}

    @property
    def are_given(self) -> bool:
        """Whether all units declare that they give directional derivatives."""
        units = self._ensemble.system.units
        return all(units[name].description.capabilities.directional_derivatives for name in self._units)

    def __call__(self) -> Floats:
        """Return dg/dx at the values that the units have.

        Raises:
            UnitFailure: a unit does not give its derivatives.
        """
        n = len(self._interface)
        return np.stack([self._column(row) for row in np.eye(n)], axis=1)

    def _column(self, dx: Floats) -> Floats:
        dy: dict[str, dict[str, Floats]] = {}
        for name in self._units:
            du = self._interface.parts(name, dx)
            for c in self._forward[name]:
                du[c.target.port] = self._factor[c] * dy[c.source.unit][c.source.port]
            dy[name] = self._through(name, du)
        ends: Sequence[Floats] = [self._factor[c] * dy[c.source.unit][c.source.port] for c in self._back]
        return np.concatenate(ends)

    def _through(self, unit: str, du: dict[str, Floats]) -> dict[str, Floats]:
        moving = {port: d for port, d in du.items() if np.any(d)}
        outputs = self._outputs[unit]
        if not moving:
            ports = self._ensemble.system.units[unit].description.outputs
            return {y: np.zeros(ports[y].size) for y in outputs}
        return self._ensemble.instances[unit].directional_derivative(outputs, moving)

    def _kind(self, c: Connection) -> Kind:
        return self._ensemble.system.units[c.source.unit].description.outputs[c.source.port].kind


class InitialValues:
    """Evaluates units in initialisation mode, where inputs may be set and outputs fetched as often as one likes.

    Each unit gets the outputs of those before it; inputs whose source is not known yet keep their start values. The
    units of an algebraic loop are evaluated until their values converge, from those that the start values lead to;
    with directional derivatives where all of them give those.

    Args:
        ensemble: the units, to be in initialisation mode when this is called.
        groups: all units, those of a loop together, in the order of evaluation.
        passes: how often to go through the groups.
        make_solver: makes a solver for each loop.
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
                if group.cycle:
                    self._solve(group)

    def _solve(self, group: Group) -> None:
        start = float(self._ensemble.system.start)
        interface = Interface(self._ensemble, group.back(group.units))
        derivatives = ChainedDerivatives(self._ensemble, group, interface)

        def g(x: Floats) -> Floats:
            for unit in group.units:
                self._ensemble.gather(unit, start)
                interface.write(unit, x)
                self._ensemble.set_known(unit, self._known)
                self._ensemble.publish(unit)
            return interface.read(start)

        def jacobian() -> Floats | None:
            return derivatives() if derivatives.are_given else None

        solver = self._make_solver(interface)
        try:
            solver.solve(g, interface.read(start), jacobian)
        except Unsolved as e:
            raise not_converged(group.units, start, e, interface, solver.magnitudes, group.message) from e
