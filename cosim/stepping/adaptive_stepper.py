"""Steps of variable length: the error of each is estimated by step doubling, and the next one's length follows it."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from handover.cosim.exceptions import ScheduleError, UnitFailure, nearest
from handover.cosim.fmu.failures import NotFinite, UnitDiscarded
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.iteration import NotConverged
from handover.cosim.stepping.options import AdaptiveStep
from handover.cosim.stepping.stepper import Coupling
from handover.cosim.system.schedule import Schedule, Slot, TimeGrid
from handover.cosim.system.signals import Column
from handover.cosim.system.system import System

Values = NDArray[np.float64]

_K_I, _K_P = 0.3, 0.4
_SAFETY = 0.9
_MIN_FACTOR, _MAX_FACTOR = 0.2, 5.0
"""How much a step may shrink or grow from one to the next."""
_FLOOR = 1e-10
"""An error of 0 would ask for an infinite step."""


class PiController:
    """Proportional-integral control of the step, which is smoother than following the last error alone.

    After a step with the error r, in units of what is tolerated, the next one is longer by
    s (1/r)^(k_I/k) (r_before/r)^(k_P/k), k_I = 0.3, k_P = 0.4, for an error of order k in the step; s is a safety
    factor. After a rejected step, and in the first step after that, the error alone counts: s (1/r)^(1/k).

    Source: K. Gustafsson, Control theoretic techniques for stepsize selection in explicit Runge-Kutta methods, ACM
    Trans. Math. Softw. 17 (1991) 533-554.
    """

    def __init__(self, power: int) -> None:
        self._power = power
        self._before: float | None = None

    def after_acceptance(self, error: float) -> float:
        """Return the ratio of the next step's length to that of an accepted one with this error."""
        r = max(error, _FLOOR)
        if self._before is None:
            change = _SAFETY * r ** (-1 / self._power)
        else:
            change = _SAFETY * r ** (-_K_I / self._power) * (self._before / r) ** (_K_P / self._power)
        self._before = r
        return min(max(change, _MIN_FACTOR), _MAX_FACTOR)

    def after_rejection(self, error: float) -> float:
        """Return the ratio of the next attempt's length to that of a rejected step with this error."""
        self._before = None
        change = _SAFETY * error ** (-1 / self._power) if error < float("inf") else _MIN_FACTOR
        return min(max(change, _MIN_FACTOR), _SAFETY)

    def get_state(self) -> Mapping[str, Any]:
        """Return what is remembered as JSON can hold it."""
        return {"before": self._before}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._before = state["before"]


@dataclass(frozen=True)
class WorstSignal:
    """The scalar output with the largest error, in units of what is tolerated; infinite where it is NaN."""

    unit: str
    name: str
    error: float


class StepError:
    """Compares outputs of units: their connected real outputs that are continuous; all such where none is connected.

    Outputs that are not to be controlled are left out.

    Richardson's estimate: if the error of a step is proportional to its length to the power of order + 1, that of two
    steps of half the length is |y_halves - y_whole| / (2^order - 1). It is tolerated relative to the largest magnitude
    that the signal has had, so that it does not need shorter steps where it passes through zero.

    Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, sec. II.4; for coupled units
    T. Schierz, M. Arnold, C. Clauss, Co-simulation with communication step size control in an FMI compatible master
    algorithm, 9th International Modelica Conference (2012).
    """

    def __init__(self, ensemble: Ensemble, units: Sequence[str], control: AdaptiveStep, order: int) -> None:
        self._columns = [(unit, c) for unit in units for c in _compared(ensemble, unit, control.uncontrolled)]
        self._control = control
        self._divisor = 2.0**order - 1
        self._largest: Values = np.abs(self.values())
        self._absolute = np.array([control.absolute * abs(c.port.nominal or 1.0) for _, c in self._columns])

    def values(self) -> Values:
        """Return the outputs as they are."""
        return np.array([c.values[c.index] for _, c in self._columns], dtype=np.float64)

    def accept(self) -> None:
        """Raise the magnitudes to those of the present outputs."""
        self._largest = np.maximum(self._largest, np.abs(self.values()))

    def worst(self, whole: Values, halves: Values) -> WorstSignal:
        """Return the largest error after two half steps."""
        if not self._columns:
            return WorstSignal("", "", 0.0)
        tolerated = self._absolute + self._control.relative * np.maximum(self._largest, np.abs(halves))
        with np.errstate(invalid="ignore", divide="ignore"):
            errors = np.abs(halves - whole) / (self._divisor * tolerated)
        errors[(halves == whole) & (tolerated == 0)] = 0.0
        errors[np.isnan(errors)] = math.inf
        i = int(np.argmax(errors))
        unit, column = self._columns[i]
        return WorstSignal(unit, column.name, float(errors[i]))

    def get_state(self) -> list[float]:
        """Return what is remembered as JSON can hold it."""
        return self._largest.tolist()

    def set_state(self, state: list[float]) -> None:
        """Restore what `get_state` returned."""
        self._largest = np.array(state, dtype=np.float64)


def _compared(ensemble: Ensemble, unit: str, uncontrolled: Collection[str]) -> list[Column]:
    columns = [c for c in ensemble.signals().columns() if c.name.startswith(f"{unit}.") and c.port.is_continuous]
    columns = [c for c in columns if f"{unit}.{c.port.name}" not in uncontrolled]
    feeding = {c.source.port for c in ensemble.system.connections if c.source.unit == unit}
    return [c for c in columns if c.port.name in feeding] or columns


@dataclass(kw_only=True)
class StepStatistics:
    """Counts of steps, and the range of those that were accepted, in seconds."""

    accepted: int = 0
    rejected: int = 0
    shortest: float = 0.0
    longest: float = 0.0

    def accept(self, step: float) -> None:
        """Count a step that was accepted."""
        self.shortest = step if self.accepted == 0 else min(self.shortest, step)
        self.longest = max(self.longest, step)
        self.accepted += 1


_MAY_BE_TOO_LONG = (UnitDiscarded, NotFinite, NotConverged)
"""Failures of a step that a shorter one may avoid."""
_RESOLUTION = 8
"""Ticks of the fine grid in the smallest step."""


class StepTooSmall(UnitFailure):
    """The smallest step is not small enough for the tolerances.

    Attributes:
        signal: the scalar output with the largest error, `unit.port`.
        error: its error in units of what is tolerated; up to 1 is good.
        step: the step that was tried last, in seconds.
    """

    kind: ClassVar[str] = "step_too_small"
    verdict: ClassVar[str] = "the step could not follow its error"

    def __init__(self, unit: str, signal: str, t: float, step: float, error: float) -> None:
        self.signal, self.error, self.step = signal, error, step
        super().__init__(unit, "control of the step", t, "no step is short enough")

    @property
    def what(self) -> str:
        """What happened, to be read after the call."""
        return f"found none that is short enough: {self.message}"

    @property
    def message(self) -> str:
        """The signal with the largest error, and a remedy."""
        return (
            f"with a step of {self.step:.3g} s the error of {self.signal} is {self.error:.3g} times what is tolerated; "
            "if it is noise, leave it uncontrolled"
        )


class AdaptiveStepper:
    """Takes all continuous units together through steps whose error is tolerated, by step doubling.

    Each step is taken as one, rolled back, and taken again as two of half the length. The difference of the two
    attempts estimates the error, see `StepError`, from which the next step's length follows, see `PiController`. A step
    with a larger error than tolerated is rolled back and tried shorter, and so is one that a unit discards, whose
    outputs are not finite, or whose iteration does not converge; otherwise the units continue from the two halves.
    Sampled units act at their instants, once; no step reaches beyond one.

    Communication points are whole ticks of a grid that divides the schedule's by a power of two, and every instant of
    a sampled unit and the stop time is one of them. What observers see there ends the second half: an output that is a
    mean over the step is the mean over that half.

    Raises:
        StepTooSmall: from `depart`; the units are where the step began.
    """

    def __init__(
        self, schedule: Schedule, coupling: Coupling, ensemble: Ensemble, control: AdaptiveStep, order: int
    ) -> None:
        self.time = schedule.time(0)
        self.statistics = StepStatistics()
        self._schedule, self._coupling, self._ensemble = schedule, coupling, ensemble
        self._grid = fine_tick(schedule, control)
        self._times = TimeGrid.of(schedule.start, self._grid)
        self._per_tick = int(schedule.tick / self._grid)
        self._tick = self._last = 0
        self._due = {s.unit: 0 for s in schedule.sampled}
        self._acted = {s.unit: -1 for s in schedule.sampled}
        self._units = [s.unit for s in schedule.continuous]
        self._error = StepError(ensemble, self._units, control, order)
        self._controller = PiController(order + 1)
        self._smallest = 2 * math.ceil(control.smallest / self._grid / 2)
        self._largest = None if control.largest is None else max(self._smallest, int(control.largest / self._grid))
        initial = control.initial or min(s.every for s in schedule.continuous) * schedule.tick
        self._wanted = self._within_limits(int(initial / self._grid))
        for unit in self._units:
            ensemble.instances[unit].can_roll_back = True

    def arrive(self, last: int) -> bool:
        """Let the sampled units that are due act; see `Stepper`."""
        self._last = last * self._per_tick
        self._ensemble.external_inputs.ask(self.time)
        due = [s for s in self._schedule.sampled if self._due[s.unit] == self._tick > self._acted[s.unit]]
        self._coupling.arrive(self.time, due, ())
        for slot in due:
            self._acted[slot.unit] = self._tick
        return self._tick >= self._last

    def depart(self) -> None:
        """Step sampled units that are due, and take the others to the next communication point.

        Raises:
            StepTooSmall: an error is not tolerated even with the smallest step. UnitFailure: a unit's call failed.
        """
        due = [s for s in self._schedule.sampled if self._due[s.unit] == self._tick]
        self._coupling.depart(self.time, due, ())
        for slot in due:
            self._due[slot.unit] += slot.every * self._per_tick
        with self._ensemble.saved(self._units) as states:
            try:
                while not self._attempt(self._length()):
                    self._ensemble.restore(states)
            except (StepTooSmall, *_MAY_BE_TOO_LONG):
                self._ensemble.restore(states)
                raise

    def get_state(self) -> Mapping[str, Any]:
        """Return the ticks, the step wanted, and the state of step control and extrapolation; see `Stepper`."""
        return {
            "tick": self._tick,
            "due": dict(self._due),
            "acted": dict(self._acted),
            "wanted": self._wanted,
            "coupling": self._coupling.get_state(),
            "controller": self._controller.get_state(),
            "largest": self._error.get_state(),
            "statistics": asdict(self.statistics),
            **self._ensemble.get_input_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned."""
        self._tick, self._wanted = state["tick"], state["wanted"]
        self._due, self._acted = dict(state["due"]), dict(state["acted"])
        self.time = self._times.time(self._tick)
        self._coupling.set_state(state["coupling"])
        self._controller.set_state(state["controller"])
        self._error.set_state(state["largest"])
        self.statistics = StepStatistics(**state["statistics"])
        self._ensemble.set_input_state(state)

    def _attempt(self, length: int) -> bool:
        """Try a step from the present states of the units; return whether it was accepted."""
        failure: UnitFailure | None = None
        try:
            worst = self._worst_error(length)
        except _MAY_BE_TOO_LONG as e:
            failure, worst = e, WorstSignal(e.unit, "", math.inf)
        if worst.error > 1:
            self.statistics.rejected += 1
            if length <= self._smallest:
                step = self._seconds(length)
                raise failure or StepTooSmall(worst.unit, worst.name, self.time, step, worst.error)
            self._wanted = self._within_limits(int(length * self._controller.after_rejection(worst.error)))
            return False
        self.statistics.accept(self._seconds(length))
        self._error.accept()
        proposed = int(length * self._controller.after_acceptance(worst.error))
        cut = length < self._wanted  # by a communication point, which says nothing of the error of longer steps
        self._wanted = self._within_limits(max(proposed, self._wanted) if cut else proposed)
        self._tick += length
        self.time = self._times.time(self._tick)
        return True

    def _worst_error(self, length: int) -> WorstSignal:
        """Take a step as a whole, then as two halves, from which the units continue; return the largest difference."""
        with self._ensemble.saved(self._units) as states:
            self._step(self._tick, length)
            whole = self._error.values()
            self._ensemble.restore(states)
        self._step(self._tick, length // 2)
        self._step(self._tick + length // 2, length // 2)
        return self._error.worst(whole, self._error.values())

    def _step(self, tick: int, length: int) -> None:
        step = self._seconds(length)
        slots = [Slot(unit, length, step) for unit in self._units]
        self._coupling.depart(self._times.time(tick), (), slots)
        self._coupling.arrive(self._times.time(tick + length), (), slots)

    def _length(self) -> int:
        """Return the length to try: as wanted, but up to the next communication point, in parts of similar length."""
        left = min((self._last, *self._due.values())) - self._tick
        if self._wanted >= left:
            return left
        # At most half of what is left, so that no sliver remains before the communication point; even, to be halved.
        return min(self._wanted, max(2, left // 4 * 2))

    def _within_limits(self, length: int) -> int:
        length = max(length // 2 * 2, self._smallest)
        return length if self._largest is None else min(length, self._largest // 2 * 2)

    def _seconds(self, ticks: int) -> float:
        """Return a length in ticks in seconds, rounded once."""
        return ticks * self._grid.numerator / self._grid.denominator


def fine_tick(schedule: Schedule, control: AdaptiveStep) -> Fraction:
    """Return the grid of the steps in seconds: the schedule's tick, halved until it resolves the smallest step."""
    halvings = 1
    while schedule.tick / 2**halvings * _RESOLUTION > control.smallest:
        halvings += 1
    return schedule.tick / 2**halvings


def check_control(system: System, control: AdaptiveStep) -> None:
    """Check that the step of all units that are not sampled can follow its error.

    Raises:
        ScheduleError: it cannot; names all units that do not allow it, and uncontrolled signals that do not exist.
    """
    units = [u for u in system.units.values() if not u.sampled]
    faults = [f"{u.name} cannot save its state" for u in units if not u.description.capabilities.saves_state]
    faults += [f"{u.name} has events, at which steps end" for u in units if u.uses_events]
    faults += [f"{u.name} takes fixed steps only" for u in units if not u.description.capabilities.varies_step]
    if not units:
        faults.append("all units act at instants, at fixed times")
    outputs = [f"{u.name}.{port}" for u in units for port in u.description.outputs]
    unknown = [name for name in control.uncontrolled if name not in outputs]
    faults += [f"there is no output {name!r}: {nearest(name, outputs)}" for name in unknown]
    if faults:
        raise ScheduleError(f"the step cannot follow the error: {'; '.join(faults)}")
