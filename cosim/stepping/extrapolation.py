"""Linear extrapolation of inputs: each follows the line through its source's values at the last two points."""

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.fmu.instance import Instance
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import Connection, PortName, System

Moments = tuple[int, NDArray[np.float64], int, NDArray[np.float64]]
"""Tick and values before, tick and values last; the arrays are not written to again."""

Memory = Mapping[str, Any]
"""What is remembered of one unit: the tick at which it is, and its outputs' moments by port."""

_NONE: Mapping[str, NDArray[np.float64]] = {}


class SampleHistory:
    """An output at its last two communication points, and the line through them; level while there is only one.

    `values` is the array that the output's values are fetched to.
    """

    def __init__(self, values: NDArray[Any]) -> None:
        self._values = values
        here = np.array(values, dtype=np.float64)
        self.moments: Moments = (0, here, 0, here)

    @property
    def last(self) -> NDArray[np.float64]:
        """The values of the last point."""
        return self.moments[3]

    def record(self, tick: int) -> None:
        """Record the present values as those of a tick: the last one again, or a later one."""
        before, was, last, is_ = self.moments
        here = np.array(self._values, dtype=np.float64)
        self.moments = (last, is_, tick, here) if tick > last else (before, was, last, here)

    def at(self, half_ticks: int) -> NDArray[np.float64]:
        """Return the values on the line, at a time in half ticks: exact up to the rounding of the last operations."""
        before, was, last, is_ = self.moments
        if last == before:
            return is_
        return is_ + (is_ - was) * ((half_ticks - 2 * last) / (2 * (last - before)))

    def rate(self, tick: float) -> NDArray[np.float64]:
        """Return the line's slope per second; `tick` is in seconds."""
        before, was, last, is_ = self.moments
        return (is_ - was) / ((last - before) * tick) if last > before else np.zeros_like(is_)

    def get_state(self) -> list[Any]:
        """Return the two points as JSON can hold them."""
        before, was, last, is_ = self.moments
        return [before, was.tolist(), last, is_.tolist()]

    def set_state(self, state: list[Any]) -> None:
        """Restore what `get_state` returned."""
        before, was, last, is_ = state
        self.moments = (before, np.array(was, dtype=np.float64), last, np.array(is_, dtype=np.float64))


@dataclass(frozen=True, kw_only=True)
class _Line:
    """An input, the history of its source, and where in the step the input is evaluated, in halves of the step."""

    port: str
    history: SampleHistory
    target: NDArray[Any]
    change: LinearTransformation
    halves: int
    rate: NDArray[Any] | None = None

    def follow(self, half_ticks: int, tick: float) -> None:
        factor, offset = self.change.factor, self.change.offset
        self.target[...] = self.history.at(half_ticks) * factor + offset
        if self.rate is not None:
            self.rate[...] = self.history.rate(tick) * factor

    def extrapolate_to(self, end: NDArray[np.float64], dt: float) -> None:
        begin = self.history.last * self.change.factor + self.change.offset
        self.target[...] = begin + (end - begin) * (self.halves / 2)
        if self.rate is not None:
            self.rate[...] = (end - begin) / dt


class LinearExtrapolation:
    """Sets inputs on the lines through the values that their sources had at their last two communication points.

    A line is extrapolated where the source is not yet as far as the unit, and interpolated between two values of the
    source where that has stepped already (Gauss-Seidel) or is slower than the unit. At the start it is level. Times on
    it are counted in whole and half ticks.

    A unit of FMI 2 that interpolates inputs gets the value at the begin of its step, and the slope. Any other holds an
    input over its step, so one value must stand for the step:
    - the one in its middle. The integral of a line over the step is the length times this value, so that states are
      exact to second order in the step.
    - the one at its end, for an input that is declared to have direct feedthrough to an output that feeds another unit:
      the output counts for the end of the step, and so must the input. States of such a unit are exact to first order.

    Where units iterate, an input that leads back in a cycle follows the line from its source's last value to the value
    that the iteration presumes at the end of the step.

    Only continuous real values are extrapolated. Discrete ones, and those from or to a sampled unit, are held.
    """

    def __init__(self, system: System, instances: Mapping[str, Instance], tick: Fraction) -> None:
        self._instances = instances
        self._start, self._tick = float(system.start), float(tick)
        self._at = dict.fromkeys(instances, 0)
        self._histories: dict[str, dict[str, SampleHistory]] = {name: {} for name in instances}
        self._lines: dict[str, list[_Line]] = {name: [] for name in instances}
        followed = [c for c in system.connections if _is_followed(system, c)]
        ports: dict[str, list[str]] = defaultdict(list)
        for c in followed:
            ports[c.target.unit].append(c.target.port)
        for name, fed in ports.items():
            if instances[name].description.capabilities.interpolates_inputs:
                instances[name].interpolate(fed)
        feedthrough = _feedthrough_inputs(system)
        for c in followed:
            self._lines[c.target.unit].append(self._line(system, c, feedthrough=c.target in feedthrough))

    def feed(self, unit: str, t: float, dt: float, ends: Mapping[str, NDArray[np.float64]] = _NONE) -> None:
        """Write the extrapolated inputs for a step from t to t + dt; `ends` are presumed values at its end, by port."""
        at, long = 2 * self._ticks(t - self._start), self._ticks(dt)
        for line in self._lines[unit]:
            if line.port in ends:
                line.extrapolate_to(ends[line.port], dt)
            else:
                line.follow(at + line.halves * long, self._tick)

    def step(self, unit: str) -> None:
        """Record that a unit has stepped."""
        self._at[unit] = self._ticks(self._instances[unit].time - self._start)

    def publish(self, unit: str) -> None:
        """Record a unit's outputs at its present tick."""
        for history in self._histories[unit].values():
            history.record(self._at[unit])

    def save(self, units: Collection[str]) -> dict[str, Memory]:
        """Return the histories of units, for `restore`."""
        return {u: {"at": self._at[u], "moments": {p: t.moments for p, t in self._histories[u].items()}} for u in units}

    def restore(self, memories: Mapping[str, Memory]) -> None:
        """Restore what `save` returned."""
        for unit, memory in memories.items():
            self._at[unit] = memory["at"]
            moments: Mapping[str, Moments] = memory["moments"]
            for port, then in moments.items():
                self._histories[unit][port].moments = then

    def get_state(self) -> dict[str, Any]:
        """Return all histories as JSON can hold them."""
        histories = {u: {p: t.get_state() for p, t in ts.items()} for u, ts in self._histories.items()}
        return {"at": dict(self._at), "traces": histories}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._at = dict(state["at"])
        for unit, histories in self._histories.items():
            for port, history in histories.items():
                history.set_state(state["traces"][unit][port])

    def _line(self, system: System, c: Connection, *, feedthrough: bool) -> _Line:
        target, histories = self._instances[c.target.unit], self._histories[c.source.unit]
        values = self._instances[c.source.unit].y[c.source.port][0]
        rate = target.du.get(c.target.port)
        return _Line(
            port=c.target.port,
            history=histories.setdefault(c.source.port, SampleHistory(values)),
            target=target.u[c.target.port][0],
            change=system.transformation_of(c) or LinearTransformation(),
            halves=0 if rate else 2 if feedthrough else 1,
            rate=rate[0] if rate else None,
        )

    def _ticks(self, seconds: float) -> int:
        return round(seconds / self._tick)


def _is_followed(system: System, c: Connection) -> bool:
    source, target = system.units[c.source.unit], system.units[c.target.unit]
    if source.sampled or target.sampled:
        return False
    ends = source.description.outputs[c.source.port], target.description.inputs[c.target.port]
    return all(port.is_continuous for port in ends)


def _feedthrough_inputs(system: System) -> set[PortName]:
    """Return the inputs that are declared to have direct feedthrough to an output that feeds a unit."""
    feeding = {c.source for c in system.connections}
    inputs: set[PortName] = set()
    for y in feeding:
        inputs |= {PortName(y.unit, u) for u in system.units[y.unit].description.feedthrough.get(y.port, ())}
    return inputs
