"""The catalog of robots and of their scenarios by name.

Scenarios are listed by import path, not imported: a run loads its own, and no other robot's.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from handover.scenarios.experiment.experiment import Experiment


@dataclass(frozen=True)
class RobotSystem:
    """A published robot with its world.

    Attributes:
        title: what it is.
        paths: import paths of its scenarios' classes by the scenarios' names.
    """

    title: str
    paths: Mapping[str, str]

    @property
    def scenarios(self) -> tuple[type[Experiment[Any]], ...]:
        """Its scenarios' classes, imported."""
        return tuple(SCENARIOS[name] for name in self.paths)

    @property
    def units(self) -> tuple[str, ...]:
        """Names of the catalogued units in its scenarios, in order of first use."""
        return tuple(dict.fromkeys(unit for s in self.scenarios for unit in s.units.values()))


SYSTEMS = (
    RobotSystem(
        "Helix, a tendon-driven soft arm",
        {"helix_handover": "handover.scenarios.helix.helix_handover:HelixHandover"},
    ),
    RobotSystem(
        "VSL arm, with links of variable stiffness",
        {
            "vsl_model_based": "handover.scenarios.vsl.path_experiments:VslModelBased",
            "vsl_hybrid": "handover.scenarios.vsl.path_experiments:VslHybrid",
        },
    ),
    RobotSystem(
        "Free-flyer, in microgravity",
        {
            "flyer_impedance": "handover.scenarios.free_flyer.impedance:FlyerImpedance",
            "flyer_robot_to_human": "handover.scenarios.free_flyer.handovers:RobotToHuman",
            "flyer_human_to_robot": "handover.scenarios.free_flyer.handovers:HumanToRobot",
            "flyer_failed_reception": "handover.scenarios.free_flyer.handovers:FailedReception",
            "flyer_collaborative": "handover.scenarios.free_flyer.handovers:Collaborative",
        },
    ),
    RobotSystem(
        "IR grasp, a soft hand with infrared sensors",
        {"ir_grasp": "handover.scenarios.ir_grasp.ir_grasp:IrGrasp"},
    ),
)


class _Scenarios(Mapping[str, type[Experiment[Any]]]):
    """Scenarios by name, each imported on first access."""

    def __init__(self, paths: Mapping[str, str]) -> None:
        self._paths = paths

    def __getitem__(self, name: str) -> type[Experiment[Any]]:
        module, _, experiment = self._paths[name].partition(":")
        scenario: type[Experiment[Any]] = getattr(import_module(module), experiment)
        return scenario

    def __contains__(self, name: object) -> bool:
        return name in self._paths

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)


SCENARIOS: Mapping[str, type[Experiment[Any]]] = _Scenarios(
    {name: path for system in SYSTEMS for name, path in system.paths.items()}
)
