"""How a run ended."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from handover.cosim.exceptions import UnitFailure
from handover.scenarios.experiment.experiment import Outcome


@dataclass(frozen=True, kw_only=True)
class Ended:
    """A run after its end. `failure` is set when a unit failed; the record then ends there."""

    outcome: Outcome
    summary: Mapping[str, Any]
    failure: UnitFailure | None = None
