"""Says whether a system can run as a compiled plan, makes the stepper that runs it, and logs why there is none.

What the plan does not support has to be an obstacle here: the two paths give the same bytes.
"""

import logging
from collections.abc import Iterable

from handover.cosim.plan.memory import loop
from handover.cosim.plan.plan_maker import PlanMaker
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.event_stepper import has_events
from handover.cosim.stepping.options import Extrapolation, MasterOptions
from handover.cosim.stepping.stepper import Coupling
from handover.cosim.system.port_names import PortName
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System

_log = logging.getLogger(__name__)

_MAX_TICKS = 2**63
"""Numbers of a time grid must be below this: the loop has 64 bits for them."""


def plan_stepper(
    schedule: Schedule, ensemble: Ensemble, coupling: Coupling, options: MasterOptions
) -> PlanStepper | None:
    """Return a stepper that runs a system without obstacle as a plan; None, with a line in the log, without the loop.

    `coupling` does the same on the general path.
    """
    library = loop()
    if library is None:
        log_fallback("its library is not compiled for this machine")
        return None
    parallel = coupling.traits.parallel
    plan = PlanMaker(ensemble, schedule, library, parallel=parallel, clock=options.cpu_times)
    return PlanStepper(schedule, ensemble, coupling, plan)


def log_fallback(reason: str) -> None:
    """Log why a system does not run as a plan."""
    _log.info("no compiled plan: %s", reason)


def plan_obstacle(schedule: Schedule, system: System, options: MasterOptions, *, iterates: bool) -> str | None:
    """Return why a system cannot run as a plan; None if it can. `iterates` says whether units repeat steps."""
    if not options.compiled:
        return "the options ask for none"
    if options.adaptive is not None or has_events(system, options):
        return "steps may end anywhere"
    if not options.algorithm.coupling.traits.in_plan:
        return f"the coupling is {options.algorithm.value}"
    if iterates:
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


def _named(ends: Iterable[PortName]) -> str:
    return ", ".join(str(end) for end in ends)
