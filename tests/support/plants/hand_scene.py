"""The hand, the object and a gripper that a test moves."""

from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

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


class Steps:
    """A unit, what it gets and gave, and its time."""

    def __init__(self, unit: Any, u: Any) -> None:
        self.unit, self.u, self.i = unit, u, 0
        self.y = unit.outputs(0.0, u)
        self.seen: list[Any] = []

    def go(self, seconds: float, dt: float = DT, **changes: Any) -> Any:
        """Go on with changed inputs."""
        self.u = replace(self.u, **changes)
        for _ in range(round(seconds / dt)):
            self.move(dt)
            self.y = self.unit.step(self.i * dt, dt, self.u)
            self.i += 1
            self.seen.append(self.y)
        return self.y

    def move(self, dt: float) -> None:
        """Change inputs before a step."""

    def until(self, activity: Any, **changes: Any) -> Any:
        """Go on until the person does something."""
        for _ in range(2000):
            if self.go(DT, **changes).activity is activity:
                return self.y
        raise AssertionError(f"{activity!r} did not come about")

    def activities(self) -> list[Any]:
        """Return what the person did in turn."""
        return [activity for activity, _ in groupby(y.activity for y in self.seen)]


class Scene(Steps):
    """Hand and object; the gripper is where `v_WG` moves it and closes on command."""

    y: Outputs
    u: Inputs
    seen: list[Outputs]

    def __init__(self, params: Params, p_WG: Floats = PLACE) -> None:
        super().__init__(HandAndObject(params), Inputs(p_WG=np.array(p_WG)))

    def move(self, dt: float) -> None:
        """Move the gripper."""
        self.u.p_WG = self.u.p_WG + dt * self.u.v_WG

    def go(self, seconds: float, dt: float = DT, **changes: Any) -> Outputs:
        """Go on with changed inputs."""
        return super().go(seconds, dt, **changes)


def called(params: Params, activity: Activity = Activity.PULL, p_WG: Floats = PLACE) -> Scene:
    """Return a scene in which the gripper holds the object and the called person has come to an activity."""
    scene = Scene(params, p_WG)
    scene.go(2.0, closure=1.0)
    scene.until(activity, light=True)
    return scene


def giving(params: Params = GIVING, p_WG: Floats = PLACE) -> Scene:
    """Return a scene in which the called person pushes towards the gripper."""
    scene = Scene(params, p_WG)
    scene.until(Activity.PUSH, light=True)
    return scene


def body_sums(mass: float, inertia: Floats, p: Floats, q: Floats, v: Floats, w: Floats) -> Floats:
    """Return a body's momentum, angular momentum about the world's origin, and kinetic energy."""
    R = Rotation.from_quat(q, scalar_first=True)
    L: Floats = R.apply(inertia @ R.apply(w, inverse=True))
    return np.concatenate([mass * v, L + mass * np.cross(p, v), [0.5 * (mass * v @ v + w @ L)]])
