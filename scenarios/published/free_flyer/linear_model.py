"""Pushes against the free-flyer's gripper, and what the linear model of its loop predicts of them."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody
from handover.controllers.free_flyer.gains import published_gains
from handover.controllers.free_flyer.ports import PERIOD
from handover.controllers.free_flyer.ports import Behaviour as Gains
from handover.controllers.free_flyer.sampled_loop import SampledLoop
from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.runs import Point
from handover.scenarios.robots.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Wrench

_DEFAULT = ImpedanceParameters()
_AFTER = 30.0
"""Time after a push for which the linear response is looked at, s: the greatest error comes long before."""


@dataclass(frozen=True)
class Push:
    """A pulse of force or torque: its wrench and axis."""

    kind: Wrench
    axis: Axis

    @property
    def label(self) -> str:
        """Wrench and axis in words."""
        p = _DEFAULT
        size = f"{p.force:g} N along" if self.kind is Wrench.FORCE else f"{p.torque:g} N·m about"
        return f"{size} {self.axis.name.lower()}"

    @property
    def metric(self) -> str:
        """Name of the metric that is its greatest error: of position for a force, of orientation for a torque."""
        return f"greatest_{'position' if self.kind is Wrench.FORCE else 'orientation'}_error"

    @property
    def parameters(self) -> Point:
        """The scenario's parameters of it, as texts."""
        return {"kind": self.kind.name.lower(), "axis": self.axis.name.lower()}

    def figure_number(self, behaviour: Behaviour) -> str:
        """Return the thesis's figure of it."""
        return f"fig. 4.{5 + 6 * int(behaviour) + 3 * int(self.kind) + int(self.axis)}"


PUSHES = tuple(Push(kind, axis) for kind in Wrench for axis in Axis)
"""The six of [Fernandes2020] sec. 4.1.3, in the order of its figures."""


@cache
def linear_loop(behaviour: Behaviour, lag: float = 0.0, delay: float = 0.0) -> SampledLoop:
    """Return the body near rest under eq. (3.25) with table 4.1, with a lag of the propulsion and a delay, both s."""
    model = _DEFAULT.model
    body = FlyerBody(mass=model.mass, I_B=model.I_B, p_BG=model.p_BG)
    return SampledLoop(body.linear_plant(lag), published_gains(Gains(behaviour), body).law(body), float(PERIOD), delay)


def predicted_errors(push: Push, behaviour: Behaviour, duration: float, t: Floats) -> tuple[Floats, Floats]:
    """Return position and orientation error, rest minus actual, each (n, 3), m and rad, by python-control.

    It is the response of the body near rest under eq. (3.25) at the controller's period, with ideal thrust and exact
    navigation: `SampledLoop`, which the controller's own check of its stability uses, too.

    Args:
        push: what acts on the gripper.
        behaviour: the controller's setting.
        duration: of the pulse, s.
        t: multiples of the controller's period, (n,), s.
    """
    p, period = _DEFAULT, float(PERIOD)
    loop = linear_loop(behaviour)
    wrench = np.zeros((len(t), 6))
    held = np.clip((p.begin + duration - t) / period, 0.0, 1.0) - np.clip((p.begin - t) / period, 0.0, 1.0)
    wrench[:, 3 * int(push.kind) + int(push.axis)] = held * (p.force if push.kind is Wrench.FORCE else p.torque)
    moved: Floats = np.asarray(loop.response(wrench))
    return -moved[:, :3], -moved[:, 3:6]


@cache
def predicted_greatest(push: Push, behaviour: Behaviour, duration: float) -> float:
    """Return the greatest error of the push's own kind by the linear model, m or rad."""
    t: Floats = np.arange(0.0, _DEFAULT.begin + duration + _AFTER, float(PERIOD))
    errors = predicted_errors(push, behaviour, duration, t)[int(push.kind)]
    return float(np.max(np.linalg.norm(errors, axis=1)))
