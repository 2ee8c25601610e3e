"""What is to be run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.results.run_folder import RunFolder


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run before it begins.

    Attributes:
        experiment, parameters, seed: the scenario and what was chosen of it.
        fmus: the FMU of each unit.
        folder: for what it leaves.
        formats: further forms of the record, see `RECORD_FORMATS`.
        every: simulated seconds from checkpoint to checkpoint, if there are to be any.
        source: what `resume` needs to find the experiment again, if it is not one of the catalog.
        options: how its units are run.
        presented: whether figures are drawn and a report is written at the end.
    """

    experiment: Experiment[Any]
    parameters: Any
    seed: int
    fmus: Mapping[str, Path]
    folder: RunFolder
    formats: Sequence[str] = ()
    every: Fraction | None = None
    source: Mapping[str, Any] = field(default_factory=dict[str, Any])
    options: MasterOptions = field(default_factory=MasterOptions)
    presented: bool = True
