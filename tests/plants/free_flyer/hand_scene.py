"""The hand, the object and a gripper that a test moves."""

from dataclasses import replace
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_and_object import (
    Activity,
    HandAndObject,
    Inputs,
    Motion,
    Outputs,
    Params,
    StartHolder,
)

DT = 0.016
PLACE = np.array([0.0, -0.07, 0.0])
EXACT: dict[str, Any] = dict.fromkeys(
    ("sight_error", "depth_error", "interface_delay", "timing_error", "effort_spread", "reaction_spread"), 0.0
)
CALM = Params(tremor_rms=0.0, drift_rms=0.0, p_WO_0=np.zeros(3), **EXACT)
IDLE = replace(CALM, motion=Motion.NONE, motion_again=Motion.NONE)
GIVING = replace(CALM, motion=Motion.GIVE, object_with=StartHolder.HAND)


def off(x: float, y: float = 0.0, z: float = 0.0) -> Floats:
    """Return a place beside the gripper's."""
    return PLACE + np.array([x, y, z])


class Scene:
    """A unit and its time; the gripper is where `move` says and closes on command."""

    def __init__(self, params: Params, p_WG: Floats = PLACE) -> None:
        self.unit, self.i = HandAndObject(params), 0
        self.u = Inputs(p_WG=np.array(p_WG))
        self.y = self.unit.outputs(0.0, self.u)
        self.seen: list[Outputs] = []

    def go(self, seconds: float, dt: float = DT, **changes: Any) -> Outputs:
        self.u = replace(self.u, **changes)
        for _ in range(round(seconds / dt)):
            self.u.p_WG = self.u.p_WG + dt * self.u.v_WG
            self.y = self.unit.step(self.i * dt, dt, self.u)
            self.i += 1
            self.seen.append(self.y)
        return self.y

    def until(self, activity: Activity, **changes: Any) -> Outputs:
        for _ in range(2000):
            if self.go(DT, **changes).activity is activity:
                return self.y
        raise AssertionError(f"{activity!r} did not come about")

    def activities(self) -> list[Activity]:
        all_of_them = [y.activity for y in self.seen]
        return [a for a, b in zip(all_of_them, [None, *all_of_them], strict=False) if a is not b]
