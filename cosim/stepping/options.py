"""Options of a master: the algorithm that couples units, how inputs are extrapolated, how the step is controlled.

They are checked when made, and mean the same for every system; what does not go with a system is found by
`StepperFactory`.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from fractions import Fraction
from importlib import import_module
from numbers import Rational, Real
from typing import TYPE_CHECKING, Any, cast

from handover.cosim.exceptions import InvalidOptions

if TYPE_CHECKING:
    from handover.cosim.stepping.stepper import Coupling


@dataclass(frozen=True, kw_only=True)
class AdaptiveStep:
    """Tolerances and limits of a step that is controlled by its error; see `AdaptiveStepper`.

    Attributes:
        relative: error tolerated in a step, relative to the largest magnitude that the signal has had.
        absolute: error tolerated besides, relative to the signal's nominal value, which is 1 in its unit where its FMU
            does not say.
        smallest, largest: limits of the step in seconds; without a largest one, only instants of sampled units and the
            stop time limit it.
        initial: the first step to try in seconds; by default the shortest step that units would take by themselves.
        uncontrolled: outputs, `unit.port`, whose error is ignored, such as noise, which is rough at every step.

    Raises:
        InvalidOptions: with all faults.
    """

    relative: float = 1e-4
    absolute: float = 1e-6
    smallest: Fraction = Fraction(1, 10**6)
    largest: Fraction | None = None
    initial: Fraction | None = None
    uncontrolled: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        given: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        exact = "expected an exact number of seconds, such as Fraction(1, 1000)"
        faults = [f"{n} = {given[n]!r}: expected a number" for n in ("relative", "absolute") if not _is_real(given[n])]
        steps = {n: given[n] for n in ("smallest", "largest", "initial") if n == "smallest" or given[n] is not None}
        faults += [f"{name} = {step!r}: {exact}" for name, step in steps.items() if not isinstance(step, Rational)]
        if not _are_names(self.uncontrolled):
            faults.append(f"uncontrolled = {self.uncontrolled!r}: expected a tuple of outputs, such as ('arm.p_WG',)")
        if faults:
            raise InvalidOptions(faults)
        faults = [
            f"the {name} tolerance is {value!r}: expected a number from 0 on"
            for name, value in (("relative", self.relative), ("absolute", self.absolute))
            if not (math.isfinite(value) and value >= 0)
        ]
        if self.relative == self.absolute == 0:
            faults.append("both tolerances are 0, which no step meets; let one be above")
        if self.smallest <= 0:
            faults.append(f"the smallest step is {float(self.smallest):g} s; it must be above 0 s")
        if self.largest is not None and self.largest < self.smallest:
            faults.append(f"the largest step, {float(self.largest):g} s, is below the smallest, {self._smallest}")
        if self.initial is not None and not self.smallest <= self.initial <= (self.largest or self.initial):
            upper = "" if self.largest is None else f" to {float(self.largest):g} s"
            limits = f"{self._smallest}{upper}"
            faults.append(f"the first step, {float(self.initial):g} s, is out of the range from {limits}")
        if faults:
            raise InvalidOptions(faults)

    @property
    def _smallest(self) -> str:
        return f"{float(self.smallest):g} s"


class Extrapolation(enum.Enum):
    """What a unit's inputs are during its step.

    HOLD: the last values of their sources. LINEAR: on the line through the values of their sources at the last two
    communication points; see `LinearExtrapolation`.
    """

    HOLD = "hold"
    LINEAR = "linear"


class Algorithm(enum.Enum):
    """How units that are due at the same time get their inputs; `summary` says it of each.

    With all, the units of an algebraic loop repeat the step after a rollback until they converge. Some iterate all
    units that are connected in a cycle so (iterated, strong or implicit coupling). FIXED_POINT solves all loops, also
    those at the start, by its own iteration, the others by Newton's method.
    """

    _path: str
    JACOBI = "jacobi", "jacobi:Jacobi"
    GAUSS_SEIDEL = "gauss-seidel", "gauss_seidel:GaussSeidel"
    FIXED_POINT = "fixed-point", "gauss_seidel:IteratedFixedPoint"
    NEWTON = "newton", "gauss_seidel:IteratedNewton"

    def __new__(cls, name: str, path: str) -> "Algorithm":
        """Make a member of its name, which is its value, and `module:Class` in this folder."""
        member = object.__new__(cls)
        member._value_, member._path = name, path
        return member

    @property
    def coupling(self) -> "type[Coupling]":
        """Its class, loaded when it is asked for: options alone need none."""
        module, _, name = self._path.partition(":")
        return getattr(import_module(f"handover.cosim.stepping.{module}"), name)

    @property
    def iterates(self) -> bool:
        """Whether all units that are connected in a cycle repeat steps after a rollback."""
        return self.coupling.traits.iterates

    @property
    def summary(self) -> str:
        """Which values units step from, for the command's help."""
        return self.coupling.traits.summary


CALL_LIMIT = 60.0
"""Seconds of wall time that a unit may take for one call where a command or a program does not say."""


@dataclass(frozen=True, kw_only=True)
class MasterOptions:
    """How a master couples its units.

    Attributes:
        algorithm: see `Algorithm`.
        tolerance: the largest difference, relative to a signal's magnitude, at which iterated signals have converged.
        max_iterations: after so many iterations of a step, the run fails.
        extrapolation: what inputs are between communication points; see `Extrapolation`.
        adaptive: how the step follows the error; None for fixed steps.
        cpu_times: whether `Master.cpu` has the CPU time of every step; measuring it costs 0.2 us a step.
        compiled: whether a plain system (fixed steps, no events) may run as a compiled plan.
        repeat_discarded: whether a step that a unit discards is repeated shorter, by all units. They then save their
            states at every step; else a discarded step ends the run. Systems with events do so anyway.
        call_limit: seconds of wall time that a unit may take for one call; None: any.
        isolated: units that live in processes of their own, by name; `foreign` are those that were not built by this
            project, `all` is all, also where a unit itself is named so. What a unit does then harms itself alone, and
            units that do not wait for each other step at the same time; the results are the same.
        pace: simulated seconds per second of wall time that a run keeps to; None: as fast as it goes.
        unit_tolerances: relative tolerances that units are given for their own solvers, by name; `all` is all others,
            also where a unit itself is named so. The rest get that of their default experiment, if there is one.
        strict: whether a unit's faulty description is refused even where a run is possible, as where a start value is
            out of its range or no step is proposed. Else the master warns of it.

    Raises:
        InvalidOptions: with all invalid values.
    """

    algorithm: Algorithm = Algorithm.GAUSS_SEIDEL
    tolerance: float = 1e-8
    max_iterations: int = 100
    extrapolation: Extrapolation = Extrapolation.HOLD
    adaptive: AdaptiveStep | None = None
    cpu_times: bool = False
    compiled: bool = True
    repeat_discarded: bool = False
    call_limit: float | None = None
    pace: float | None = None
    strict: bool = False
    isolated: tuple[str, ...] = ()
    unit_tolerances: Mapping[str, float] = field(default_factory=dict[str, float])

    def __post_init__(self) -> None:
        given: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        checks = {
            "algorithm": (isinstance(given["algorithm"], Algorithm), f"one of {_names(Algorithm)}"),
            "extrapolation": (isinstance(given["extrapolation"], Extrapolation), f"one of {_names(Extrapolation)}"),
            "adaptive": (isinstance(given["adaptive"], AdaptiveStep | None), "None, or such as AdaptiveStep()"),
            "max_iterations": (_is_above_0(given["max_iterations"], int), "a whole number from 1 on"),
            "tolerance": (_is_above_0(given["tolerance"], int | float), "a finite number above 0"),
            "call_limit": (_is_above_0(given["call_limit"], int | float, None), "None, or a finite number above 0"),
            "isolated": (_are_names(given["isolated"]), "a tuple of units' names, `foreign` or `all`"),
            "unit_tolerances": (
                _are_tolerances(given["unit_tolerances"]),
                "a mapping of units' names, or `all`, to finite numbers above 0",
            ),
            "pace": (_is_above_0(given["pace"], int | float, None), "None, or a finite number above 0"),
        }
        flags = ("cpu_times", "compiled", "repeat_discarded", "strict")
        checks |= {name: (isinstance(given[name], bool), "True or False") for name in flags}
        faults = [f"{name} = {given[name]!r}: expected {valid}" for name, (fits, valid) in checks.items() if not fits]
        if faults:
            raise InvalidOptions(faults)

    def as_data(self) -> dict[str, Any]:
        """Return the options that affect a run's signals, as JSON can hold them; exact seconds are texts."""
        control = None if self.adaptive is None else asdict(self.adaptive)
        if control is not None:
            control = {name: str(value) if isinstance(value, Fraction) else value for name, value in control.items()}
        return {
            "algorithm": self.algorithm.value,
            "tolerance": self.tolerance,
            "iterations": self.max_iterations,
            "extrapolation": self.extrapolation.value,
            "adaptive": control,
            "repeat_discarded": self.repeat_discarded,
            **({"isolated": list(self.isolated)} if self.isolated else {}),
            **({"unit_tolerances": dict(self.unit_tolerances)} if self.unit_tolerances else {}),
        }

    @property
    def order(self) -> int:
        """Order of the error of a run in the step: see `Extrapolation`."""
        return 2 if self.extrapolation is Extrapolation.LINEAR else 1


OPTION_RECORDS = (MasterOptions, AdaptiveStep, Algorithm, Extrapolation)
"""Types of which options are made, for `pack_state` and `unpack_state`."""


def _names(kind: type[enum.Enum]) -> str:
    return ", ".join(f"{kind.__name__}.{item.name}" for item in kind)


def _is_above_0(value: Any, kind: Any, *others: None) -> bool:
    return value in others or (isinstance(value, kind) and 0 < value < math.inf)


def _is_real(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _are_names(value: Any) -> bool:
    return isinstance(value, tuple) and all(isinstance(name, str) for name in cast(tuple[Any, ...], value))


def _are_tolerances(value: Any) -> bool:
    if not isinstance(value, Mapping):
        return False
    given = cast(Mapping[Any, Any], value)
    return _are_names(tuple(given)) and all(_is_above_0(number, int | float) for number in given.values())
