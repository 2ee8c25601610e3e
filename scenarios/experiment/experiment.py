"""What a scenario is: parameters, a system of units, an evaluator of its runs, figures.

Scenarios subclass `Experiment`. The engine runs the `System` that it builds, its `Evaluator` sees each communication
point, and reports are made of what `time_figures`, `draw`, `replay` and `published` return.
"""

import abc
import enum
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from fractions import Fraction
from functools import wraps
from inspect import getattr_static
from pathlib import Path
from types import FunctionType
from typing import Any, ClassVar, Generic, TypeVar, cast

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.declarations import declared_variables
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import is_written_unit
from handover.cosim.blocks.variable import Causality, Variable
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit, System
from handover.scenarios.experiment.exposed import carry, check_exposed, notes_on_exposed, with_exposed
from handover.scenarios.experiment.live_inputs import HandHint, LedHand, Pushable
from handover.scenarios.experiment.needs import needs_of
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.places import Place, fit_places, presume_steps_of_places, sample_in_places
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.returned_types import (
    FILES,
    FLAG,
    NAMES,
    SECONDS,
    Checked,
    Expected,
    WrongType,
    check_methods,
    described,
    instance_of,
    mapping_to,
    sequence_of,
)
from handover.scenarios.experiment.time_plot import TimeFigure, TimePlot

FmuOf = Callable[[str], Path]
"""Returns the path of a unit's FMU by the unit's name in the system."""


@dataclass(frozen=True)
class Metric(Checked):
    """A metric in a run's summary."""

    value: float
    unit: str = "1"
    description: str = ""


@dataclass(frozen=True, kw_only=True)
class Outcome(Checked):
    """How a task ended: whether it succeeded, why (in a sentence), and its metrics."""

    success: bool
    reason: str
    metrics: Mapping[str, Metric] = field(default_factory=dict[str, Metric])

    expected = {
        "reason": instance_of(str, '"the tip is 3 mm from the goal"'),
        "metrics": mapping_to(Metric, '{"distance": Metric(0.004, "m")}'),
    }


class Evaluator(abc.ABC):
    """Follows one run as the experimenter does, by ground truth: decides when the task is over and how it went.

    A checkpoint keeps its attributes, which are plain data (see `handover.cosim.blocks.state`), the scenario's
    parameters, wherever they stand, or of the types in `records`. `parameters` itself is left out: an evaluator of the
    same parameters takes the others over.
    """

    records: ClassVar[tuple[type[Any], ...]] = ()
    """Dataclasses, named tuples and enumerations of which its attributes are made, besides plain data."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        check_methods(cls, Evaluator, _OF_EVALUATORS)

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:  # noqa: B027 (most tasks are judged by the signals alone)
        """Take in, before a run begins or is resumed, which units are there and what they are set to, by name.

        Another unit may stand in the place of one of the scenario's, or none; of a record nobody knows.
        """

    @abc.abstractmethod
    def __call__(self, t: float, signals: Signals) -> None:
        """Take in the signals at time t."""

    @property
    @abc.abstractmethod
    def over(self) -> bool:
        """Whether the task has ended, well or not."""

    def finish(self, signals: Signals) -> None:  # noqa: B027 (many evaluators need nothing of it)
        """Take in the signals at the end of the run, however it ended."""

    def note_end(self, unit: str, t: float) -> None:  # noqa: B027 (most tasks are judged by the signals alone)
        """Take in that a unit has ended the simulation at t, as is its right; its signals there were seen before."""

    def pictures(self) -> Sequence[CameraPicture]:
        """Return what cameras saw at the run's key moments, in chronological order; none by default."""
        return ()

    @abc.abstractmethod
    def outcome(self) -> Outcome:
        """Return the verdict on what was seen so far."""

    def get_state(self) -> bytes:
        """Return what it has seen: after `set_state` with it, another evaluator continues in the same way.

        Raises:
            NotPlainData: an attribute is neither plain data, nor the scenario's parameters, nor one of `records`.
        """
        return pack_state({n: value for n, value in vars(self).items() if n not in _NOT_KEPT}, self._all_records)

    def set_state(self, state: bytes) -> None:
        """Take over what another evaluator of the same parameters has seen.

        Raises:
            InvalidState: it is not the state of such an evaluator; nothing is changed.
        """
        attributes = unpack_state(state, self._all_records)
        if not isinstance(attributes, dict) or {*_NOT_KEPT, *attributes} != {*_NOT_KEPT, *vars(self)}:
            raise InvalidState(f"it is not the state of a {type(self).__name__}")
        vars(self).update(cast(dict[str, Any], attributes))

    def bind(self, parameters: Any, pushes: Sequence[Pushable] = ()) -> None:
        """Let states hold the scenario's parameters, and their enumerations, wherever they stand in it.

        Pushes by hand on these bodies are followed by `note_pushes`.
        """
        values = [getattr(parameters, f.name) for f in fields(parameters)] if is_dataclass(parameters) else []
        vars(self)[_BOUND] = (type(parameters), *dict.fromkeys(type(v) for v in values if isinstance(v, enum.Enum)))
        vars(self)[_PUSHES] = {push.labels[0]: f"{push.unit}.{push.force}" for push in pushes}
        vars(self)[_PUSHED] = {}

    def note_pushes(self, t: float, signals: Signals) -> None:
        """Keep when, s, and how hard at most, N, somebody has pushed each body by hand; see `Experiment.pushes`."""
        for body, name in vars(self).get(_PUSHES, {}).items():
            if name in signals and (force := math.hypot(*signals.plain(name))) > 0.0:
                _, greatest = vars(self)[_PUSHED].get(body, (t, 0.0))
                vars(self)[_PUSHED][body] = (t, max(greatest, force))

    @property
    def pushed_by_hand(self) -> str:
        """Which bodies somebody has pushed by hand, and how hard, as the end of a sentence; "" if nobody has."""
        pushed: Mapping[str, tuple[float, float]] = vars(self).get(_PUSHED, {})
        which = [f"the {body} by hand, with up to {force:.1f} N" for body, (_, force) in pushed.items()]
        return f"; besides, somebody pushed {' and '.join(which)}" if which else ""

    @property
    def last_pushed(self) -> float:
        """When somebody last pushed a body by hand, s; minus infinity if nobody has."""
        pushed: Mapping[str, tuple[float, float]] = vars(self).get(_PUSHED, {})
        return max((t for t, _ in pushed.values()), default=-math.inf)

    @property
    def _all_records(self) -> tuple[type[Any], ...]:
        """Its own records, which come first where names are the same, and those that `bind` found."""
        own = {kind.__name__: kind for kind in (*vars(self).get(_BOUND, ()), *self.records)}
        return tuple(own.values())


_OF_EVALUATORS: Mapping[str, Expected] = {
    "over": FLAG,
    "outcome": Expected(
        "an Outcome whose metrics have units as FMI writes them",
        'Outcome(success=True, reason="the tip is at the goal", metrics={"speed": Metric(0.2, "m/s")})',
        lambda v: isinstance(v, Outcome) and not _strange_units(v),
        lambda v: f"an Outcome with {_strange_units(v)}" if isinstance(v, Outcome) else described(v),
    ),
    "pictures": sequence_of(CameraPicture, "[CameraPicture(...)]"),
}
"""What its methods must return."""


def _strange_units(outcome: Outcome) -> str:
    return ", ".join(f"{n} in {m.unit!r}" for n, m in outcome.metrics.items() if not is_written_unit(m.unit))


_BOUND, _PUSHES, _PUSHED = "_bound", "_pushes", "_pushed_bodies"
_NOT_KEPT = ("parameters", _BOUND, _PUSHES)


AnyEvaluator = TypeVar("AnyEvaluator", bound=Evaluator)


@dataclass(frozen=True, kw_only=True)
class NoParameters:
    """The parameters of an experiment that has none."""


class Experiment(abc.ABC, Generic[AnyEvaluator]):
    """A scenario. Subclasses declare its parameters and units, wire its system and evaluate its runs.

    A subclass has to have `units`, `build`, `stop_time` and `evaluator`; the rest has defaults, and a section of the
    report whose method is not overridden is left out.
    """

    name: ClassVar[str]
    """Its name in lists, results and reports: lower case, with underscores. By default, the class's, so written."""
    title: ClassVar[str]
    """One line that says what happens in it, for lists and reports. By default, the docstring's first line."""
    parameters_type: ClassVar[type[Any]] = NoParameters
    """A dataclass of declared parameters, which `build`, `stop_time` and `evaluator` get as an instance."""
    units: ClassVar[Mapping[str, str]]
    """The unit behind each of the system's units, by name in the system: a name in the catalog, or the path of a block
    as `my_module:MyBlock`."""
    places: ClassVar[Mapping[str, Place]] = {}
    """What a unit must have to take the place of one of `units`, by the same names. A unit in a place that is not here
    must have all that `build` wires and sets."""
    headline: ClassVar[tuple[str, ...]] = ()
    """Names of the metrics that summaries list first, in this order; a run need not have all of them. By default, those
    of the evaluator's outcome."""
    unit_files: ClassVar[tuple[str, ...]] = ()
    """Values of units' parameters, as `UNIT.NAME`, that name files which these read."""
    start: ClassVar[Fraction] = Fraction(0)
    """When a run starts, s; that of a scenario at 0 s."""
    is_seeded: ClassVar[bool] = True
    """Whether it draws random numbers, which follow from the seed."""
    parallel_step: ClassVar[Fraction | None] = None
    """Communication step, s, of all units where they step in parallel (Jacobi): each then hands on its results a step
    late, with which the loop must be stable. None: stable with the steps that the units propose. One that follows from
    parameters: `step_in_parallel`."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        check_methods(cls, Experiment, _OF_SCENARIOS)
        if isinstance(build := vars(cls).get("build"), FunctionType):
            type.__setattr__(cls, "build", _carrying(build))
        needs_of(cls.parameters_type)
        check_exposed(cls.parameters_type, getattr(cls, "units", ()))
        cls.places = with_exposed(cls.places, cls.parameters_type)
        if "name" not in vars(cls):
            cls.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", cls.__name__).lower()
        if "title" not in vars(cls) and vars(cls).get("__doc__"):
            cls.title = str(cls.__doc__).strip().partition("\n")[0].rstrip(".")
        elif not hasattr(cls, "title"):
            cls.title = cls.name.replace("_", " ")

    @classmethod
    def parameters(cls) -> tuple[Variable, ...]:
        """Return the declared parameters."""
        return declared_variables(cls.parameters_type, Causality.PARAMETER)

    @abc.abstractmethod
    def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Wire the units into a system; the wiring is that of the scenario's own units, see `wire`."""

    def wire(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Return the system that `build` wires, without what units in its places do not have and need not have.

        Raises:
            InvalidFmu: a file is not a valid co-simulation FMU.
        """
        system = self.build(parameters, seed, fmu)
        presume_steps_of_places(system, self.units)
        sample_in_places(system, self.units)
        path = f"{type(self).__module__}:{type(self).__qualname__}"
        fit_places(system, self.places, self.units, self.name if path.startswith("handover.") else path)
        system.notes += notes_on_exposed(parameters, system)
        return system

    def check_unit_values(self, system: System, given: Sequence[str]) -> None:
        """Reject values of units' parameters that their units take and the scenario can do nothing with.

        Args:
            system: as it is wired, with the values set.
            given: names of the parameters that were set, as `UNIT.NAME`.

        Raises:
            InvalidParameter: with what is wrong, and what would be right.
        """

    @abc.abstractmethod
    def stop_time(self, parameters: Any) -> Fraction:
        """Return the time at which a run ends at the latest, in seconds."""

    @abc.abstractmethod
    def evaluator(self, parameters: Any) -> AnyEvaluator:
        """Return the evaluator of one run."""

    def bound_evaluator(self, parameters: Any) -> AnyEvaluator:
        """Return the evaluator of one run, whose states may hold the parameters.

        Raises:
            WrongType: its `over` is a method, which is true before anything has happened.
        """
        evaluator = self.evaluator(parameters)
        if isinstance(over := getattr_static(evaluator, "over"), FunctionType):
            example = "@property in the line above def over(self) -> bool"
            raise WrongType(f"{type(evaluator).__name__}.over is", described(over), "a property", example)
        evaluator.bind(parameters, self.pushes(parameters))
        return evaluator

    def step_in_parallel(self, parameters: Any) -> Fraction | None:  # noqa: ARG002
        """Return the communication step, s, of all units where they step in parallel; by default `parallel_step`."""
        return self.parallel_step

    def recorded_metrics(self, signals: Path) -> Mapping[str, Metric]:  # noqa: ARG002
        """Return metrics of a run's record, besides those of the evaluator's outcome; none by default."""
        return {}

    def evaluator_of_record(self, parameters: Any, pictures: Sequence[CameraPicture]) -> AnyEvaluator:  # noqa: ARG002
        """Return an evaluator to which a finished run is replayed from its record.

        A record holds no camera pictures: those that the run's folder keeps are given.
        """
        return self.evaluator(parameters)

    def parameter_files(self, parameters: Any) -> Mapping[str, Path]:  # noqa: ARG002
        """Return the files that a run reads, by the parameters that name them; none by default.

        Runs and campaigns keep their hashes, and tell or refuse where another file is there under the same name.
        """
        return {}

    def files_read(self, parameters: Any, unit_values: Mapping[str, str]) -> dict[str, Path]:
        """Return the files of `parameter_files`, and those that given values of `unit_files` name."""
        given = {name: Path(unit_values[name]) for name in self.unit_files if unit_values.get(name)}
        return {**self.parameter_files(parameters), **given}

    def led_hand(self, parameters: Any) -> LedHand | None:  # noqa: ARG002
        """Return the hand that somebody outside leads; by default there is none.

        Its inputs are declared in `build` by `System.external`.
        """
        return None

    def hand_hint(self, parameters: Any, record: Record) -> HandHint | None:  # noqa: ARG002
        """Return what helps who leads that hand in the last row of a record; by default nothing does."""
        return None

    def cycle(self) -> tuple[str, ...]:
        """Return the units of one control cycle, whose CPU time per cycle is a metric; none by default."""
        return ()

    def time_figures(self, parameters: Any, record: Record) -> Sequence[TimeFigure]:  # noqa: ARG002
        """Return the figures over time, for the report and for papers; none by default.

        Raises:
            KeyError: the record has no signal that is to be drawn.
        """
        return ()

    def plots(self, parameters: Any, record: Record) -> Sequence[TimePlot]:
        """Return the plots of all time figures, as the report draws them.

        Raises:
            KeyError: the record has no signal that is to be drawn.
        """
        return [plot for figure in self.time_figures(parameters, record) for plot in figure.plots]

    def draw(self, parameters: Any, evaluator: AnyEvaluator, record: Record, folder: Path) -> Sequence["Figure"]:  # noqa: ARG002
        """Draw figures into a folder that are not curves over time, such as the scene; none by default."""
        return ()

    def replay(self, parameters: Any, record: Record) -> Replay | None:  # noqa: ARG002
        """Return the scene that the report animates; none by default."""
        return None

    def pushes(self, parameters: Any) -> Sequence[Pushable]:  # noqa: ARG002
        """Return the bodies that a person may push in a live page; none by default."""
        return ()

    def published(self, parameters: Any) -> Sequence[PublishedValue]:  # noqa: ARG002
        """Return what the paper published of runs with such parameters; nothing by default."""
        return ()


def _carrying(build: Callable[..., System]) -> Callable[..., System]:
    """Let `build` return a system whose units have the values of exposed parameters."""

    @wraps(build)
    def carried(self: Any, parameters: Any, *args: Any, **given: Any) -> System:
        return carry(parameters, build(self, parameters, *args, **given))

    return carried


def _is_step(value: object) -> bool:
    return value is None or isinstance(value, Fraction)


def _are_time_figures(value: Any) -> bool:
    return _TIME_FIGURES.fits(value) and len({figure.name for figure in value}) == len(value)


@dataclass(frozen=True)
class Figure(Checked):
    """A figure of a run: file name within the figures folder, without suffix, and caption."""

    name: str
    caption: str


_TIME_FIGURES = sequence_of(TimeFigure, "[TimeFigure(...)]")
_OF_SCENARIOS: Mapping[str, Expected] = {
    "build": instance_of(System, "the s = System() whose units it adds and connects"),
    "stop_time": SECONDS,
    "evaluator": instance_of(Evaluator, "ReachEvaluator(parameters), of a subclass of Evaluator"),
    "step_in_parallel": Expected("a Fraction of a second or None", "Fraction(1, 500)", _is_step),
    "parameter_files": FILES,
    "led_hand": instance_of(LedHand, 'LedHand("person", (0.0, 0.3, 0.4), 0.5)', optional=True),
    "cycle": NAMES,
    "time_figures": Expected(
        "a list or tuple of TimeFigure, each with a name of its own",
        '[TimeFigure(name="distance", caption="From the tip to the goal.", plots=[TimePlot(...)])]',
        _are_time_figures,
    ),
    "draw": sequence_of(Figure, '[Figure("scene", "The arm at its goal.")]'),
    "replay": instance_of(Replay, "Replay(lines=[Line(...)])", optional=True),
    "pushes": sequence_of(Pushable, "[Pushable(...)]"),
    "published": sequence_of(PublishedValue, "[PublishedValue(...)]"),
}
"""What the methods of a scenario must return."""
