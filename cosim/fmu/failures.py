"""The ways in which a unit can fail, each a subclass of `UnitFailure` with its data.

They end a run: statuses above Warning, values that are not finite, calls that hang or crash, discarded steps that are
not repeated, and events that do not settle. `failure_of` turns an FMI status into its type.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from handover.cosim.blocks.variable import subscript
from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.start_values import LostValue

STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
"""The standards' names of statuses, by number; Pending exists in FMI 2 only."""
_DISCARD, _FATAL = 2, 4
_MAX_VALUES = 12
"""Lost start values that a message lists."""


class UnitError(UnitFailure):
    """A call returned Error: the unit may be reset or freed, nothing else."""

    kind = "error"


class UnitFatal(UnitFailure):
    """A call returned Fatal: the unit must not be called again, not even to be freed."""

    kind = "fatal"


class UnitDiscarded(UnitFailure):
    """A call returned Discard: the unit cannot do this, but its state is valid.

    Attributes:
        reached: the time in seconds until which its step was successful, None where that is not known.
    """

    kind = "discard"

    def __init__(self, unit: str, call: str, t: float, log: Sequence[str] = (), reached: float | None = None) -> None:
        self.reached = reached
        super().__init__(unit, call, t, STATUS[_DISCARD], log)

    @property
    def what(self) -> str:
        """What happened, with the time that was reached."""
        return super().what + ("" if self.reached is None else f", having reached t = {self.reached:.6g} s")

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object."""
        return {**super().as_data(), "last_successful_time": self.reached}


class StepDiscarded(UnitDiscarded):
    """A unit discarded a step, and the step is not repeated with a shorter one.

    Attributes:
        reached: the time in seconds until which its step was successful; in FMI 3 the step's begin.
        reason: why it is not repeated.
    """

    def __init__(self, unit: str, call: str, t: float, reached: float, reason: str, log: Sequence[str] = ()) -> None:
        self.reason = reason
        super().__init__(unit, call, t, log, reached)

    @property
    def what(self) -> str:
        """What happened, with the time that was reached and the reason."""
        return f"{super().what}; {self.reason}"

    @property
    def message(self) -> str:
        """What the unit logged last, and the reason."""
        return f"{super().message} ({self.reason})"


class NotFinite(UnitFailure):
    """An output that feeds another unit is NaN or infinite.

    Attributes:
        port: the output's name.
        index: which element of it, counted from 1 as in FMI; empty for a scalar.
        value: nan, inf or -inf.
        readers: the inputs that it feeds, as `unit.port`.
    """

    kind = "not_finite"

    def __init__(
        self, unit: str, call: str, t: float, port: str, index: Sequence[int], value: float, *,
        readers: Sequence[str] = (), log: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.port, self.index, self.value, self.readers = port, tuple(index), value, tuple(readers)
        super().__init__(unit, call, t, "NaN" if math.isnan(value) else "-infinity" if value < 0 else "infinity", log)

    @property
    def element(self) -> str:
        """The element's name, as `y` or `p_WG[3]`."""
        return self.port + subscript(self.index)

    @property
    def what(self) -> str:
        """What happened: which element, and what it feeds."""
        feeds = f", which feeds {', '.join(self.readers)}" if self.readers else ""
        return f"gave {self.element} = {self.status}{feeds}"

    @property
    def message(self) -> str:
        """Element and value; they matter more than what the unit logged."""
        return f"{self.element} = {self.status}"

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object."""
        return {**super().as_data(), "port": self.port, "element": list(self.index), "value": self.status}


class StartValuesLost(UnitFailure):
    """Units have other values in initialization mode than were set, before it and in it.

    Attributes:
        values: what was set and what was found, by variable.
    """

    kind = "start_values_lost"

    def __init__(self, units: Sequence[str], t: float, values: Sequence[LostValue]) -> None:
        self.values = tuple(values)
        super().__init__(", ".join(units), "initialization", t, "start values that were set do not hold")

    @property
    def what(self) -> str:
        """What happened: all values that do not hold."""
        return f"did not keep what was set, before and in initialization mode: {self._listed}"

    @property
    def message(self) -> str:
        """All values that do not hold."""
        return f"{self._listed}, though it was set before and in initialization mode"

    @property
    def _listed(self) -> str:
        more = len(self.values) - _MAX_VALUES
        return "; ".join(map(str, self.values[:_MAX_VALUES])) + (f"; and {more} more" if more > 0 else "")

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object."""
        return {**super().as_data(), "values": [value._asdict() for value in self.values]}


class InvalidReturn(UnitFailure):
    """A step of FMI 3 returned early without being allowed to, or with a time before its begin or beyond its end.

    Attributes:
        returned: the time in seconds that the unit gave as the last successful one.
        fault: what is wrong with that, to be read after the call.
    """

    kind = "invalid_return"

    def __init__(self, unit: str, call: str, t: float, returned: float, fault: str, log: Sequence[str] = ()) -> None:
        self.returned, self.fault = returned, fault
        super().__init__(unit, call, t, "a return at a time that was not allowed", log)

    @property
    def what(self) -> str:
        """What happened: the time returned, and the step."""
        return self.fault

    @property
    def message(self) -> str:
        """What happened; what the unit logged last need not have to do with it."""
        return self.fault

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object; a time that is not finite is None."""
        return {**super().as_data(), "last_successful_time": self.returned if math.isfinite(self.returned) else None}


class UnitTerminated(UnitFailure):
    """The unit asked to end the simulation: FMI 3 `terminateSimulation`, FMI 2 `fmi2Terminated`.

    That is its right and no failure: `Master.run` catches it and ends the run.

    Attributes:
        reached: the time in seconds until which it has stepped.
        completed: whether that is the end of its step.
    """

    kind = "ended"

    def __init__(
        self, unit: str, call: str, t: float, log: Sequence[str] = (), *,
        reached: float | None = None, completed: bool = False,
    ) -> None:  # fmt: skip
        self.reached = t if reached is None else reached
        self.completed = completed
        super().__init__(unit, call, t, "a request to end the simulation", log)

    @property
    def what(self) -> str:
        """What happened."""
        return "asked to end the simulation"

    @property
    def summary(self) -> str:
        """What happened, for who reads how a run went."""
        return f"unit {self.unit} ended the simulation at t = {self.reached:.6g} s"

    def as_data(self) -> dict[str, Any]:
        """Return the request as a JSON object."""
        return {**super().as_data(), "reached": self.reached}


class UnitHung(UnitFailure):
    """A call did not return within the time limit; the unit is abandoned and never called again.

    Attributes:
        limit: seconds of wall time.
    """

    kind = "hang"

    def __init__(self, unit: str, call: str, t: float, limit: float, log: Sequence[str] = ()) -> None:
        self.limit = limit
        super().__init__(unit, call, t, f"no return within {limit:g} s", log)

    @property
    def what(self) -> str:
        """What happened, with the limit."""
        return f"did not return within {self.limit:g} s"

    @property
    def message(self) -> str:
        """What happened; the unit's log is from before the call and says nothing of it."""
        return self.what


class EndOfProcess(UnitFailure):
    """What ended a unit's process, as far as the process alone shows; `status` says how."""

    @property
    def message(self) -> str:
        """The status; the unit's log is from before and says nothing of it."""
        return self.status

    @property
    def cause(self) -> str:
        """The headline: the log cannot add to it."""
        return self.headline


class UnitCrashed(EndOfProcess):
    """The process ended within a unit's call; `status` says how, as in "segmentation fault"."""

    kind = "crash"

    @property
    def headline(self) -> str:
        """One line: unit, call, time, and how the process ended."""
        return f"unit {self.unit} crashed in {self.call} at t = {self.t:.6g} s: {self.status}"


class LimitsLowered(EndOfProcess):
    """A unit lowered hard limits of the process, which could not go on with what it may have; `status` says which.

    Where it is not known which unit it was, `unit` names all in the process.
    """

    kind = "limits"

    @property
    def headline(self) -> str:
        """One line: unit, call, and which limits."""
        return (
            f"unit {self.unit} lowered hard limits in {self.call}: {self.status}; the run could not go on with that at "
            f"t = {self.t:.6g} s, and such limits cannot be put back"
        )


class UnsettledEvents(UnitFailure):
    """Units in event mode keep changing each other's inputs, or keep asking for another iteration."""

    kind = "unsettled"

    def __init__(self, units: Iterable[str], t: float, iterations: int, call: str = "fmi3UpdateDiscreteStates") -> None:
        self.units = tuple(units)
        status = f"no end of events after {iterations} iterations; these do not settle: {', '.join(self.units)}"
        super().__init__(self.units[0], call, t, status)

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object."""
        return {**super().as_data(), "units": list(self.units)}


def failure_of(unit: str, call: str, t: float, status: int, log: Sequence[str] = ()) -> UnitFailure:
    """Return the failure of an FMI status above Warning."""
    status_name = STATUS[status] if 0 <= status < len(STATUS) else str(status)
    if status == _DISCARD:
        return UnitDiscarded(unit, call, t, log)
    return (UnitFatal if status == _FATAL else UnitError)(unit, call, t, status_name, log)
