"""The catalog: robots, sensors and controllers that are available as FMUs, and blocks of other packages and modules.

It names the blocks' classes and does not import them, so that reading it loads no physics engine. A package adds units
by entry points of the group `handover.units`; any other block is named by its path, such as `my_arm:MyArm`.
"""

import functools
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from handover.cosim.blocks.declarations import DeclarationError
from handover.cosim.blocks.description import describe
from handover.cosim.exceptions import nearest, one_line, suggestion
from handover.fmus.import_failure import explain_import, is_of_a_package


class UnknownUnit(LookupError):
    """No unit has this name."""

    def __init__(self, name: str, valid: list[str]) -> None:
        super().__init__(f"there is no unit {name!r}; {nearest(name, valid)}")
        self.name, self.valid = name, valid


class UnknownBlock(LookupError):
    """There is no such class, or it is not a block; the message says what of its path is missing."""

    def __init__(self, path: str, fault: str) -> None:
        super().__init__(f"{path}: {fault}")
        self.path, self.fault = path, fault


class PackageFailure(UnknownBlock):
    """A package that a class needs is missing or cannot be imported; the message says why, with the cure."""


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
        "handover.plants.helix.arm.tendon_arm:TendonArm",
        Fraction(1, 100),
        "tendon-driven soft arm with a gripper",
    ),
    Entry(
        "TendonArmFast",
        "handover.plants.helix.arm.tendon_arm_fast:TendonArmFast",
        Fraction(1, 100),
        "the same arm by compiled kernels, without Exudyn",
    ),
    Entry(
        "HandoverPartner",
        "handover.plants.helix.hand.handover_partner:HandoverPartner",
        Fraction(1, 100),
        "hand that offers a ball",
    ),
    Entry(
        "StereoCamera",
        "handover.plants.helix.cameras.stereo_camera:StereoCamera",
        Fraction(1, 30),
        "pictures of two cameras, or three",
    ),
    Entry(
        "FingerInfrared",
        "handover.plants.helix.finger_infrared:FingerInfrared",
        Fraction(3, 100),
        "infrared sensors in the gripper's fingertips",
    ),
    Entry(
        "HandoverVision",
        "handover.controllers.helix.vision.handover_vision:HandoverVision",
        Fraction(1, 30),
        "finds ball and markers",
    ),
    Entry(
        "VisualServo",
        "handover.controllers.helix.servo.visual_servo:VisualServo",
        Fraction(1, 10),
        "moves the arm by what vision sees",
    ),
    Entry(
        "GraspReflex",
        "handover.controllers.helix.reflex.grasp_reflex:GraspReflex",
        Fraction(1, 10),
        "corrects by fingers and motors what vision sees",
    ),
    Entry(
        "VslArm",
        "handover.plants.vsl.arm:VslArm",
        Fraction(1, 50),
        "arm with links whose stiffness follows their pressure",
    ),
    Entry(
        "VacuumGripper",
        "handover.plants.vsl.vacuum_gripper:VacuumGripper",
        Fraction(1, 50),
        "suction cup that picks up an object and drops it",
    ),
    Entry(
        "TrajectoryPlanner",
        "handover.controllers.vsl.trajectory_planner:TrajectoryPlanner",
        Fraction(1, 50),
        "lines, arcs and squares for a three-joint arm",
    ),
    Entry(
        "PickAndPlace",
        "handover.controllers.vsl.pick_and_place:PickAndPlace",
        Fraction(1, 50),
        "picks an object up and puts it down: soft near contacts, stiff while carrying",
    ),
    Entry(
        "HybridKinematics",
        "handover.controllers.vsl.hybrid_kinematics:HybridKinematics",
        Fraction(1, 50),
        "rigid-link kinematics, corrected by what was learned",
    ),
    Entry(
        "FreeFlyer",
        "handover.plants.free_flyer.robot.free_flyer:FreeFlyer",
        Fraction(2, 125),
        "free-flying robot with an arm that is fixed or has up to three joints",
    ),
    Entry(
        "Navigation",
        "handover.plants.free_flyer.robot.navigation:Navigation",
        Fraction(2, 125),
        "its estimate of pose and velocities, with noise, bias, drift and delay",
    ),
    Entry(
        "Thrusters",
        "handover.plants.free_flyer.robot.thrusters:Thrusters",
        Fraction(2, 125),
        "its propulsion: ideal, with limits and lag, or by nozzles",
    ),
    Entry(
        "Push", "handover.plants.free_flyer.robot.push:Push", Fraction(2, 125), "pulse of force and torque on a gripper"
    ),
    Entry(
        "HandAndObject",
        "handover.plants.free_flyer.hand.hand_and_object:HandAndObject",
        Fraction(2, 125),
        "hand that takes and gives an object in microgravity",
    ),
    Entry(
        "LargeObjectAndHands",
        "handover.plants.free_flyer.large_object.large_object_and_hands:LargeObjectAndHands",
        Fraction(2, 125),
        "two hands that take and give a large object, which two robots grip",
    ),
    Entry(
        "ImpedanceController",
        "handover.controllers.free_flyer.impedance_controller:ImpedanceController",
        Fraction(2, 125),
        "makes the gripper yield like a spring and damper",
    ),
    Entry(
        "AdmittanceController",
        "handover.controllers.free_flyer.admittance_controller:AdmittanceController",
        Fraction(2, 125),
        "makes the gripper follow a virtual mass, spring and damper that an estimated force moves",
    ),
    Entry(
        "ArmImpedanceController",
        "handover.controllers.free_flyer.arm_impedance_controller:ArmImpedanceController",
        Fraction(2, 125),
        "makes the gripper yield like a spring and damper, by base and arm joints",
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
        "HandoverTeam",
        "handover.controllers.free_flyer.handover_team:HandoverTeam",
        Fraction(2, 125),
        "decides the same for two robots that hold one object, together",
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


GROUP = "handover.units"
"""The group of entry points that name units; each is the path of a block's class."""

_STEP = Fraction(1, 100)  # s, of a block that is not sampled


@functools.cache
def installed_units() -> Mapping[str, str]:
    """Return the paths of other packages' blocks by their units' names, sorted; a name of `UNITS` stays that."""
    found = {e.name: e.value for e in metadata.entry_points(group=GROUP)}
    return {name: found[name] for name in sorted(found) if name not in UNITS}


def find_unit(name: str) -> Entry:
    """Return the entry of a unit, by its name, or by its block's path such as `my_arm:MyArm`.

    Raises:
        UnknownUnit: there is no unit of this name.
        UnknownBlock: there is no such class, its module cannot be loaded, or it is not a block.
    """
    if name in UNITS:
        return UNITS[name]
    if ":" in name:
        return own_unit(name)
    if name in installed_units():
        return own_unit(installed_units()[name], name=name)
    raise UnknownUnit(name, [*UNITS, *installed_units()])


def own_unit(path: str, step: Fraction | None = None, name: str = "") -> Entry:
    """Return an entry for the block of a path such as `spring:Spring`; its name is by default the class's.

    Its step, in seconds, is that which is given, else the block's period, else 0.01.

    Raises:
        UnknownBlock: there is no such class, its module cannot be loaded, or it is not a block.
    """
    try:
        description = describe(import_class(path))
    except DeclarationError as e:
        raise UnknownBlock(path, str(e)) from e
    summary = description.doc.partition("\n")[0].rstrip(".")
    return Entry(name or path.rpartition(":")[2], path, step or description.period or _STEP, summary)


def import_class(path: str) -> type[Any]:
    """Return the class that a path such as `handover.plants.helix.arm.tendon_arm:TendonArm` names.

    Raises:
        UnknownBlock: the module cannot be loaded, or has no such class.
        PackageFailure: a package that it needs is missing or cannot be imported.
    """
    module_name, colon, name = path.partition(":")
    if not colon:
        raise UnknownBlock(path, "there is no ':' between module and class, as in my_arm:MyArm")
    if not all(part.isidentifier() for part in (*module_name.split("."), name)):
        known = "a module, installed or in the working directory"
        raise UnknownBlock(path, f"expected {known}, and a class in it, as in my_arm:MyArm")
    try:
        module = import_module(module_name)
    except (Exception, SystemExit) as e:  # a module may raise anything while it is loaded
        fault = f"its module cannot be loaded{_line_of(e, module_name)}: {type(e).__name__}: {one_line(e)}"
        if isinstance(e, ModuleNotFoundError) and e.name == module_name:
            meant = suggestion(module_name, [file.stem for file in Path.cwd().glob("*.py")])
            hint = f"; {meant}" if meant else ""
            fault = f"there is no module {module_name!r}, neither installed nor in {Path.cwd()}{hint}"
        elif isinstance(e, SystemExit):
            fault = f"its module calls sys.exit({e.code!r}) as it is loaded{_line_of(e, module_name)}"
        elif is_of_a_package(e):
            raise PackageFailure(path, explain_import(e)) from e
        raise UnknownBlock(path, fault) from e
    found = getattr(module, name, None)
    if not isinstance(found, type):
        own = [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == module_name]
        classes = [c.__name__ for c in own if hasattr(c, "step")] or [c.__name__ for c in own]
        raise UnknownBlock(
            path, f"module {module_name!r} has no class {name!r}; {nearest(name, classes)}{_namesake(module)}"
        )
    return found


def _namesake(module: ModuleType) -> str:
    """Return that another module comes before one of the working directory, if it does, else nothing."""
    own = Path.cwd() / f"{module.__name__.replace('.', '/')}.py"
    there = getattr(module, "__file__", None) or "Python's own"
    return f"; it is {there}, which comes before {own}: rename that" if own.is_file() and there != str(own) else ""


def _line_of(e: BaseException, module_name: str) -> str:
    """Return the last line of a module, or of one in its package, that led to a failure, as " (arm.py, line 3)"."""
    package = module_name.partition(".")[0]
    for frame, line in reversed(list(traceback.walk_tb(e.__traceback__))):
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] == package:
            return f" ({Path(frame.f_code.co_filename).name}, line {line})"
    return ""
