"""One passing of the object from robot to person or back, as the experimenter sees it."""

import math
from dataclasses import dataclass, field

from handover.scenarios.experiment.experiment import Metric


@dataclass
class Transfer:
    """A transfer under way or done.

    Attributes:
        receiver: who is to have the object, `HAND` or `GRIPPER`.
        signalled: when the robot first gave the signal for it, s.
        asked: when it last gave it, s; later than `signalled` after a failed reception.
        felt: when the robot took the gripper's speed for a pull or a push since, s; None before.
        in_vain: when it had done so in receptions that failed, s.
        speed: the gripper's speed when it was felt, m/s.
        fastest: the greatest speed while the robot waited since it last asked, m/s.
        farthest: how far the gripper was from its place at most, from the signal for as long as it yields, m.
        farthest_along: the same along the axes of W.
        done: when the receiver had the object alone, s; None before.
    """

    receiver: str
    signalled: float
    asked: float = field(init=False)
    felt: float | None = None
    in_vain: list[float] = field(default_factory=list[float])
    speed: float = 0.0
    fastest: float = 0.0
    farthest: float = 0.0
    farthest_along: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    done: float | None = None

    def __post_init__(self) -> None:
        self.asked = self.signalled

    def asked_again(self, t: float) -> None:
        """Take note that the robot signals once more: what it had felt was in vain."""
        if self.felt is not None:
            self.in_vain.append(self.felt)
        self.asked, self.felt, self.fastest = t, None, 0.0

    def displaced(self, p_WG: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        """Take note of where the gripper is, and where it ought to be."""
        away = [abs(a - b) for a, b in zip(p_WG, place, strict=True)]
        self.farthest = max(self.farthest, math.hypot(*away))
        self.farthest_along = [max(pair) for pair in zip(self.farthest_along, away, strict=True)]

    def metrics(self, prefix: str) -> dict[str, Metric]:
        """Return its figures under names with a prefix."""
        whom = "person" if self.receiver == "HAND" else "robot"
        touch = "pull" if self.receiver == "HAND" else "push"
        act = "let go" if self.receiver == "HAND" else "closed"
        told = {
            "displacement": Metric(
                self.farthest, "m", f"gripper from its handover place at most, while the {whom} takes the object"
            ),
            **{
                f"displacement_{axis}": Metric(
                    away,
                    "m",
                    f"gripper from its handover place at most along {axis} of W, while the {whom} takes the object",
                )
                for axis, away in zip("xyz", self.farthest_along, strict=True)
            },
        }
        if self.felt is not None:
            told["speed"] = Metric(self.speed, "m/s", f"gripper's speed when the robot felt the {touch} and {act}")
        if self.done is not None:
            since = f"from the {'first ' if self.in_vain else ''}signal until the {whom} has the object"
            told["time"] = Metric(self.done - self.signalled, "s", since)
        return {f"{prefix}_{name}": metric for name, metric in told.items()}
