"""The catalog: robots, sensors and controllers that are available as FMUs.

It names the blocks' classes and does not import them, so that reading it loads no physics engine.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from importlib import import_module
from typing import Any

from handover.cosim.exceptions import nearest


class UnknownUnit(LookupError):
    """No unit has this name."""

    def __init__(self, name: str, valid: list[str]) -> None:
        super().__init__(f"there is no unit {name!r}; {nearest(name, valid)}")
        self.name, self.valid = name, valid


class UnknownBlock(LookupError):
    """There is no such block class; the message says what of its path is missing."""

    def __init__(self, path: str, fault: str) -> None:
        super().__init__(
            f"{path!r} is not the path of a block, such as 'handover.plants.helix.tendon_arm:TendonArm': {fault}"
        )
        self.path, self.fault = path, fault


@dataclass(frozen=True)
class Entry:
    """A unit of the catalog.

    Attributes:
        name: the FMU's name; letters, digits and underscores.
        block: path of the block's class.
        step: its default communication step, in seconds.
        summary: one line for lists.
        start: start values of parameters and inputs that differ from those that the block declares, by name: numbers,
            truth values, texts, lists for arrays, and of enumerations the number.
    """

    name: str
    block: str
    step: Fraction
    summary: str
    start: Mapping[str, Any] = field(default_factory=dict[str, Any])


_ENTRIES = (
    Entry(
        "TendonArm",
        "handover.plants.helix.tendon_arm:TendonArm",
        Fraction(1, 50),
        "tendon-driven soft arm with a gripper",
    ),
    Entry(
        "HandoverPartner",
        "handover.plants.helix.handover_partner:HandoverPartner",
        Fraction(1, 50),
        "hand that offers a ball",
    ),
    Entry(
        "StereoCamera", "handover.plants.helix.stereo_camera:StereoCamera", Fraction(1, 30), "pictures of two cameras"
    ),
    Entry(
        "HandoverVision",
        "handover.controllers.helix.handover_vision:HandoverVision",
        Fraction(1, 30),
        "finds ball and markers",
    ),
    Entry(
        "VisualServo",
        "handover.controllers.helix.visual_servo:VisualServo",
        Fraction(1, 2),
        "moves the arm by what vision sees",
    ),
    Entry(
        "VslArm",
        "handover.plants.vsl.arm:VslArm",
        Fraction(1, 50),
        "arm with links whose stiffness follows their pressure",
    ),
    Entry(
        "TrajectoryPlanner",
        "handover.controllers.vsl.trajectory_planner:TrajectoryPlanner",
        Fraction(1, 50),
        "lines, arcs and squares for a three-joint arm",
    ),
    Entry(
        "HybridKinematics",
        "handover.controllers.vsl.hybrid_kinematics:HybridKinematics",
        Fraction(1, 50),
        "rigid-link kinematics, corrected by what was learned",
    ),
    Entry(
        "FreeFlyer",
        "handover.plants.free_flyer.free_flyer:FreeFlyer",
        Fraction(2, 125),
        "free-flying robot with a fixed arm",
    ),
    Entry(
        "Thrusters",
        "handover.plants.free_flyer.thrusters:Thrusters",
        Fraction(2, 125),
        "its propulsion, with limits and lag",
    ),
    Entry("Push", "handover.plants.free_flyer.push:Push", Fraction(2, 125), "pulse of force and torque on a gripper"),
    Entry(
        "HandAndObject",
        "handover.plants.free_flyer.hand_and_object:HandAndObject",
        Fraction(2, 125),
        "hand that takes and gives an object in microgravity",
    ),
    Entry(
        "ImpedanceController",
        "handover.controllers.free_flyer.impedance_controller:ImpedanceController",
        Fraction(2, 125),
        "makes the gripper yield like a spring and damper",
    ),
    Entry(
        "PoseController",
        "handover.controllers.free_flyer.pose_controller:PoseController",
        Fraction(2, 125),
        "flies to a pose",
    ),
    Entry(
        "HandoverStateMachine",
        "handover.controllers.free_flyer.handover_state_machine:HandoverStateMachine",
        Fraction(2, 125),
        "decides when to fly, yield, signal, hold and let go",
    ),
    Entry(
        "GraspScene",
        "handover.plants.ir_grasp.scene:GraspScene",
        Fraction(3, 200),
        "soft hand, object, table, IR sensors",
    ),
    Entry(
        "IrReflex",
        "handover.controllers.ir_grasp.ir_reflex:IrReflex",
        Fraction(3, 200),
        "corrects a grasp by infrared reflexes",
    ),
)

UNITS: Mapping[str, Entry] = {entry.name: entry for entry in _ENTRIES}


def find_unit(name: str) -> Entry:
    """Return a unit's entry.

    Raises:
        UnknownUnit: there is no unit of this name.
    """
    if name not in UNITS:
        raise UnknownUnit(name, list(UNITS))
    return UNITS[name]


def import_block(path: str) -> type[Any]:
    """Return the class that a path such as `handover.plants.helix.tendon_arm:TendonArm` names.

    Raises:
        UnknownBlock: the module has no such class.
    """
    module, _, name = path.partition(":")
    block = getattr(import_module(module), name, None)
    if not isinstance(block, type):
        raise UnknownBlock(path, f"module {module!r} has no class {name!r}")
    return block
