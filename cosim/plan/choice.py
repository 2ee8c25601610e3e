"""Chooses whether a system runs as a compiled plan, and logs why it does not.

What the plan does not support has to be an obstacle here: the two paths give the same bytes.
"""

import logging

from handover.cosim.plan.memory import loop
from handover.cosim.plan.plan_maker import PlanMaker
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.options import Algorithm, Extrapolation, MasterOptions
from handover.cosim.stepping.stepper import Coupling
from handover.cosim.system.schedule import Schedule

_log = logging.getLogger(__name__)

_MAX_TICKS = 2**63
"""Numerators and denominators of a tick must be below this: the loop has 64 bits for them."""


def plan_stepper(
    schedule: Schedule, ensemble: Ensemble, coupling: Coupling, options: MasterOptions, *, iterates: bool
) -> PlanStepper | None:
    """Return a stepper that runs a system as a plan; None, with a line in the log, where only the general path can.

    `coupling` does the same on the general path; `iterates` says whether units repeat steps after a rollback.
    """
    reason = _obstacle(schedule, ensemble, options, iterates)
    library = loop() if reason is None else None
    if library is None:
        log_fallback(reason or "its library is not compiled for this machine")
        return None
    plan = PlanMaker(ensemble, schedule, options.algorithm, library, clock=options.cpu_times)
    return PlanStepper(schedule, ensemble, coupling, plan)


def log_fallback(reason: str) -> None:
    """Log why a system does not run as a plan."""
    _log.info("no compiled plan: %s", reason)


def _obstacle(schedule: Schedule, ensemble: Ensemble, options: MasterOptions, iterates: bool) -> str | None:
    if not options.compiled:
        return "the options ask for none"
    if options.algorithm not in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL):
        return f"the coupling is {options.algorithm.value}"
    if iterates:
        return "units make a loop"
    if options.extrapolation is not Extrapolation.HOLD:
        return "inputs are extrapolated"
    if ensemble.system.followed:
        return "inputs follow values over time"
    if ensemble.external_inputs:
        return "inputs come from outside"
    if max(schedule.tick.numerator, schedule.tick.denominator) >= _MAX_TICKS:
        return f"a tick of {schedule.tick} s is too long a fraction"
    return None
