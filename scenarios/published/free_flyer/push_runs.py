"""Pushes against the free-flyer's gripper that a campaign runs, their rows, and what the linear model predicts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody
from handover.controllers.free_flyer.gains import published_gains
from handover.controllers.free_flyer.ports import PERIOD
from handover.controllers.free_flyer.ports import Behaviour as Gains
from handover.controllers.free_flyer.sampled_loop import SampledLoop
from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Propulsion, Wrench
from handover.scenarios.published.free_flyer.variations import EXACT, Row, has, is_done

_DEFAULT = ImpedanceParameters()
_AFTER = 30.0
"""Time after a push for which the linear response is looked at, s: the greatest error comes long before."""

DURATIONS = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
"""How long forces last whose ratio of compliant to rigid errors is looked at, s."""


@dataclass(frozen=True)
class Change:
    """What the robot is otherwise than its controller assumes, as a factor."""

    what: str
    name: str
    factor: float

    @property
    def label(self) -> str:
        """What and by how much."""
        return f"{self.what} {100 * (self.factor - 1):+.0f} %"

    @property
    def parameters(self) -> dict[str, str]:
        """The scenario's parameter of it, as texts."""
        return {self.name: f"{self.factor:g}"}


CHANGES = tuple(
    Change(what, name, factor)
    for what, name in (("mass", "mass_factor"), ("inertia", "inertia_factor"), ("arm's length", "arm_factor"))
    for factor in (0.7, 1.3)
)
"""Robots that are not what their controller assumes."""


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
    def parameters(self) -> dict[str, str]:
        """The scenario's parameters of it, as texts."""
        return {"kind": self.kind.name.lower(), "axis": self.axis.name.lower()}

    def figure_number(self, behaviour: Behaviour) -> str:
        """Return the thesis's figure of it."""
        return f"fig. 4.{5 + 6 * int(behaviour) + 3 * int(self.kind) + int(self.axis)}"


PUSHES = tuple(Push(kind, axis) for kind in Wrench for axis in Axis)
"""The six of [Fernandes2020] sec. 4.1.3, in the order of its figures."""


_VARIED = (*EXACT, *(change.name for change in CHANGES))


class PushRuns:
    """Rows of the campaign's table by what they are for."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows: Sequence[Row] = table.rows

    def of(self, push: Push, behaviour: Behaviour, **which: Any) -> Row | None:
        """Return the run of a push that came to its end, None where there is none; see `tried`."""
        return next((row for row in self.tried(push, behaviour, **which) if is_done(row)), None)

    def tried(
        self,
        push: Push,
        behaviour: Behaviour,
        *,
        propulsion: Propulsion = Propulsion.IDEAL,
        exact: bool = False,
        duration: float = _DEFAULT.duration,
        change: Change | None = None,
    ) -> list[Row]:
        """Return the runs of a push, whether or not they came to their end.

        Args:
            push: what acts on the gripper.
            behaviour: the controller's setting.
            propulsion: what the thrusters are like.
            exact: whether the navigation has no noise.
            duration: of the push, s.
            change: what of the robot is otherwise than its controller assumes.
        """
        wanted = {**push.parameters, "behaviour": behaviour.item, "propulsion": propulsion.item}
        wanted |= {"duration": f"{duration:g}", **(EXACT if exact else {}), **(change.parameters if change else {})}
        return [row for row in self._rows if has(row, wanted, _VARIED, _DEFAULT)]

    def all_of(self, **which: Any) -> list[Row]:
        """Return the runs that there are of the six pushes under both behaviours; the arguments are those of `tried`.

        Those that did not come to their end are among them: they have no metrics.
        """
        return [row for b in Behaviour for push in PUSHES for row in self.tried(push, b, **which)]

    def ratio(self, axis: Axis, duration: float) -> float | None:
        """Return compliant over rigid greatest position error under a force along an axis; None without both runs."""
        push = Push(Wrench.FORCE, axis)
        rigid, compliant = (self.of(push, b, duration=duration) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
        return None if rigid is None or compliant is None else float(compliant[push.metric] / rigid[push.metric])


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
