"""The scenarios that can be run by name."""

from typing import Any

from scenarios.experiment import Experiment
from scenarios.helix_handover.helix_handover import HelixHandover

SCENARIOS: dict[str, type[Experiment[Any]]] = {e.name: e for e in (HelixHandover,)}
