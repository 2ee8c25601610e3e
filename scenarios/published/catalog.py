"""The published experiments by name."""

from collections.abc import Mapping

from handover.scenarios.published.helix_1 import Helix1
from handover.scenarios.published.ir_table import IrTable
from handover.scenarios.published.published_experiment import PublishedExperiment

_ALL: tuple[type[PublishedExperiment], ...] = (Helix1, IrTable)

EXPERIMENTS: Mapping[str, type[PublishedExperiment]] = {e.name: e for e in _ALL}
