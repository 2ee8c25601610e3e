"""What does not go together with steps that may end anywhere."""

from handover.cosim.exceptions import ScheduleError
from handover.cosim.master_options import MasterOptions
from handover.cosim.stepping.extrapolation import Extrapolation
from handover.cosim.system.system import System


def has_events(system: System, options: MasterOptions) -> bool:
    """Whether steps may end off the grid at events, or where one is discarded; an adaptive step repeats by itself."""
    return system.has_events or (options.repeat_discarded and options.adaptive is None)


def refuse_off_grid(system: System, options: MasterOptions) -> None:
    """Refuse what is defined for steps on a grid only; `check_control` refuses events where the step follows the error.

    Raises:
        ScheduleError: inputs are to be extrapolated, though steps may end anywhere.
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
