"""Whether a system runs as a compiled plan."""

import logging

from cosim.ensemble import Ensemble
from cosim.extrapolation import Extrapolation
from cosim.master_options import MasterOptions
from cosim.plan.memory import loop
from cosim.plan.plan_stepper import PlanStepper
from cosim.schedule import Schedule

_log = logging.getLogger(__name__)

_WIDEST = 2**63
"""Above the numerators and denominators that the loop counts with."""


def plan_stepper(schedule: Schedule, ensemble: Ensemble, options: MasterOptions) -> PlanStepper | None:
    """Return what runs a system as a plan; None, with a line in the log, where the general path has to."""
    reason = _obstacle(schedule, options)
    if reason is not None:
        _log.info("no compiled plan: %s", reason)
        return None
    library = loop()
    if library is None:
        _log.info("no compiled plan: its library is not compiled for this machine")
        return None
    return PlanStepper(schedule, ensemble, options.algorithm, library, clock=options.cpu_times)


def _obstacle(schedule: Schedule, options: MasterOptions) -> str | None:
    if not options.compiled:
        return "the options ask for none"
    if options.extrapolation is not Extrapolation.HOLD:
        return "inputs are extrapolated"
    if max(schedule.tick.numerator, schedule.tick.denominator) >= _WIDEST:
        return f"a tick of {schedule.tick} s is too long a fraction"
    return None
