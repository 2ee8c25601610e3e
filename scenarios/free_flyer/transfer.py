"""One passing of the object from robot to person or back, as the experimenter sees it."""

import math
from dataclasses import dataclass, field

from scenarios.experiment import Metric


@dataclass
class Transfer:
    """A transfer under way or done.

    Attributes:
        receiver: who is to have the object, `HAND` or `GRIPPER`.
        signalled: when the robot first gave the signal for it, s.
        felt: when the robot last took the gripper's speed for a pull, s; None before.
        speed: the gripper's speed at that time, m/s.
        fastest: the greatest speed while the robot waited for a pull, m/s.
        farthest: how far the gripper was from its place at most, from the signal for as long as it yields, m.
        farthest_along: the same along the axes of W.
        done: when the receiver had the object alone, s; None before.
    """

    receiver: str
    signalled: float
    felt: float | None = None
    speed: float = 0.0
    fastest: float = 0.0
    farthest: float = 0.0
    farthest_along: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    done: float | None = None

    def displaced(self, p_WG: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        """Take note of where the gripper is, and where it ought to be."""
        away = [abs(a - b) for a, b in zip(p_WG, place, strict=True)]
        self.farthest = max(self.farthest, math.hypot(*away))
        self.farthest_along = [max(pair) for pair in zip(self.farthest_along, away, strict=True)]

    def metrics(self, prefix: str) -> dict[str, Metric]:
        """Return its figures under names with a prefix."""
        whom = "person" if self.receiver == "HAND" else "robot"
        act = "let go" if self.receiver == "HAND" else "closed"
        told = {
            "displacement": Metric(
                self.farthest, "m", f"gripper from its place at most, from the signal on, object to {whom}"
            ),
            **{
                f"displacement_{axis}": Metric(away, "m", f"along {axis}, object to {whom}")
                for axis, away in zip("xyz", self.farthest_along, strict=True)
            },
        }
        if self.felt is not None:
            told["speed"] = Metric(self.speed, "m/s", f"gripper's speed at which the robot {act}")
        if self.done is not None:
            told["time"] = Metric(self.done - self.signalled, "s", f"from the signal until the {whom} has the object")
        return {f"{prefix}_{name}": metric for name, metric in told.items()}
