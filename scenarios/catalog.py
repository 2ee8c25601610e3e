"""The robots whose experiments can be run, and the scenarios by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from handover.scenarios.experiment import Experiment
from handover.scenarios.free_flyer.collaborative import Collaborative
from handover.scenarios.free_flyer.failed_reception import FailedReception
from handover.scenarios.free_flyer.flyer_impedance import FlyerImpedance
from handover.scenarios.free_flyer.human_to_robot import HumanToRobot
from handover.scenarios.free_flyer.robot_to_human import RobotToHuman
from handover.scenarios.helix_handover.helix_handover import HelixHandover
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.vsl.vsl_hybrid import VslHybrid
from handover.scenarios.vsl.vsl_model_based import VslModelBased


@dataclass(frozen=True)
class RobotSystem:
    """A published robot with its world: what it is, and the scenarios that it is in."""

    title: str
    scenarios: tuple[type[Experiment[Any]], ...]

    @property
    def units(self) -> tuple[str, ...]:
        """Names of the catalogued units that its scenarios are made of, in their order."""
        return tuple(dict.fromkeys(unit for s in self.scenarios for unit in s.units.values()))


SYSTEMS = (
    RobotSystem("Helix, a tendon-driven soft arm", (HelixHandover,)),
    RobotSystem("VSL arm, with links of variable stiffness", (VslModelBased, VslHybrid)),
    RobotSystem(
        "Free-flyer, in microgravity",
        (FlyerImpedance, RobotToHuman, HumanToRobot, FailedReception, Collaborative),
    ),
    RobotSystem("IR grasp, a soft hand with infrared sensors", (IrGrasp,)),
)

SCENARIOS: Mapping[str, type[Experiment[Any]]] = {e.name: e for system in SYSTEMS for e in system.scenarios}
