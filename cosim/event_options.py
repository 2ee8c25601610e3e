"""What does not go together with steps that may end anywhere."""

from cosim.exceptions import ScheduleError
from cosim.extrapolation import Extrapolation
from cosim.master_options import MasterOptions
from cosim.system import System


def has_events(system: System, options: MasterOptions) -> bool:
    """Whether steps may end off the grid at events, or where one is discarded; an adaptive step repeats by itself."""
    return system.has_events or (options.repeat_discarded and options.adaptive is None)


def refuse_off_grid(system: System, options: MasterOptions) -> None:
    """Refuse what is defined for steps on a grid, or for steps whose lengths are the master's choice, only.

    Raises:
        ScheduleError: inputs are to be extrapolated, or the step to follow the error, though steps may end anywhere.
    """
    if not has_events(system, options):
        return
    eventful = ", ".join(u.name for u in system.units.values() if u.uses_events)
    where = f"at events ({eventful})" if eventful else "when one is discarded"
    if options.extrapolation is Extrapolation.LINEAR:
        raise ScheduleError(
            f"inputs can follow lines only where all steps lie on one grid, and steps may end off it {where}: let "
            "inputs be held"
        )
    if options.adaptive is not None:
        raise ScheduleError(f"the step cannot follow the error while steps end {where}: take fixed steps")
