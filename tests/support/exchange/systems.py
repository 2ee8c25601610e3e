"""Small systems of our units, with every connection, as they are tried in foreign hosts."""

from fractions import Fraction
from typing import Any, NamedTuple

from handover.fmus.build import cached
from support.exchange.own_master import Connections, Placed


class Wired(NamedTuple):
    """A system: units by name, how they are connected, and the step that suits them."""

    units: dict[str, Placed]
    connections: Connections
    step: Fraction


def free_flyer(fmi: int, *, scalar: bool = False) -> Wired:
    """Return a robot that drifts and turns, and the controller that makes it yield, in a closed loop."""
    held = dict[str, Any](active=True, p_WG_goal=[0.02, -0.05, 0.01])
    units = {
        "robot": Placed(cached("FreeFlyer", fmi, scalar=scalar), {"v_WB_0": [0.01, 0.02, 0.0]}),
        "navigation": Placed(cached("Navigation", fmi, scalar=scalar), {"seed": 3}),
        "controller": Placed(cached("ImpedanceController", fmi, scalar=scalar), held),
        "thrusters": Placed(cached("Thrusters", fmi, scalar=scalar)),
    }
    motion = ("p_WB", "q_WB", "v_WB", "w_WB")
    true = [(f"robot.{n}", f"navigation.{n}") for n in motion]
    measured = [(f"navigation.{n}_meas", f"controller.{n}_meas") for n in motion]
    commands = [(f"controller.{n}_cmd", f"thrusters.{n}_impedance") for n in ("f", "tau")]
    thrust = [(f"thrusters.{n}_B", f"robot.{n}_B") for n in ("f", "tau")]
    return Wired(units, [*true, *measured, *commands, *thrust], Fraction(2, 125))


def grasp(fmi: int, *, scalar: bool = False) -> Wired:
    """Return a soft hand before an object and its reflexes, in a closed loop without any other input."""
    units = {
        "scene": Placed(cached("GraspScene", fmi, scalar=scalar), {"seed": 2, "p_WH_0": [-0.21, 0.01]}),
        "reflex": Placed(cached("IrReflex", fmi, scalar=scalar), {"move_time": 0.045, "travel_time": 0.045}),
    }
    sensed = [(f"scene.{n}", f"reflex.{n}") for n in ("ticks", "p_WH", "yaw", "sigma")]
    commands = [(f"reflex.{n}_cmd", f"scene.{n}_cmd") for n in ("p_WH", "yaw", "sigma")]
    return Wired(units, [*sensed, *commands], Fraction(3, 200))


def eyes(fmi: int) -> Wired:
    """Return a stereo camera and what finds ball and markers in its pictures."""
    units = {
        "camera": Placed(cached("StereoCamera", fmi), {"seed": 3}),
        "vision": Placed(cached("HandoverVision", fmi)),
    }
    return Wired(units, [(f"camera.{side}", f"vision.{side}") for side in ("left", "right")], Fraction(1, 30))
