"""First time derivatives of inputs, for FMI 2 units that interpolate."""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

from handover.cosim.fmu_description import FmuPort
from handover.cosim.signal_buffer import SignalBuffer


class RateBuffer(SignalBuffer):
    """A buffer for the derivatives of real inputs, per second; calling it sets them all."""

    def __init__(self, function: Callable[..., int], component: Any, ports: Sequence[FmuPort]) -> None:
        super().__init__("fmi2SetRealInputDerivatives", function, component, 2, ports)
        instance, references, count, values = self._arguments
        orders = (ctypes.c_int * count)(*(1 for _ in range(count)))
        self._arguments = (instance, references, count, orders, values)
