"""Finds NaN and infinity in the outputs of a unit that feed others."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.buffers import Views, joined
from handover.cosim.fmu.description import FmuPort, indices_of
from handover.cosim.fmu.failures import NotFinite


class FiniteCheck:
    """Checks the connected real outputs of one unit.

    Args:
        unit: the instance.
        fmi: version of its standard.
        views: where its outputs lie.
        read: its connected outputs, with the inputs that each feeds as `unit.port`.
    """

    def __init__(
        self, unit: str, fmi: int, views: Mapping[str, Views], read: Mapping[str, tuple[FmuPort, Sequence[str]]]
    ) -> None:
        self._unit, self._fmi = unit, fmi
        real = [(port, readers) for port, readers in read.values() if port.kind is Kind.REAL]
        self._ports = [(port, views[port.name][0], readers) for port, readers in real]
        self.blocks: list[NDArray[Any]] = [block for block, _ in joined((v, v) for _, v, _ in self._ports)]
        """The values, as few contiguous arrays."""

    def __call__(self, t: float, log: Sequence[str] = ()) -> None:
        """Check the values that were fetched at simulated time t in seconds.

        Raises:
            NotFinite: one is NaN or infinite.
        """
        for block in self.blocks:
            if not np.isfinite(block).all():
                failure = self.failure(t, log)
                if failure is not None:
                    raise failure

    def failure(self, t: float, log: Sequence[str] = ()) -> UnitFailure | None:
        """Return the failure that the values are, None if all are finite."""
        for port, values, readers in self._ports:
            wrong = np.flatnonzero(~np.isfinite(values))
            if len(wrong):
                at = int(wrong[0])
                index, call = list(indices_of(port.shape))[at], f"fmi{self._fmi}Get{port.fmi_type}"
                return NotFinite(self._unit, call, t, port.name, index, float(values[at]), readers=readers, log=log)
        return None
