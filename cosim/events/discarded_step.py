"""What a unit tells of a step that it discarded."""

import ctypes
from collections.abc import Callable
from typing import Any

_LAST_SUCCESSFUL_TIME, _TERMINATED = ctypes.c_int(2), ctypes.c_int(3)  # of fmi2StatusKind


def discarded_step(function: Callable[[str], Any], component: Any, t: float, fmi: int) -> tuple[float, bool]:
    """Ask a unit how far its step came, and whether it wants to end the simulation. FMI 2.0.4, sec. 4.2.3.

    In FMI 3 it stands where it stood, and there is nothing to ask (FMI 3.0, sec. 2.2.4).

    Args:
        function: gives the unit's functions by their names without `fmi2`.
        component: the instance.
        t: the step's begin in seconds, which stands where the unit does not tell.
        fmi: version of its standard.
    """
    if fmi == 3:
        return t, False
    reached, ended = ctypes.c_double(t), ctypes.c_int()
    if function("GetRealStatus")(component, _LAST_SUCCESSFUL_TIME, ctypes.byref(reached)) > 1:
        reached.value = t
    told = function("GetBooleanStatus")(component, _TERMINATED, ctypes.byref(ended))
    return reached.value, told <= 1 and bool(ended.value)
