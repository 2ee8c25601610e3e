"""Chooses how a system is stepped, by its options and its units: with which ensemble, coupling and stepper."""

import logging
from collections.abc import Iterable, Sequence
from fractions import Fraction

from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.master.unit_options import isolated_units, tolerances_of
from handover.cosim.plan.memory import loop
from handover.cosim.plan.plan_maker import PlanMaker
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.adaptive_stepper import AdaptiveStepper, check_control, fine_tick
from handover.cosim.stepping.ensemble import CleanupStack, Ensemble
from handover.cosim.stepping.event_ensemble import EventEnsemble
from handover.cosim.stepping.event_stepper import EventStepper, check_off_grid, has_events
from handover.cosim.stepping.initial_values import InitialValues
from handover.cosim.stepping.interface import Interface
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.stepping.solvers import InterfaceSolver
from handover.cosim.stepping.stepper import Coupling, GridStepper, Stepper
from handover.cosim.system.loops import Group, check_cycles, check_loops, groups_of_data_flow
from handover.cosim.system.port_names import PortName
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System

_log = logging.getLogger(__name__)

_MAX_TICKS = 2**63
"""Numbers of a time grid must be below this for a plan: its loop has 64 bits for them."""


class StepperFactory:
    """Makes what steps a system; options that do not fit it are rejected before anything is loaded.

    Attributes:
        schedule: the grid and the order of the units.
        tolerances: by unit, the relative tolerance that it is given, if any.

    Raises:
        InvalidOptions: see `isolated_units` and `tolerances_of`.
        ScheduleError: see `Schedule`, `check_control` and `check_off_grid`, or there are cycles that cannot be solved.
    """

    def __init__(self, system: System, options: MasterOptions) -> None:
        self._system, self._options = system, options
        self._isolated = isolated_units(system, options.isolated)
        self.tolerances = tolerances_of(system, options.unit_tolerances)
        self.schedule = Schedule(system)
        if options.adaptive is not None:
            check_control(system, options.adaptive)
        check_off_grid(system, options)
        self._continuous = self._groups()
        check_loops(system, self.schedule.declared_loops)

    @property
    def has_events(self) -> bool:
        """Whether steps may end off the schedule's grid."""
        return has_events(self._system, self._options)

    @property
    def iterates(self) -> bool:
        """Whether units repeat steps after a rollback."""
        return any(g.cycle for g in (*self.schedule.sampled_groups, *self._continuous))

    @property
    def plan_obstacle(self) -> str | None:
        """Why the system cannot run as a compiled plan; None if it can.

        What the plan does not support has to be an obstacle here: the two paths give the same bytes.
        """
        system, options, schedule = self._system, self._options, self.schedule
        if not options.compiled:
            return "the options ask for none"
        if options.adaptive is not None or self.has_events:
            return "steps may end anywhere"
        if not options.algorithm.coupling.traits.in_plan:
            return f"the coupling is {options.algorithm.value}"
        if self.iterates:
            return "units make a loop"
        if options.extrapolation is not Extrapolation.HOLD:
            return "inputs are extrapolated"
        if system.followed:
            return f"inputs follow values over time: {_named(system.followed)}"
        if system.externals:
            return f"inputs come from outside: {_named(system.externals)}"
        if max(abs(number) for number in schedule.grid) >= _MAX_TICKS:
            return f"a tick of {schedule.tick} s is too long a fraction, from {schedule.start} s on"
        return None

    def load(self, heartbeat: Heartbeat, cleanups: CleanupStack) -> Ensemble:
        """Load the units; the caller closes `cleanups`, also if this fails."""
        load = EventEnsemble if self.has_events else Ensemble
        return load(self._system, heartbeat, cleanups, self._isolated)

    def initialize(self, ensemble: Ensemble, stop: Fraction | None) -> None:
        """Take the units through initialisation mode of a run until `stop`, s; algebraic loops are solved."""
        schedule = self.schedule
        ensemble.external_inputs.ask(float(schedule.start))
        values = InitialValues(ensemble, schedule.initial_groups, schedule.initial_passes, self._solver)
        stops = {} if stop is None else {s.unit: schedule.end_of_steps(s, stop) for s in schedule.slots}
        ensemble.initialize(schedule.slots, values, stops, self.tolerances)

    def couple(self, ensemble: Ensemble) -> Coupling:
        """Return the coupling of the algorithm."""
        groups = self.schedule.sampled_groups, self._continuous
        interpolates = self._options.extrapolation is Extrapolation.LINEAR  # up to a value at a step's end
        steps_together = self._options.adaptive is not None
        late = () if interpolates or steps_together else self.schedule.spanning
        return self._options.algorithm.coupling(ensemble, *groups, self._solver, late)

    def stepper(self, ensemble: Ensemble, coupling: Coupling) -> Stepper:
        """Return a stepper for initialised units, which is a compiled plan where that does the same.

        Why it is none is logged.
        """
        control = self._options.adaptive
        if self._options.cpu_times:
            ensemble.measure_cpu()
        obstacle, parallel = self.plan_obstacle, coupling.traits.parallel
        if obstacle is None and (library := loop()) is not None:
            plan = PlanMaker(ensemble, self.schedule, library, parallel=parallel, clock=self._options.cpu_times)
            return PlanStepper(self.schedule, ensemble, coupling, plan)
        _log.info("no compiled plan: %s", obstacle or "its library is not compiled for this machine")
        if isinstance(ensemble, EventEnsemble):
            return EventStepper(self.schedule, ensemble, coupling)
        if self._options.extrapolation is Extrapolation.LINEAR:
            ensemble.extrapolate(self.schedule.tick if control is None else fine_tick(self.schedule, control))
        if control is not None:
            return AdaptiveStepper(self.schedule, coupling, ensemble, control, self._options.order)
        return GridStepper(self.schedule, coupling, ensemble)

    def _groups(self) -> Sequence[Group]:
        """Return the units that are not sampled, in groups that iterate together at each step."""
        if not self._options.algorithm.iterates:
            return self.schedule.continuous_groups
        groups = groups_of_data_flow(self._system, [s.unit for s in self.schedule.continuous], self.schedule.loops)
        check_cycles(self._system, groups, [a.value for a in Algorithm if not a.iterates])
        return groups

    def _solver(self, interface: Interface) -> InterfaceSolver:
        solver = self._options.algorithm.coupling.traits.solver
        return solver(interface.magnitudes(self._options.tolerance), self._options.max_iterations)


def _named(ends: Iterable[PortName]) -> str:
    return ", ".join(str(end) for end in ends)
