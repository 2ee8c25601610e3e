"""The master algorithm: checks a system of FMUs, loads it, and runs it from one communication point to the next."""

import array
import logging
from collections.abc import Callable, Sequence
from fractions import Fraction
from numbers import Rational
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from handover.cosim.check.run_faults import execution_tools, run_faults
from handover.cosim.exceptions import (
    InitializationError,
    InvalidFmu,
    ScheduleError,
    UnitFailure,
    WiringError,
    shown_path,
)
from handover.cosim.fmu.calls import is_rounding
from handover.cosim.fmu.failures import UnitCrashed, UnitHung, UnitTerminated
from handover.cosim.fmu.file.archive import DESCRIPTION
from handover.cosim.fmu.file.default_experiment import exact_text
from handover.cosim.fmu.heartbeat import Abandoned, Heartbeat
from handover.cosim.fmu.host_process import mark_as_host
from handover.cosim.fmu.unit_warnings import UnitWarnings
from handover.cosim.master.pacing import Pacer
from handover.cosim.master.stepper_factory import StepperFactory
from handover.cosim.master.unit_options import unasked_isolations
from handover.cosim.master.watchdog import Watchdog
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.adaptive_stepper import AdaptiveStepper, StepStatistics
from handover.cosim.stepping.ensemble import CleanupStack, Ensemble
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.stepping.stepper import Coupling, Stepper
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.signals import ObserveAfter, Observer, Signals
from handover.cosim.system.system import System

T = TypeVar("T")

_log = logging.getLogger(__name__)

_PLAIN = MasterOptions()


def never() -> bool:
    """Let a run continue to its stop time."""
    return False


def _recorders(observers: Sequence[Observer]) -> Sequence[Observer]:
    """Return the first of the observers if it records, also from a time on; else none."""
    first = observers[0] if observers else None
    records = isinstance(first.observe if isinstance(first, ObserveAfter) else first, Recorder)
    return observers[: int(records)]


def _tell_of_faults(system: System, *, strict: bool) -> dict[Path, str]:
    """Warn of invalid descriptions, of what is tolerated, of start values that are NaN, and of what the system notes.

    Returns:
        How model descriptions break the standard, by FMU.

    Raises:
        InvalidFmu, WiringError: `strict` does not let them pass.
    """
    untouched, others = system.untouched_faults, run_faults(u.description for u in system.units.values())
    faults = {p: "; ".join(f[p] for f in (untouched, others) if p in f) for p in (*untouched, *others)}
    if strict:
        for path, fault in faults.items():
            raise InvalidFmu(path, f"its {DESCRIPTION} is not valid: {fault}")
        if system.tolerated:
            raise WiringError(system.tolerated)
    for path, fault in untouched.items():
        _log.warning("%s: its %s is not valid, which does not matter here: %s", shown_path(path), DESCRIPTION, fault)
    for path, fault in others.items():
        _log.warning("%s: its %s is not valid: %s", shown_path(path), DESCRIPTION, fault)
    for line in system.remarks:
        _log.warning("%s", line)
    return faults


_MOST_STEPS = 10**12
"""Steps of the fastest unit: at the fastest they take half a day, and their record has several terabytes."""


def _check_exact(stop: Fraction) -> None:
    if not isinstance(stop, Rational):  # type: ignore
        raise TypeError(f"stop = {stop!r} is not exact; give {exact_text(stop)}")


def _check_steps(schedule: Schedule, stop: Fraction) -> None:
    step = min((slot.every for slot in schedule.slots), default=1) * schedule.tick
    if (stop - schedule.start) / step > _MOST_STEPS:
        many = f"more than {_MOST_STEPS:g} steps of {float(step):g} s"
        raise ScheduleError(f"until the stop time {float(stop):g} s there are {many}, too many to do")


def _parts(system: System) -> list[tuple[object, object]]:
    """Return all that a system is made of, in order: of each part a key, and an object by identity."""
    named = (*system.units.items(), *system.followed.items(), *system.externals.items())
    return [(system.start, None), *((None, c) for c in system.connections), *named]


class Master:
    """Co-simulates a system of FMUs, each unit at its own rate. Use as a context manager.

    Entering loads and initialises the units; `run` steps them; leaving terminates and frees them, whatever happened.
    If that fails where nothing else did, leaving raises the failure, after all units are freed.

    Args:
        system, options: what is run, and how.
        heartbeat: notes the calls of units; by default one of its own.
        stop: when the run ends, s, exactly, at the first communication point at or after it: each unit is given the end
            of its last step as its stop time, beyond which it need not step. Without, units have no stop time.

    Raises:
        TypeError: the stop time is not exact.
        WiringError: the system has faults.
        InvalidFmu: an FMU is invalid, see `MasterOptions.strict`.
        ScheduleError: see `StepperFactory`; or there are more steps until the stop time than can be done.
        InitializationError: a unit did not accept its parameters or did not initialise.
        UnitHung: one did not return; UnitCrashed: an isolated one ended its process.
    """

    def __init__(
        self, system: System, options: MasterOptions = _PLAIN, heartbeat: Heartbeat | None = None,
        stop: Fraction | None = None,
    ) -> None:  # fmt: skip
        system.check()
        self.description_faults = _tell_of_faults(system, strict=options.strict)
        """How model descriptions break the standard, by FMU."""
        self.execution_tools = execution_tools({name: u.description for name, u in system.units.items()})
        """Units that need other software on the machine, a line each."""
        self.isolations = unasked_isolations(system, options.isolated)
        """Which units are isolated though nobody asked for it, and why, in lines."""
        for line in (*self.execution_tools, *self.isolations):
            _log.warning("%s", line)
        self.system = system
        self.options = options
        self.stop = stop
        self._parts = _parts(system)
        self._factory = StepperFactory(system, options)
        self.schedule = self._factory.schedule
        if stop is not None:
            _check_exact(stop)
            _check_steps(self.schedule, stop)
        self.tolerances = self._factory.tolerances
        """By unit, the relative tolerance that it is given for its own solver; others choose theirs."""
        self.heartbeat = heartbeat or Heartbeat()
        self.pacer = Pacer(options.pace) if options.pace is not None else None
        """Keeps the run in step with the wall clock; None where it runs as fast as it can."""
        self._watchdog = Watchdog(self.heartbeat, options.call_limit)
        self._cleanups = CleanupStack()
        self.ended: UnitTerminated | None = None
        """The request of a unit with which the run has ended, None until then."""
        self._ensemble: Ensemble | None = None
        self._stepper: Stepper | None = None
        self._coupling: Coupling | None = None
        self._is_left = False

    def __enter__(self) -> "Master":
        if self._ensemble is not None and not self._is_left:
            raise RuntimeError("the master is entered already: leave it first, or make another one")
        now = _parts(self.system)
        if len(now) != len(self._parts) or any(
            a != b or x is not y for (a, x), (b, y) in zip(now, self._parts, strict=True)
        ):
            raise RuntimeError(
                "the system was changed after this master checked it: make the master once it is complete"
            )
        self._is_left = False
        self.ended = None
        mark_as_host()
        try:
            self._watchdog.run_job(self._start)
        except (UnitCrashed, UnitHung):
            self._end()
            raise
        except UnitFailure as e:
            self._end()
            raise InitializationError(e) from e
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        failure = self._end()
        if failure is not None and error is None:
            raise failure

    @property
    def has_events(self) -> bool:
        """Whether steps may end off the schedule's grid; without, a run is a plain sequence of fixed steps."""
        return self._factory.has_events

    @property
    def ensemble(self) -> Ensemble:
        """The loaded units; there are none before the master is entered."""
        if self._ensemble is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._ensemble

    @property
    def stepper(self) -> Stepper:
        """What advances the units through time; there is none before the master is entered."""
        if self._stepper is None:
            raise RuntimeError("enter the master first: `with Master(system) as master:`")
        return self._stepper

    @property
    def iterations(self) -> IterationCount:
        """Counts of iterated steps, their iterations and rollbacks."""
        return IterationCount() if self._coupling is None else self._coupling.count

    @property
    def iterates(self) -> bool:
        """Whether units repeat steps after a rollback; the steps of others are plain."""
        return self._factory.iterates

    @property
    def steps(self) -> StepStatistics | None:
        """Counts of adaptive steps; None where steps are fixed."""
        return self._stepper.statistics if isinstance(self._stepper, AdaptiveStepper) else None

    @property
    def time(self) -> float:
        """Simulated time in seconds."""
        if self.ended is not None:
            return self.ended.reached
        return float(self.schedule.start) if self._stepper is None else self._stepper.time

    @property
    def cpu(self) -> "dict[str, array.array[float]]":
        """CPU seconds of every step, by unit, if the options ask for it.

        With Gauss-Seidel, setting inputs and getting outputs are included. Of an isolated unit, it is the time of its
        own process, where setting and getting belong to the step, and of this one, which waits for it.
        """
        if isinstance(self._stepper, PlanStepper):
            self._stepper.publish_cpu_times()
        return self.ensemble.cpu

    @property
    def warnings(self) -> dict[str, UnitWarnings]:
        """The calls that answered Warning until now, by unit, of those that have any."""
        if self._ensemble is None:
            return {}
        if isinstance(self._stepper, PlanStepper):
            self._stepper.publish_warnings()
        found = {name: instance.warnings for name, instance in self._ensemble.instances.items()}
        return {name: warnings for name, warnings in found.items() if warnings}

    @property
    def signals(self) -> Signals:
        """The units' outputs as they are."""
        return self.ensemble.signals()

    def run(self, stop: Fraction, observers: Sequence[Observer] = (), until: Callable[[], bool] = never) -> None:
        """Step until `stop` seconds, or until `until()` says so after the observers have seen a communication point.

        Gauss-Seidel: at a communication point t, sampled units act on the values at t, then the observers see all
        signals at t, then the other units step from t. Jacobi: a step's results count from the time where it ends, for
        sampled units too. A second call continues where the first one ended.

        A unit may ask to end the simulation: then the run ends regularly, `ended` is its request, and observers see the
        signals once more, at the time that it has reached. If it has completed its step, so do the others that step at
        the same time: these are the signals of a communication point, but for units with other periods, which are where
        their own steps ended. If it ends within a step (FMI 2: a Discard with a time before the step's end), or while
        units iterate, the signals at that time are its own. Those of others are what they gave last: by Gauss-Seidel,
        units before it in the order are at the end of the step, all others at its begin. A unit that gives no outputs,
        or none that are finite, adds nothing to what was seen.

        With `MasterOptions.call_limit`, units and observers are called in a thread of the master's own.

        Raises:
            UnitFailure: a unit's call failed; what observers saw before stays.
            TypeError: `stop` is not exact, so that a step more or less would be made.
            ValueError: `stop` lies before the time that is reached, or after the stop time that units were given.
            RuntimeError: the master is left, a unit failed before, or one has ended the simulation.
        """
        self._check_can_run(stop)
        try:
            self.call_units(lambda: self._run(stop, observers, until))
            _log.info("units are stepped to t = %.9g s", self.time)
        finally:
            self.ensemble.host.restore(handlers_set_here=False)

    def call_units(self, job: Callable[[], T]) -> T:
        """Run another job with the units in the thread that they are called in, with the same time limit.

        Raises:
            RuntimeError: the units are freed.
            UnitHung: a unit does not return. Whatever else the job raises.
        """
        self._check_is_entered()
        mark_as_host()
        return self._watchdog.run_job(job)

    def _start(self) -> None:
        ensemble = self._factory.load(self.heartbeat, self._cleanups)
        self._factory.initialize(ensemble, self.stop)
        ensemble.host.restore()
        self._coupling = self._factory.couple(ensemble)
        self._stepper = self._factory.stepper(ensemble, self._coupling)
        self._ensemble = ensemble
        _log.info("%d units are initialised at t = %.9g s", len(ensemble.instances), self.time)

    def _end(self) -> UnitFailure | None:
        """Terminate and free all units but those that do not return; return the first failure of that."""
        self._is_left = True
        _log.debug("units are terminated and freed")
        if isinstance(self._stepper, PlanStepper):
            self._stepper.publish_unit_times()  # failures state the time that the unit has reached
        if self._ensemble is not None:
            self._ensemble.host.note()
        first: UnitFailure | None = None
        while True:
            try:
                self._watchdog.run_job(self._cleanups.close)
            except UnitFailure as e:
                first = first or e
                if isinstance(e, UnitHung):
                    continue  # with what is left of the cleanups
            break
        self._watchdog.close()
        return first

    def _check_is_entered(self) -> None:
        if self._is_left:
            raise RuntimeError("the units are freed: call them inside of the `with` block that holds them")

    def _check_can_run(self, stop: Fraction) -> None:
        _check_exact(stop)
        self._check_is_entered()
        if self.ended is not None:
            raise RuntimeError(f"{self.ended.summary}: make another master to simulate again")
        for name, instance in self.ensemble.instances.items():
            if instance.failed or instance.lost:
                raise RuntimeError(f"{name} failed, and the standards forbid further calls of it: make another master")
        if self.schedule.time(self.schedule.ticks(stop)) < self.time:
            raise ValueError(f"a run to {float(stop):g} s, but {self.time:g} s are reached: a later stop is valid")
        if self.stop is not None and stop > self.stop:
            given = f"units were given the stop time {float(self.stop):g} s"
            raise ValueError(f"a run to {float(stop):g} s, but {given}: make the master with this stop, or with none")

    def _run(self, stop: Fraction, observers: Sequence[Observer], until: Callable[[], bool]) -> None:
        signals = self.signals
        self.ensemble.host.note()
        if self.pacer is not None:
            self.pacer.start(self.time)
        last, arriving = self.schedule.ticks(stop), True
        wait = None if self.pacer is None else self._waiting(until)
        if self.ensemble.external_inputs:  # these wait before they ask
            self.ensemble.external_inputs.wait, wait = wait, None
        if len(observers) > 1:  # a recorder alone does not bring the plan back to Python at each point
            observers = [*observers, lambda _t, _signals: self.ensemble.host.restore_if_due()]
        try:
            if isinstance(self.stepper, PlanStepper):
                pause = None if self.pacer is None else self._pause(until)
                self.stepper.run(last, signals, observers, None if until is never else until, pause)
                return
            while True:
                arriving = True
                ended = self.stepper.arrive(last)
                if self.heartbeat.stopped:
                    raise Abandoned
                self.ensemble.host.restore_arithmetic()
                recorders = _recorders(observers)
                for observe in recorders:  # before the wait, as of a plan: who watches a record sees it at once
                    observe(self.stepper.time, signals)
                if wait is not None:
                    wait(self.stepper.time)
                for observe in observers[len(recorders) :]:
                    observe(self.stepper.time, signals)
                if ended or until():
                    break
                arriving = False
                self.stepper.depart()
        except UnitTerminated as e:
            at_point = self.stepper.arriving if isinstance(self.stepper, PlanStepper) else arriving
            self._end_with(e, observers, at_point=at_point)
        finally:
            self.ensemble.host.restore_limits()  # what follows writes files

    def _end_with(self, request: UnitTerminated, observers: Sequence[Observer], *, at_point: bool) -> None:
        """End the run with a unit's request, made before observers saw the communication point or in a step from it."""
        instances, begin, reached = self.ensemble.instances, self.stepper.time, request.reached
        request.reached = begin if at_point else self._on_grid(reached)
        self.ended = request
        if not at_point and reached <= begin:
            return  # observers have seen where it ended
        arrived = () if at_point else [n for n, i in instances.items() if is_rounding(i.time - reached, reached)]
        try:
            for name in dict.fromkeys((request.unit, *arrived)):
                self.ensemble.publish(name)
        except UnitFailure as e:
            _log.warning("%s, but its last signals are left out: %s", request.summary, e.cause)
            return
        for observe in observers:
            observe(request.reached, self.signals)

    def _on_grid(self, t: float) -> float:
        """Return the exact time of a tick where t is one but for rounding."""
        exact = self.schedule.time(round((Fraction(t) - self.schedule.start) / self.schedule.tick))
        return exact if is_rounding(t - exact, exact) else t

    def _waiting(self, until: Callable[[], bool]) -> Callable[[float], None]:
        """Return a function that waits until the wall clock has reached a simulated time, s."""

        def wait(t: float) -> None:
            if self.pacer is not None:
                self.pacer.wait(t, lambda: self.heartbeat.stopped or until())

        return wait

    def _pause(self, until: Callable[[], bool]) -> Callable[[], None]:
        """Return a function that waits until the wall clock has reached the simulated time that the run has reached."""
        wait = self._waiting(until)

        def pause() -> None:
            wait(self.time)

        return pause
