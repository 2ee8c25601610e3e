"""Runs a system of FMUs: checks it, loads it, and takes it from one communication point to the next."""

import array
from collections.abc import Callable, Sequence
from fractions import Fraction
from types import TracebackType
from typing import TypeVar

from cosim.endings import Endings
from cosim.ensemble import Ensemble
from cosim.events.event_ensemble import EventEnsemble
from cosim.events.event_options import has_events, refuse_off_grid
from cosim.events.event_stepper import EventStepper
from cosim.exceptions import UnitFailure, UnitRefused
from cosim.failures import UnitHung
from cosim.group import Group, groups_of_data_flow
from cosim.heartbeat import Abandoned, Heartbeat
from cosim.iterating.fixed_point import FixedPoint
from cosim.iterating.initial_values import InitialValues
from cosim.iterating.interface import Interface
from cosim.iterating.interface_newton import InterfaceNewton
from cosim.iterating.interface_solver import InterfaceSolver
from cosim.iterating.iteration_count import IterationCount
from cosim.loop_refusal import refuse_circles, refuse_loops
from cosim.master_options import Algorithm, MasterOptions
from cosim.observer import Observer
from cosim.plan.choice import plan_stepper, tell_general_path
from cosim.plan.plan_stepper import PlanStepper
from cosim.schedule import Schedule
from cosim.signals import Signals
from cosim.stepping.adaptive_stepper import AdaptiveStepper, check_control, fine_tick
from cosim.stepping.coupling import Coupling
from cosim.stepping.extrapolation import Extrapolation
from cosim.stepping.gauss_seidel import GaussSeidel
from cosim.stepping.grid_stepper import GridStepper
from cosim.stepping.jacobi import Jacobi
from cosim.stepping.pacing import Pacer
from cosim.stepping.step_statistics import StepStatistics
from cosim.stepping.stepper import Stepper
from cosim.system import System
from cosim.watchdog import Watchdog

T = TypeVar("T")

_PLAIN = MasterOptions()


def never() -> bool:
    """Let a run go on to its stop time."""
    return False


class Master:
    """Co-simulates a system of FMUs, each unit at its own rate. Use as a context manager.

    Entering loads and initialises the units; `run` steps them; leaving terminates and frees them, whatever happened.

    Raises:
        WiringError: the system has faults. InvalidFmu: an FMU cannot be used. ScheduleError: see `Schedule`,
            `check_control` and `refuse_off_grid`, or units make circles that cannot be solved.
        UnitRefused: a unit did not accept its parameters or did not initialise.
    """

    def __init__(self, system: System, options: MasterOptions = _PLAIN, heartbeat: Heartbeat | None = None) -> None:
        system.check()
        self.system = system
        self.options = options
        self.schedule = Schedule(system)
        if options.adaptive is not None:
            check_control(system, options.adaptive)
        refuse_off_grid(system, options)
        self._continuous = self._groups()
        refuse_loops(system, self.schedule.loops, goes_back=options.algorithm is not Algorithm.JACOBI)
        self.heartbeat = heartbeat or Heartbeat()
        self.pacer = Pacer(options.pace) if options.pace is not None else None
        """What keeps the run in step with the wall clock, if it is to."""
        self._watchdog = Watchdog(self.heartbeat, options.call_limit)
        self._endings = Endings()
        self._ensemble: Ensemble | None = None
        self._stepper: Stepper | None = None
        self._coupling: Coupling | None = None

    def __enter__(self) -> "Master":
        try:
            self._watchdog.carry_out(self._start)
        except UnitHung:
            self._end()
            raise
        except UnitFailure as e:
            self._end()
            raise UnitRefused(e) from e
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        hung = self._end()
        if hung is not None and error is None:
            raise hung

    @property
    def has_events(self) -> bool:
        """Whether steps may end off the schedule's grid; without, a run is a plain sequence of fixed steps."""
        return has_events(self.system, self.options)

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
    def steps(self) -> StepStatistics | None:
        """What became of steps that follow their error; None where steps are fixed."""
        return self._stepper.statistics if isinstance(self._stepper, AdaptiveStepper) else None

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        return 0.0 if self._stepper is None else self._stepper.time

    @property
    def cpu(self) -> "dict[str, array.array[float]]":
        """CPU seconds of every step, by unit, if the options ask for it.

        With Gauss-Seidel, setting inputs and getting outputs are included.
        """
        if isinstance(self._stepper, PlanStepper):
            self._stepper.tell_cpu()
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

        With `MasterOptions.call_limit` everything, observers included, is called from a thread of the master's own.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
        """
        self.carry_out(lambda: self._run(stop, observers, until))

    def carry_out(self, job: Callable[[], T]) -> T:
        """Do something else with the units in the thread that they are called from, with the same time limit.

        Raises:
            UnitHung: a unit does not return. Besides, whatever the job raises.
        """
        return self._watchdog.carry_out(job)

    def _start(self) -> None:
        load = EventEnsemble if self.has_events else Ensemble
        ensemble = load(self.system, self.heartbeat, self._endings)
        ensemble.measures_cpu = self.options.cpu_times
        ensemble.initialize(self.schedule.slots, self._initial_values(ensemble))
        self._coupling = self._couple(ensemble)
        self._stepper = self._stepper_of(ensemble, self._coupling)
        self._ensemble = ensemble

    def _end(self) -> UnitHung | None:
        """Terminate and free all units but those that do not return; return the first of these as a failure."""
        first: UnitHung | None = None
        while True:
            try:
                self._watchdog.carry_out(self._endings.carry_out)
            except UnitHung as e:
                first = first or e
            else:
                break
        self._watchdog.close()
        return first

    def _run(self, stop: Fraction, observers: Sequence[Observer], until: Callable[[], bool]) -> None:
        signals = self.signals
        if self.pacer is not None:
            self.pacer.start(self.time)
        last = self.schedule.ticks(stop)
        if isinstance(self.stepper, PlanStepper):
            pause = None if self.pacer is None else self._pause(until)
            self.stepper.run(last, signals, observers, None if until is never else until, pause)
            return
        while True:
            ended = self.stepper.arrive(last)
            if self.heartbeat.stopped:
                raise Abandoned
            if self.pacer is not None:
                self._pause(until)()
            for observe in observers:
                observe(self.stepper.time, signals)
            if ended or until():
                break
            self.stepper.depart()

    def _pause(self, until: Callable[[], bool]) -> Callable[[], None]:
        """Return what waits until the wall clock is where the simulated time is."""

        def pause() -> None:
            if self.pacer is not None:
                self.pacer.wait(self.time, lambda: self.heartbeat.stopped or until())

        return pause

    def _stepper_of(self, ensemble: Ensemble, coupling: Coupling) -> Stepper:
        if isinstance(ensemble, EventEnsemble) or self.options.adaptive is not None:
            tell_general_path("steps may end anywhere")
        if isinstance(ensemble, EventEnsemble):
            return EventStepper(self.schedule, ensemble, coupling)
        control = self.options.adaptive
        if self.options.extrapolation is Extrapolation.LINEAR:
            ensemble.extrapolate(self.schedule.tick if control is None else fine_tick(self.schedule, control))
        if control is None:
            plan = plan_stepper(self.schedule, ensemble, coupling, self.options, iterates=self.iterates)
            return plan or GridStepper(self.schedule, coupling, ensemble.lines)
        return AdaptiveStepper(self.schedule, coupling, ensemble, control, self.options.order)

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
