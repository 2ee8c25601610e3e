"""Sets the inputs of loaded units that come from outside, see `System.external`, at each communication point.

Values are written to where the unit's inputs are set from, so that couplings pass them on like all others.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.instance import Instance
from handover.cosim.fmu.start_values import entries_of
from handover.cosim.system.system import System
from handover.cosim.system.time_series import ExternalSource, entries_fault

_NO_ENTRIES: NDArray[Any] = np.zeros(0)


class InvalidExternalValue(UnitFailure):
    """A source gave what its input cannot take."""

    kind = "external_input"
    verdict = "an input from outside was not valid"

    @property
    def what(self) -> str:
        """What the source gave, and what would be right."""
        return self.status


class ExternalInput:
    """An input of a loaded unit, and the source of its values.

    Args:
        unit: the unit's name.
        port: the input.
        values: memory from which the unit's input is set, which holds the start value.
        source: is asked for values.
    """

    def __init__(self, unit: str, port: FmuPort, values: NDArray[Any], source: ExternalSource) -> None:
        self.name = f"{unit}.{port.name}"
        self._unit, self._port, self._values, self._source = unit, port, values, source

    def ask(self, t: float) -> None:
        """Take the source's value for the communication point at t, s.

        Raises:
            InvalidExternalValue: it is not a number, of another size, not finite, no whole number where the input takes
                just those, or out of the input's range.
        """
        given = self._source.at(t)
        if given is None:
            return
        entries, fault = _NO_ENTRIES, f"got {short_repr(given)}, which is not an array of numbers"
        with contextlib.suppress(ValueError):  # rows of different lengths are no array
            entries = np.asarray(given).ravel()
            fault = entries_fault(self._port, entries)
        if fault is not None:
            raise InvalidExternalValue(self._unit, f"setting {self._port.name} from outside", t, fault)
        self._values[...] = entries

    def entries(self) -> list[Any]:
        """Return the value that holds."""
        return self._values.tolist()

    def hold(self, entries: Sequence[Any]) -> None:
        """Hold a value that was checked before."""
        self._values[...] = entries


class ExternalInputs:
    """All inputs of loaded units that come from outside, asked together at each communication point.

    Args:
        system: says which inputs these are, their sources, and their start values.
        instances: the loaded units, by name.

    Attributes:
        wait: is called with the time of a communication point, s, before the sources are asked: so a run that keeps
            pace with the wall clock gets what is newest when the point is due, not when the one before was.
    """

    def __init__(self, system: System, instances: Mapping[str, Instance]) -> None:
        self._inputs: list[ExternalInput] = []
        self._asked: float | None = None
        self.wait: Callable[[float], None] | None = None
        for end, source in system.externals.items():
            instance = instances[end.unit]
            port, values = instance.description.inputs[end.port], instance.u[end.port][0]
            values[...] = entries_of(port, system.units[end.unit].start)
            self._inputs.append(ExternalInput(end.unit, port, values, source))

    def __bool__(self) -> bool:
        """Return whether there are any."""
        return bool(self._inputs)

    def ask(self, t: float) -> None:
        """Take the values for the communication point at t, s, unless they were taken already.

        Raises:
            InvalidExternalValue: an input cannot take what its source gave.
        """
        if t == self._asked:
            return
        if self.wait is not None:
            self.wait(t)
        self._asked = t
        for one in self._inputs:
            one.ask(t)

    def get_state(self) -> dict[str, Any]:
        """Return the values that hold and their time, as JSON can hold them."""
        return {"asked": self._asked, "values": {one.name: one.entries() for one in self._inputs}}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Let the values hold that `get_state` returned."""
        self._asked = state["asked"]
        for one in self._inputs:
            one.hold(state["values"][one.name])
