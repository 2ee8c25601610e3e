"""Faults of a run's evaluation and presentation: each becomes a line, and never takes the run's end with it.

A unit may give outputs of which nobody thought: all zero, constant, NaN. What is made of them by scenarios (verdict,
figures, replay, pictures) may then raise anything. The run, its record and the rest of its report are kept.
"""

import os
import traceback
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic

import numpy as np

from handover.cosim.blocks.state import NotPlainData
from handover.cosim.exceptions import CosimError, one_line
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.experiment import AnyEvaluator, Evaluator, Experiment, Outcome
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.returned_types import WrongType

drawing = np.errstate(all="ignore")
"""Decorates what draws outputs: those beyond the numbers of a page are gaps in it, without numpy's warnings."""

_MAX_MESSAGE = 200  # characters


def fault_line(e: BaseException) -> str:
    """Return what was raised, and where, in one line: `ValueError: ... (replay.py, line 67)`."""
    frames = traceback.extract_tb(e.__traceback__)
    where = ([f for f in frames if _is_users(f)] or [f for f in frames if _is_ours(f)] or frames)[-1:]
    place = f" ({Path(where[0].filename).name}, line {where[0].lineno})" if where else ""
    message = one_line(e)
    if isinstance(e, WrongType):  # names the method where no line of the user's is on the way
        return f"{message}{place if any(map(_is_users, frames)) else ''}"
    if len(message) > _MAX_MESSAGE:  # of libraries such as Qhull: a page of advice
        message = f"{message[:_MAX_MESSAGE]}..."
    name = type(e).__name__
    return f"{name}{place}" if message == name else f"{name}: {message}{place}"


_OURS = tuple(
    f"{Path(__file__).parents[3] / part}{os.sep}" for part in ("controllers", "cosim", "fmus", "plants", "scenarios")
)
"""Folders of this package."""


def _is_ours(frame: traceback.FrameSummary) -> bool:
    return frame.filename.startswith(_OURS)


def _is_users(frame: traceback.FrameSummary) -> bool:
    """Return whether a frame is of a scenario that is neither this package's nor installed."""
    parts = Path(frame.filename).parts
    is_installed = {"site-packages", "dist-packages"} & set(parts) or frame.filename.startswith((_STANDARD, "<"))
    return not is_installed and not _is_ours(frame)


_STANDARD = str(Path(traceback.__file__).parent)
"""The folder of the standard library."""


class ScenarioFailed(ValueError):
    """The code of a scenario that is not this package's raised something before the run began."""


@contextmanager
def scenario_code(experiment: Experiment[Any]) -> Generator[None, None, None]:
    """Let a block call a scenario that is to set up a run.

    Raises:
        ScenarioFailed: it is not this package's, and raised what it is not to raise; the message says where.
    """
    try:
        yield
    except (CosimError, OSError, InvalidParameter):
        raise
    except Exception as e:  # anybody's code may raise anything
        if type(experiment).__module__.partition(".")[0] == __name__.partition(".")[0]:
            raise
        raise ScenarioFailed(f"the scenario {experiment.name} failed as it was set up: {fault_line(e)}") from e


class EvaluatorNotSaved(CosimError):
    """An evaluator holds what no checkpoint can keep."""

    def __init__(self, evaluator: Evaluator, reason: NotPlainData) -> None:
        kind = type(evaluator)
        super().__init__(
            f"what {kind.__module__}:{kind.__qualname__} has seen cannot be kept in a checkpoint: {reason}; "
            "dataclasses, named tuples and enumerations too, if its `records` names them"
        )


class ToleratedFaults:
    """Collects what failed, a line each, in `lines`.

    Args:
        passing: exceptions that are raised nevertheless, besides those of the disk and of the engine.
    """

    def __init__(self, *passing: type[Exception]) -> None:
        self.lines: list[str] = []
        self._passing: tuple[type[BaseException], ...] = (OSError, CosimError, *passing)

    @contextmanager
    def tolerated(self, what: str) -> Generator[None, None, None]:
        """Take an exception as a line that begins with `what`, as in "the replay could not be drawn"."""
        try:
            yield
        except self._passing:
            raise
        except Exception as e:  # scenarios draw what they like, of outputs that may be anything
            self.lines.append(f"{what}: {fault_line(e)}")


class GuardedEvaluator(Evaluator, Generic[AnyEvaluator]):
    """Follows a run by a scenario's evaluator until that fails; the run then goes on and is not judged.

    Failures of units and of the disk, which an evaluator may meet as it reads signals, are raised as ever.

    Attributes:
        evaluator: the scenario's.
        fault: how it failed; "" if it did not.
    """

    def __init__(self, evaluator: AnyEvaluator) -> None:
        self.evaluator = evaluator
        self.fault = ""
        self._t = 0.0

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Let the evaluator know the units, unless it has failed."""
        with self._guarded("the evaluation failed before the run began"):
            self.evaluator.note_units(units)

    def __call__(self, t: float, signals: Signals) -> None:
        """Let the evaluator see the signals at time t, unless it has failed."""
        self._t = t
        with self._guarded(f"the evaluation failed at t = {t:.6g} s"):
            if not self.fault:
                self.evaluator.note_pushes(t, signals)
                self.evaluator(t, signals)

    @property
    def over(self) -> bool:
        """Whether the task has ended; never, once the evaluator has failed."""
        with self._guarded(f"the evaluation failed at t = {self._t:.6g} s"):
            return not self.fault and self.evaluator.over
        return False

    def finish(self, signals: Signals) -> None:
        """Let the evaluator see the signals at the end of the run, unless it has failed."""
        with self._guarded(f"the evaluation failed at its end, t = {self._t:.6g} s"):
            if not self.fault:
                self.evaluator.finish(signals)

    def note_end(self, unit: str, t: float) -> None:
        """Let the evaluator know that a unit has ended the simulation at t, unless it has failed."""
        with self._guarded(f"the evaluation failed at its end, t = {t:.6g} s"):
            if not self.fault:
                self.evaluator.note_end(unit, t)

    def packed(self) -> bytes:
        """Return the evaluator's state.

        Raises:
            EvaluatorNotSaved: it has attributes that no checkpoint can keep.
        """
        try:
            return self.evaluator.get_state()
        except NotPlainData as e:
            raise EvaluatorNotSaved(self.evaluator, e) from e

    def pictures(self) -> Sequence[CameraPicture]:
        """Return what cameras saw until now; an evaluator that failed may still have some.

        Raises:
            Exception: whatever the evaluator raises.
        """
        return self.evaluator.pictures()

    def outcome(self) -> Outcome:
        """Return the evaluator's verdict, or that there is none."""
        with self._guarded("the verdict failed"):
            if not self.fault:
                outcome = self.evaluator.outcome()
                return replace(outcome, reason=outcome.reason + self.evaluator.pushed_by_hand)
        return Outcome(success=False, reason=f"not judged: {self.fault}")

    @contextmanager
    def _guarded(self, what: str) -> Generator[None, None, None]:
        faults = ToleratedFaults()
        with faults.tolerated(what):
            yield
        self.fault = self.fault or "".join(faults.lines)
