"""Values that an input takes over time: given beforehand, on lines between instants or held, or from outside."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import counted
from handover.cosim.fmu.file.description import FmuPort

SETTABLE_KINDS = (Kind.REAL, Kind.INTEGER, Kind.BOOLEAN, Kind.ENUMERATION)
"""Kinds of inputs that can follow values over time, or come from outside."""


class TimeSeries:
    """A value u(t), from u_k at times t_k.

    Linear: u(t) = u_k + (t - t_k) (u_{k+1} - u_k) / (t_{k+1} - t_k) between two times; else u(t) = u_k from t_k until
    t_{k+1}. Before the first time it is the first value, from the last on the last. Where a time is given more than
    once u jumps: the last value given counts from there on.

    Args:
        times: in seconds, shape [n], none below the one before it.
        values: shape [n, size], entries of an array in row-major order; in the unit of the input.
        linear: whether values between two times lie on a line.
        unit: symbol of the unit of measurement that the values are known to be in; the input's must be the same.

    Raises:
        ValueError: there are no times, they descend, numbers are not finite, or there is not one row a time.
    """

    def __init__(
        self, times: Sequence[float] | Floats, values: Any, *, linear: bool, unit: str | None = None
    ) -> None:  # fmt: skip
        self.times: Floats = np.asarray(times, dtype=np.float64)
        self.values: NDArray[Any] = np.asarray(values)
        self.linear, self.unit = linear, unit
        if self.times.ndim != 1 or not len(self.times):
            raise ValueError("a series needs one time at least")
        if self.values.ndim != 2 or len(self.values) != len(self.times):
            raise ValueError(f"values of shape {self.values.shape} for {len(self.times)} times: expected a row a time")
        if not (np.isfinite(self.times).all() and np.isfinite(np.asarray(self.values, dtype=np.float64)).all()):
            raise ValueError("times and values must be finite")
        if (np.diff(self.times) < 0).any():
            raise ValueError("times must not descend")

    def at(self, t: float) -> NDArray[Any]:
        """Return the entries at t, s."""
        k = int(np.searchsorted(self.times, t, side="right")) - 1
        if k < 0:
            return self.values[0]
        if not self.linear or k == len(self.times) - 1:
            return self.values[k]
        t_k, t_next = self.times[k], self.times[k + 1]
        return self.values[k] + (t - t_k) / (t_next - t_k) * (self.values[k + 1] - self.values[k])

    def fault(self, port: FmuPort) -> str | None:
        """Return why an input cannot follow this, or None."""
        if port.kind not in SETTABLE_KINDS:
            return f"a {port.kind.value} cannot follow values over time"
        if port.clocks:
            return f"it can be set only while its clock {port.clocks[0]} ticks, so it cannot follow values over time"
        if self.values.shape[1] != port.size:
            return f"{self.values.shape[1]} values a time where {counted(port.size, 'is', 'are')} right"
        if self.linear and not port.is_continuous:
            return "its values are held: it does not vary continuously"
        if port.kind is Kind.REAL and self.unit and port.unit.symbol not in ("", self.unit):
            return f"values in {self.unit} where {port.unit} is right"
        broken = self.values[(self.values != np.round(self.values)).any(axis=1)] if port.kind is not Kind.REAL else ()
        if port.kind in (Kind.REAL, Kind.INTEGER):  # what is between the least and the most is in range, too
            rows = [*broken[:1], self.values.min(axis=0), self.values.max(axis=0)]
        else:
            rows = np.unique(self.values, axis=0)
        return next((fault for row in rows if (fault := entries_fault(port, row))), None)


class HeldValue(TimeSeries):
    """A value that is set from outside while a run goes on, and holds until it is set again.

    An input that follows it takes a new value at the next communication point at which its unit gets inputs; this is
    how a program sets inputs that no output feeds, see `System.follow`.

    Args:
        entries: the value until it is set, entries in row-major order, in the unit of the input.
    """

    def __init__(self, entries: Sequence[Any] | NDArray[Any]) -> None:
        super().__init__([0.0], np.array([entries]), linear=False)

    @property
    def entries(self) -> NDArray[Any]:
        """The value that holds, entries in row-major order."""
        return self.values[0]

    def set(self, entries: Sequence[Any] | NDArray[Any]) -> None:
        """Hold another value of as many entries from now on.

        Raises:
            ValueError: these are others, not finite, or not of the type of the first.
        """
        given, kind = np.asarray(entries), self.values.dtype
        fits = given.shape == self.entries.shape and given.dtype.kind in ("b" if kind == np.bool_ else "iuf")
        if not (fits and np.isfinite(given).all() and (given.astype(kind) == given).all()):
            right = f"{counted(len(self.entries), 'finite number')} of type {kind}"
            raise ValueError(f"{short_repr(given)} cannot be held here: expected {right}")
        self.values[0] = given


class ExternalSource(Protocol):
    """Where the values of an input come from while a run goes on, see `System.external`. A `TimeSeries` is one."""

    def at(self, t: float) -> "Sequence[Any] | NDArray[Any] | None":
        """Return the entries for the communication point at t, s, in row-major order; None lets the value hold.

        It is asked once at each communication point, at t = 0 before the units are initialised, and for all inputs
        before any unit gets them, in the order in which they were declared: a source of several inputs, such as the
        parts of a sample of a hand, takes the sample at the first of these questions.
        """
        ...


class NoSource:
    """A source that says nothing: the input keeps its start value."""

    def at(self, t: float) -> None:  # noqa: ARG002
        """Let the value hold."""
        return


def entries_fault(port: FmuPort, entries: NDArray[Any]) -> str | None:
    """Return what is wrong with a value for an input, given by its entries in row-major order, or None."""
    if len(entries) != port.size:
        return f"got {len(entries)} values where {counted(port.size, 'is', 'are')} right"
    if entries.dtype.kind not in "biuf":
        return f"got {short_repr(entries.tolist())}, which is not an array of numbers"
    known = (0, 1) if port.kind is Kind.BOOLEAN else [value for _, value in port.items]
    if wrong := [n for n in entries.tolist() if known and n not in known]:
        return f"got {wrong[0]}, which is {'no boolean' if port.kind is Kind.BOOLEAN else f'none of its items {known}'}"
    if port.kind is Kind.BOOLEAN:
        return None
    fault = fault_of(port, entries.reshape(port.shape).tolist())
    return None if fault is None else f"got what it cannot take: {fault}"


def external_fault(port: FmuPort) -> str | None:
    """Return why an input cannot come from outside, or None."""
    if port.kind not in SETTABLE_KINDS:
        return f"a {port.kind.value} cannot come from outside"
    if port.clocks:
        return f"it can be set only while its clock {port.clocks[0]} ticks, so it cannot come from outside"
    return None
