"""Controllers of a test's own for places of scenarios, as their authors would write them; a scenario with a place."""

from pathlib import Path

_HEAD = '''
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector2, Vector3, Vector9, output, parameter, port
from handover.cosim.blocks.units import Metre, NewtonMetre, Number, Radian, RadianPerSecond


@dataclass(kw_only=True)
class Params:
    pass


class Stateless:
    """No state, no parameters."""

    period: ClassVar[Fraction | None] = None
    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def __init__(self, params: Params) -> None:
        pass

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None:
        pass

'''

JOINTS = """
@dataclass(kw_only=True)
class Inputs:
    q: Vector2[Radian] = port(np.zeros(2), "joint angles")
    v: Vector2[RadianPerSecond] = port(np.zeros(2), "joint rates")


@dataclass(kw_only=True)
class Outputs:
    tau: Vector2[NewtonMetre] = output("joint torques")


class Joints(Stateless):
    feedthrough = {"tau": ("q", "v")}

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs(tau=np.array([1.0, 1.0]) * (np.array([0.5, 0.8]) - u.q) - 0.3 * u.v)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t, u)
"""
"""A controller that has its goal in itself: it has no p_WD."""

MISSPELLED = """
@dataclass(kw_only=True)
class Inputs:
    angles: Vector2[Radian] = port(np.zeros(2), "joint angles")
    vv: Vector2[RadianPerSecond] = port(np.zeros(2), "joint rates")


@dataclass(kw_only=True)
class Outputs:
    taw: Vector2[NewtonMetre] = output("joint torques")
    energy: int = output("in units of its own")


class Misspelled(Stateless):
    feedthrough = {"taw": ("angles", "vv"), "energy": ()}

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs(taw=np.zeros(2), energy=0)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t, u)
"""
"""A controller of which no port is named as its place has it, and one is of another kind."""

PROPORTIONAL = """
@dataclass(kw_only=True)
class Inputs:
    p_WO_meas: Vector3[Metre] = port(np.zeros(3), "position of the ball")
    p_WG_meas: Vector3[Metre] = port(np.zeros(3), "position of the gripper")


@dataclass(kw_only=True)
class Outputs:
    dl_t: Vector9[Metre] = output("tendon length changes")


class Proportional(Stateless):
    feedthrough = {"dl_t": ("p_WO_meas", "p_WG_meas")}
    period = Fraction(1, 2)

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs(dl_t=-0.05 * np.repeat(u.p_WO_meas - u.p_WG_meas, 3))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t, u)
"""
"""The shortest controller of the Helix: it takes two inputs and gives one output."""

PLACED = '''
from goal_spring import Inputs, Outputs, Params, SpringToGoal
from dataclasses import dataclass
from handover.cosim.blocks.ports import output
from handover.cosim.blocks.units import Number
from handover.scenarios.experiment.places import Place
from reach import TwoLinkReach


@dataclass(kw_only=True)
class MoreOutputs(Outputs):
    energy: Number = output("energy of the springs, in units of its own")


class Telling(SpringToGoal):
    """A controller that also gives an energy."""

    feedthrough = {"tau": ("q", "v"), "energy": ()}

    def __init__(self, params: Params) -> None:
        super().__init__(params)

    def outputs(self, t: float, u: Inputs) -> MoreOutputs:
        return MoreOutputs(tau=super().outputs(t, u).tau, energy=1.0)

    def step(self, t: float, dt: float, u: Inputs) -> MoreOutputs:
        return self.outputs(t, u)


class Placed(TwoLinkReach):
    """An arm of two links, with a place for controllers."""

    units = {"arm": "arm:TwoLinkArm", "controller": "placed:Telling"}
    places = {
        "controller": Place(
            required={"tau": "positive turns left, as seen from above"},
            optional={"q": "", "v": "", "p_WD": "the scenario's goal, in W", "energy": "shown"},
            remarks=("W has its origin at the shoulder.",),
        )
    }
'''
"""A scenario with a place for controllers, whose own gives more than it must."""


def write_controller(folder: Path, module: str, code: str) -> None:
    """Write a controller's module into a folder."""
    (folder / f"{module}.py").write_text(_HEAD + code, encoding="utf-8")


def write_placed(folder: Path) -> None:
    """Write the scenario with a place, and controllers that fit there and that do not, beside the tutorial's files."""
    (folder / "placed.py").write_text(PLACED, encoding="utf-8")
    nearly = MISSPELLED.replace("taw", "tau").replace("    energy: int", "    work: int").replace("energy", "work")
    codes = {"joints": JOINTS, "wrong": MISSPELLED, "other": MISSPELLED.replace("taw", "moment"), "nearly": nearly}
    for module, code in codes.items():
        write_controller(folder, module, code)
