"""Runs a system of FMUs: checks it, loads it, and takes it from one communication point to the next."""

import array
from collections.abc import Callable, Sequence
from fractions import Fraction
from types import TracebackType

from cosim.coupling import Coupling
from cosim.ensemble import Ensemble
from cosim.exceptions import UnitFailure, UnitRefused
from cosim.fixed_point import FixedPoint
from cosim.gauss_seidel import GaussSeidel
from cosim.grid_stepper import GridStepper
from cosim.group import Group, groups_of_data_flow
from cosim.initial_values import InitialValues
from cosim.interface import Interface
from cosim.interface_newton import InterfaceNewton
from cosim.interface_solver import InterfaceSolver
from cosim.iteration_count import IterationCount
from cosim.jacobi import Jacobi
from cosim.loop_refusal import refuse_circles, refuse_loops
from cosim.master_options import Algorithm, MasterOptions
from cosim.schedule import Schedule
from cosim.signals import Signals
from cosim.stepper import Stepper
from cosim.system import System

_PLAIN = MasterOptions()

Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time and the signals that hold at that time."""


def never() -> bool:
    """Let a run go on to its stop time."""
    return False


class Master:
    """Co-simulates a system of FMUs, each unit at its own rate. Use as a context manager.

    Entering loads and initialises the units; `run` steps them; leaving terminates and frees them, whatever happened.

    Raises:
        WiringError: the system has faults. InvalidFmu: an FMU cannot be used. ScheduleError: see `Schedule`, or units
            make circles that cannot be solved.
        UnitRefused: a unit did not accept its parameters or did not initialise.
    """

    def __init__(self, system: System, options: MasterOptions = _PLAIN) -> None:
        system.check()
        self.system = system
        self.options = options
        self.schedule = Schedule(system)
        self._continuous = self._groups()
        refuse_loops(system, self.schedule.loops, goes_back=options.algorithm is not Algorithm.JACOBI)
        self._ensemble: Ensemble | None = None
        self._stepper: Stepper | None = None
        self._coupling: Coupling | None = None

    def __enter__(self) -> "Master":
        ensemble = Ensemble(self.system)
        try:
            ensemble.initialize(self.schedule.slots, self._initial_values(ensemble))
            self._coupling = self._couple(ensemble)
            self._stepper = GridStepper(self.schedule, self._coupling)
        except UnitFailure as e:
            ensemble.close()
            raise UnitRefused(e) from e
        except BaseException:
            ensemble.close()
            raise
        self._ensemble = ensemble
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.ensemble.close()

    @property
    def ensemble(self) -> Ensemble:
        """The loaded units; there are none before the master is entered."""
        if self._ensemble is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._ensemble

    @property
    def stepper(self) -> Stepper:
        """What moves the units through time; there is none before the master is entered."""
        if self._stepper is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._stepper

    @property
    def iterations(self) -> IterationCount:
        """How much work iterating was."""
        return self._coupling.count if isinstance(self._coupling, GaussSeidel) else IterationCount()

    @property
    def iterates(self) -> bool:
        """Whether units go over steps again; the steps of others are plain."""
        going_back = self.options.algorithm is not Algorithm.JACOBI
        return going_back and any(g.circle for g in (*self.schedule.sampled_groups, *self._continuous))

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        return 0.0 if self._stepper is None else self._stepper.time

    @property
    def cpu(self) -> "dict[str, array.array[float]]":
        """CPU seconds of every step, by unit; with Gauss-Seidel, setting inputs and getting outputs included."""
        return self.ensemble.cpu

    @property
    def signals(self) -> Signals:
        """The units' outputs as they are."""
        return self.ensemble.signals()

    def run(self, stop: Fraction, observers: Sequence[Observer] = (), until: Callable[[], bool] = never) -> None:
        """Step until `stop` seconds, or until `until()` says so after the observers have seen a communication point.

        Gauss-Seidel: at a communication point t, sampled units act on the values at t, then the observers see all
        signals at t, then the other units go on from t. Jacobi: a step's results count from the time where it ends, for
        sampled units too. A second call goes on where the first one ended.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
        """
        signals = self.signals
        last = self.schedule.ticks(stop)
        while True:
            ended = self.stepper.arrive(last)
            for observe in observers:
                observe(self.stepper.time, signals)
            if ended or until():
                break
            self.stepper.depart()

    def _groups(self) -> Sequence[Group]:
        """Return the units that are not sampled, those together that have to agree at each step."""
        if not self.options.algorithm.iterates:
            return self.schedule.continuous_groups
        groups = groups_of_data_flow(self.system, [s.unit for s in self.schedule.continuous], self.schedule.loops)
        refuse_circles(self.system, groups)
        return groups

    def _initial_values(self, ensemble: Ensemble) -> InitialValues:
        return InitialValues(ensemble, self.schedule.groups, self.schedule.initial_passes, self._solver)

    def _couple(self, ensemble: Ensemble) -> Coupling:
        if self.options.algorithm is Algorithm.JACOBI:
            return Jacobi(ensemble)
        return GaussSeidel(ensemble, self.schedule.sampled_groups, self._continuous, self._solver)

    def _solver(self, interface: Interface) -> InterfaceSolver:
        kind = FixedPoint if self.options.algorithm is Algorithm.FIXED_POINT else InterfaceNewton
        return kind(interface.magnitudes(self.options.tolerance), self.options.most_iterations)
