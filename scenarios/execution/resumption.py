"""What a run keeps in its checkpoints besides the units' states, so that another process can resume it."""

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import one_line
from handover.cosim.master.checkpoint import Checkpoint, InvalidCheckpoint, read_checkpoint
from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.experiment.experiment import Evaluator
from handover.scenarios.results.summary import ElapsedTime


@dataclass(frozen=True, kw_only=True)
class Resumption:
    """What a run is resumed from: its checkpoint, and what `pack` put into it."""

    checkpoint: Checkpoint
    evaluator: Evaluator
    parameters: Any
    options: MasterOptions
    spent: ElapsedTime


def pack(evaluator: Evaluator, parameters: Any, options: MasterOptions, spent: ElapsedTime) -> bytes:
    """Return what a checkpoint keeps besides the units' states."""
    return pickle.dumps((evaluator, parameters, options, spent))


def unpack(path: Path) -> Resumption:
    """Read a run's checkpoint. Python objects are unpickled: it must be from someone whom one trusts.

    Raises:
        InvalidCheckpoint: there is none, or it cannot be used.
    """
    checkpoint = read_checkpoint(path)
    try:
        evaluator, parameters, options, spent = pickle.loads(checkpoint.kept)
    except Exception as e:  # unpickling raises what it likes
        raise InvalidCheckpoint(path, f"what it keeps of the scenario cannot be read: {one_line(e)}") from e
    return Resumption(checkpoint=checkpoint, evaluator=evaluator, parameters=parameters, options=options, spent=spent)
