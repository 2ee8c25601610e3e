"""What a run keeps in its checkpoints besides the units' states, so that another process can resume it: plain data."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.exceptions import one_line
from handover.cosim.master.checkpoint import Checkpoint, InvalidCheckpoint, read_checkpoint
from handover.cosim.stepping.options import OPTION_RECORDS, MasterOptions
from handover.scenarios.experiment.experiment import Evaluator, Experiment
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters, text_of
from handover.scenarios.runs.results.summary import ElapsedTime
from handover.scenarios.runs.results.task import Task


@dataclass(frozen=True, kw_only=True)
class _Kept:
    """What the checkpoint holds of the run.

    Attributes:
        evaluator: the evaluator's state.
        run: the digest of the run, see `run_digest`.
        parameters: the text of each of the scenario's parameters.
        options: of the master.
        spent: seconds so far.
    """

    evaluator: bytes
    run: str
    parameters: Mapping[str, str]
    options: MasterOptions
    spent: ElapsedTime

    def __post_init__(self) -> None:
        parts = zip((self.parameters, self.options, self.spent), (dict, MasterOptions, ElapsedTime), strict=True)
        if not all(isinstance(part, kind) for part, kind in parts):
            raise TypeError("parameters, options or times are missing")
        if not math.isfinite(self.spent.wall + self.spent.cpu):
            raise ValueError("its times are no finite numbers")


RECORDS = (_Kept, ElapsedTime, *OPTION_RECORDS)
"""Types of which `pack` makes what it keeps."""


class Resumption:
    """What a run is resumed from: its checkpoint, and what `pack` put into it.

    Attributes:
        checkpoint: the states of the units and of the master.
        options: of the master.
        spent: seconds that the run has taken so far.

    Raises:
        InvalidCheckpoint: there is none, or it cannot be used.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.checkpoint: Checkpoint = read_checkpoint(path)
        try:
            kept = unpack_state(self.checkpoint.kept, RECORDS)
        except InvalidState as e:
            raise self._unusable(e) from e
        if not isinstance(kept, _Kept):
            raise self._unusable(InvalidState())
        self._kept = kept
        self.options, self.spent = kept.options, kept.spent

    def check_run(self, task: Task) -> None:
        """Check that the checkpoint is of a task's run.

        Raises:
            InvalidCheckpoint: it is of a run with another seed, other parameters, or from another file.
        """
        if run_digest(task) != self._kept.run:
            fault = "it is of another run: its parameters, its seed or its file are not those of the run.json beside it"
            raise InvalidCheckpoint(self._path, fault)

    def parameters(self, experiment: type[Experiment[Any]]) -> Any:
        """Return the parameters of the run's scenario.

        Raises:
            InvalidCheckpoint: they are not those of the scenario.
        """
        texts = self._kept.parameters
        try:
            if {v.name for v in experiment.parameters()} != set(texts):
                raise InvalidParameter([f"the parameters of {experiment.name} are others than {', '.join(texts)}"])
            return parse_parameters(experiment, [f"{name}={text}" for name, text in texts.items()])
        except InvalidParameter as e:
            raise self._unusable(e) from e

    def evaluator(self, experiment: Experiment[Any], parameters: Any) -> Evaluator:
        """Return an evaluator of the run that has seen what the run's evaluator had.

        Raises:
            InvalidCheckpoint: it is that of another scenario.
        """
        evaluator: Evaluator = experiment.bound_evaluator(parameters)
        try:
            evaluator.set_state(self._kept.evaluator)
        except InvalidState as e:
            raise self._unusable(e) from e
        return evaluator

    def _unusable(self, error: Exception) -> InvalidCheckpoint:
        return InvalidCheckpoint(self._path, f"what it keeps of the scenario cannot be read: {one_line(error)}")


def pack(task: Task, evaluator: bytes, spent: ElapsedTime) -> bytes:
    """Return what a checkpoint keeps besides the units' states; of the evaluator, its state."""
    run, texts = run_digest(task), _texts(task)
    kept = _Kept(evaluator=evaluator, run=run, parameters=texts, options=task.options, spent=spent)
    return pack_state(kept, RECORDS)


def run_digest(task: Task) -> str:
    """Return the SHA-256 of what tells runs apart that have the same units: parameters, seed and source."""
    seed = task.seed if task.experiment.is_seeded else None
    content = json.dumps([_texts(task), seed, {**task.unit_values}, {**task.source}], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


def _texts(task: Task) -> dict[str, str]:
    return {v.name: text_of(v, getattr(task.parameters, v.name)) for v in task.experiment.parameters()}
