"""What a scenario is: parameters, a system of units, a verdict, figures."""

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from handover.cosim.blocks.declarations import declared_variables
from handover.cosim.blocks.variable import Causality, Variable
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure, TimePlot

FmuOf = Callable[[str], Path]
"""Gives a unit's FMU by the unit's name in the system."""


@dataclass(frozen=True)
class Metric:
    """A figure of a run's summary."""

    value: float
    unit: str = "1"
    description: str = ""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a task ended: whether it succeeded, in a sentence why, and its figures."""

    success: bool
    reason: str
    metrics: Mapping[str, Metric] = field(default_factory=dict[str, Metric])


class Evaluator(abc.ABC):
    """Follows one run as the experimenter does, who sees everything: says when it is over and how it went."""

    @abc.abstractmethod
    def __call__(self, t: float, signals: Signals) -> None:
        """Look at the signals at time t."""

    @property
    @abc.abstractmethod
    def over(self) -> bool:
        """Whether the task has ended, well or not."""

    def finish(self, signals: Signals) -> None:  # noqa: B027 (many watches need nothing of it)
        """Look at the signals once more when the run has ended, however it did."""

    def pictures(self) -> Sequence[CameraPicture]:
        """Return what cameras saw at moments that tell of the run, in the order of time; none by default."""
        return ()

    @abc.abstractmethod
    def outcome(self) -> Outcome:
        """Return the verdict on what was seen so far."""


AnyEvaluator = TypeVar("AnyEvaluator", bound=Evaluator)


class Experiment(abc.ABC, Generic[AnyEvaluator]):
    """A scenario. Subclasses name it, declare its parameters, wire its system and judge its runs."""

    name: ClassVar[str]
    title: ClassVar[str]
    parameters_type: ClassVar[type[Any]]
    units: ClassVar[Mapping[str, str]]
    """The catalogued unit behind each of the system's units, by name in the system."""
    headline: ClassVar[tuple[str, ...]]
    """Names of the metrics that are told first, in their order; a run need not have all of them."""
    is_seeded: ClassVar[bool] = True
    """Whether its random numbers follow from a seed."""

    @classmethod
    def parameters(cls) -> tuple[Variable, ...]:
        """Return the declared parameters."""
        return declared_variables(cls.parameters_type, Causality.PARAMETER)

    @abc.abstractmethod
    def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:
        """Wire the units into a system."""

    @abc.abstractmethod
    def stop_time(self, parameters: Any) -> Fraction:
        """Return the time at which a run ends at the latest, in seconds."""

    @abc.abstractmethod
    def evaluator(self, parameters: Any) -> AnyEvaluator:
        """Return an observer of one run."""

    def evaluator_of_record(self, parameters: Any, pictures: Sequence[CameraPicture]) -> AnyEvaluator:  # noqa: ARG002
        """Return an observer of a run that is seen again by its record, and by the pictures that its folder keeps."""
        return self.evaluator(parameters)

    @abc.abstractmethod
    def cycle(self) -> tuple[str, ...]:
        """Return the units that make up one control cycle, whose CPU time the summary tells."""

    def time_figures(self, parameters: Any, record: Record) -> Sequence[TimeFigure]:  # noqa: ARG002
        """Return what is drawn over time, by the report before all other signals, and for papers; nothing by default.

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
        """Draw into a folder what is no curve over time, such as the scene; nothing by default."""
        return ()

    def replay(self, parameters: Any, record: Record) -> Replay | None:  # noqa: ARG002
        """Return what the report shows in space; nothing by default."""
        return None

    def published(self, parameters: Any) -> Sequence[PublishedValue]:  # noqa: ARG002
        """Return what the paper tells of runs with such parameters; nothing by default."""
        return ()


@dataclass(frozen=True)
class Figure:
    """A figure of a run: file name within the figures folder, without suffix, and caption."""

    name: str
    caption: str
