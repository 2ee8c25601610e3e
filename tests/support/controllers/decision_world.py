"""A robot that reaches its goal immediately unless a person moves it, and that the free-flyer's decision leads."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handover.controllers.free_flyer.handover_state_machine import (
    HandoverPhase,
    HandoverStateMachine,
    HandoverTask,
    Inputs,
    Outputs,
    Params,
)
from handover.cosim.blocks.ports import Floats

P = HandoverPhase
T = 0.016
ARM = np.array([-0.30, 0.0, 0.0])
OPEN, HOLDING, EMPTY = 1.2, 0.79, 0.60


@dataclass
class World:
    """Where the robot is and what its gripper does; a hook may change it before each step."""

    machine: HandoverStateMachine
    before: Callable[["World"], None] = lambda _: None
    p_WG: Floats = field(default_factory=lambda: np.array([0.0, -0.07, 0.0]))
    v_WB: Floats = field(default_factory=lambda: np.zeros(3))
    angle_closed: float = HOLDING
    follows: bool = True
    rng: np.random.Generator | None = None
    y: Outputs | None = None
    t: float = 0.0
    ys: list[Outputs] = field(default_factory=list[Outputs])
    us: list[Inputs] = field(default_factory=list[Inputs])

    def step(self) -> Outputs:
        self.before(self)
        y = self.y
        if y and self.follows:
            self.p_WG = np.array(y.p_WG_goal)
        angle = self.angle_closed if y and y.closure > 0.5 else OPEN
        noise = 0.001 * self.rng.standard_normal((2, 3)) if self.rng else np.zeros((2, 3))
        u = Inputs(p_WB_meas=self.p_WG - ARM + noise[0], v_WB_meas=self.v_WB + noise[1], gripper_angle=angle)
        self.us.append(u)
        self.y = self.machine.step(self.t, T, u)
        self.t += T
        self.ys.append(self.y)
        return self.y

    def run(self, seconds: float) -> list[Outputs]:
        return [self.step() for _ in range(round(seconds / T))]

    def until(self, phase: HandoverPhase) -> Outputs:
        """Go on until the robot is in a phase."""
        while (y := self.step()).phase is not phase:
            assert self.t < 100.0
        return y

    def phases(self) -> list[HandoverPhase]:
        found = [y.phase for y in self.ys]
        return [p for i, p in enumerate(found) if i == 0 or p is not found[i - 1]]


def world(task: HandoverTask, before: Callable[[World], None] = lambda _: None, **params: Any) -> World:
    return World(HandoverStateMachine(Params(task=task, **params)), before)


def tug(speed: float, after: float = 0.5) -> Callable[[World], None]:
    """A person who moves the gripper for 0.3 s, a while after each time that the robot began to check."""
    waited = [0.0]

    def act(w: World) -> None:
        checking = w.y is not None and w.y.phase is P.CHECK_VELOCITY
        waited[0] = waited[0] + T if checking else 0.0
        w.v_WB = np.array([0.0, 0.0, speed if checking and waited[0] > after else 0.0])

    return act


def first(ys: list[Outputs], phase: HandoverPhase) -> Outputs:
    return next(y for y in ys if y.phase is phase)


FETCH = [P.OPEN_GRIPPER, P.MOVE_TO_OBJECT, P.GRASP_OBJECT, P.MOVE_TO_HANDOVER]
TO_HUMAN = [*FETCH, P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY, P.RELEASE_OBJECT]
END = [P.DEACTIVATE_IMPEDANCE, P.RETREAT, P.DONE]
RECEIVE = [P.CHECK_VELOCITY, P.CLOSE_GRIPPER, P.CHECK_ANGLE]
