"""What is to be run.

How a run ended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import UnitFailure
from handover.cosim.stepping.options import MasterOptions
from handover.scenarios.experiment.experiment import Experiment, Outcome
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import Summary


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


@dataclass(frozen=True, kw_only=True)
class Ended:
    """A run after its end. `failure` is set when a unit failed; the record then ends there."""

    outcome: Outcome
    summary: Summary
    failure: UnitFailure | None = None
