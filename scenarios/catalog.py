"""The scenarios that can be run by name."""

from scenarios.experiment import Experiment
from scenarios.helix_handover.helix_handover import HelixHandover

SCENARIOS: dict[str, type[Experiment]] = {e.name: e for e in (HelixHandover,)}
