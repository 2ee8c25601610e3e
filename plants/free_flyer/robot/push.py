"""A push on a gripper: one rectangular pulse, as in the validation of [Fernandes2020] sec. 4.1.3."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.origins import NOT_GIVEN, assumed, stated
from handover.cosim.blocks.ports import Floats, Vector3, output, parameter
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Newton, NewtonMetre, Second


class Axis(enum.IntEnum):
    """An axis of the world."""

    X = 0
    Y = 1
    Z = 2


@dataclass(frozen=True, kw_only=True)
class Params:
    """The pulse; force and torque are the published ones (torque 3 N m), start and duration are assumed."""

    axis: Axis = parameter(
        Axis.X,
        "axis of the world along which force and torque act",
        origin=stated("figs. 4.5 and 4.11; the others show the other axes"),
    )
    force: Newton = parameter(
        5.0, "force of a push", minimum=-1000.0, maximum=1000.0, origin=stated("figs. 4.5-4.7, 4.11-4.13")
    )
    torque: NewtonMetre = parameter(
        0.0,
        "torque",
        minimum=-1000.0,
        maximum=1000.0,
        origin=stated("figs. 4.5-4.7: no torque with a force; the scenario's 3 N m are in push_scenario"),
    )
    start: Second = parameter(1.0, "when the push begins", minimum=0.0, maximum=1e6, origin=NOT_GIVEN)
    duration: Second = parameter(
        0.5, "how long the push lasts", minimum=0.0, maximum=1e6, origin=assumed("not given in the text")
    )


@dataclass(kw_only=True)
class Inputs:
    """Nothing: the push does not depend on what is pushed."""


@dataclass(kw_only=True)
class Outputs:
    """What acts on the gripper, in the world."""

    f_G: Vector3[Newton] = output("force at the gripper, mean over the step that ends")
    tau_G: Vector3[NewtonMetre] = output("torque on the gripper, mean over the step that ends")


class Push:
    """Gives the mean of a rectangular pulse over each step: w = w_0 |[t, t + dt] and [start, start + duration]| / dt.

    Steps follow each other without gaps, so the impulse w_0 duration is exact wherever the pulse's edges lie. In a
    system the push comes before the robot, which then uses the mean in the same step. Placed after the robot, or with
    Jacobi's order, the push comes one step later and is as large. No time has passed at the start: zero.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (terminal("contact", TerminalKind.WRENCH, "f_G", "tau_G"),)
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self._direction: Floats = np.zeros(3)
        self._direction[params.axis] = 1.0
        self._params = params

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return no push; no time passes."""
        return self._share(0.0)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the mean push from t to t + dt."""
        p = self._params
        overlap = min(t + dt, p.start + p.duration) - max(t, p.start)
        return self._share(max(0.0, overlap) / dt)

    def get_state(self) -> bytes:
        """Return the complete state: there is none."""
        return b""

    def set_state(self, state: bytes) -> None:
        """Do nothing: the push depends on time alone."""

    def _share(self, s: float) -> Outputs:
        p = self._params
        return Outputs(f_G=s * p.force * self._direction, tau_G=s * p.torque * self._direction)
