"""The published experiments by name."""

from collections.abc import Mapping

from scenarios.published.published_experiment import PublishedExperiment

_ALL: tuple[type[PublishedExperiment], ...] = ()

EXPERIMENTS: Mapping[str, type[PublishedExperiment]] = {e.name: e for e in _ALL}
