"""A transfer of an object between a free-flyer and a person, by ground truth: what moved and pressed, and when.

Besides, how near the gripper has come to where it was to be, and how slow it was there.
"""

import math
from dataclasses import dataclass, field

from handover.scenarios.experiment.experiment import Metric


@dataclass
class Transfer:
    """A transfer under way or done.

    Attributes:
        receiver: who is to have the object, `HAND` or `GRIPPER`.
        signalled: when the robot first gave the signal for it, s.
        asked: when it last gave the signal, s; later than `signalled` after a failed reception or delivery.
        felt: when, since then, it took the gripper's speed for a pull or a push, s; None before.
        in_vain: times at which it had felt one in receptions and deliveries that failed, s.
        speed: the gripper's speed when it was felt, as the robot saw it, m/s.
        true_speed: the same by ground truth.
        fastest: maximum speed while the robot has been waiting since it last asked, m/s.
        at_rest: its greatest while the robot waits after any of its signals and nobody has touched the gripper, or what
            it holds, m/s.
        touched: whether the person has, since then.
        farthest: maximum distance of the gripper from its place, from the signal for as long as it yields, m.
        farthest_along: the same along each axis of W.
        hardest: greatest force on the hand, from the signal until the receiver has the object alone, N.
        done: when the receiver had the object alone, s; None before.
    """

    receiver: str
    signalled: float
    asked: float = field(init=False)
    felt: float | None = None
    in_vain: list[float] = field(default_factory=list[float])
    speed: float = 0.0
    true_speed: float = 0.0
    fastest: float = 0.0
    at_rest: float = 0.0
    touched: bool = False
    farthest: float = 0.0
    farthest_along: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    hardest: float = 0.0
    done: float | None = None

    def __post_init__(self) -> None:
        self.asked = self.signalled

    def asked_again(self, t: float) -> None:
        """Restart the transfer as the robot signals once more: what it had felt was in vain."""
        if self.felt is not None:
            self.in_vain.append(self.felt)
        self.asked, self.felt, self.fastest, self.touched = t, None, 0.0, False

    def waited(self, speed: float) -> None:
        """Update the maximum speeds by the gripper's, m/s, while the robot waits to be pulled or pushed."""
        self.fastest = max(self.fastest, speed)
        if not self.touched:
            self.at_rest = max(self.at_rest, speed)

    @property
    def seen(self) -> str:
        """What the robot took for a pull or push, if it felt one, as a clause."""
        return f"it saw its gripper move at {self.speed:.3f} m/s, which moved at {self.true_speed:.3f} m/s"

    def displaced(self, p_WG: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        """Update the displacement by the gripper's position and its handover place."""
        (x, y, z), (p_x, p_y, p_z), (far_x, far_y, far_z) = p_WG, place, self.farthest_along
        x, y, z = abs(x - p_x), abs(y - p_y), abs(z - p_z)
        self.farthest = max(self.farthest, math.hypot(x, y, z))
        self.farthest_along = [max(far_x, x), max(far_y, y), max(far_z, z)]

    def metrics(self, prefix: str) -> dict[str, Metric]:
        """Return the transfer's metrics, their names with a prefix.

        What describes them goes for both receivers, since a campaign shows those of both in one column. What the robot
        takes for a pull or push may be a bump of the hand.
        """
        metrics = {
            "displacement": Metric(
                self.farthest, "m", "gripper from its handover place at most, from the signal while it yields"
            ),
            **{
                f"displacement_{axis}": Metric(
                    away,
                    "m",
                    f"gripper from its handover place at most along {axis} of W, from the signal while it yields",
                )
                for axis, away in zip("xyz", self.farthest_along, strict=True)
            },
            "force": Metric(self.hardest, "N", "force on the hand at most, until the receiver has the object"),
            "rest_speed": Metric(
                self.at_rest,
                "m/s",
                "gripper's speed at most, as the robot sees it, while it waits and nobody touches it",
            ),
        }
        if self.felt is not None:
            metrics["speed"] = Metric(self.speed, "m/s", "gripper's speed when the robot took it for a pull or push")
            since = "from the last signal until the robot took the gripper's speed for a pull or push"
            metrics["felt_after"] = Metric(self.felt - self.asked, "s", since)
        if self.done is not None:
            since = "from the first signal until the receiver has the object"
            metrics["time"] = Metric(self.done - self.signalled, "s", since)
        return {f"{prefix}_{name}": metric for name, metric in metrics.items()}


@dataclass
class Approach:
    """How a gripper has come to a goal, where it is to be at rest.

    Attributes:
        p_WG_goal: the goal, m, in W.
        near: distance from it within which the gripper is in its place, m.
        nearest: least distance of the gripper from it, m.
        slowest: least speed that the robot has seen its gripper have in its place, m/s.
    """

    p_WG_goal: tuple[float, float, float]
    near: float
    nearest: float = math.inf
    slowest: float = math.inf

    def moved(self, p_WG: tuple[float, float, float], speed: float) -> None:
        """Take in the gripper's position, m, and its speed as the robot sees it, m/s."""
        away = math.dist(p_WG, self.p_WG_goal)
        self.nearest = min(self.nearest, away)
        if away < self.near:
            self.slowest = min(self.slowest, speed)

    def fault(self, rest: float) -> str:
        """Return what kept the gripper from being at rest in its place, in words; `rest` counts as rest, m/s."""
        place = "(" + ", ".join(f"{x:.2f}" for x in self.p_WG_goal) + ") m"
        if self.nearest >= self.near:
            digits = 3 if self.nearest < 3.0 * self.near else 2
            counts = f"of which {self.near:g} m count as there"
            return f"the gripper came no nearer than {self.nearest:.{digits}f} m to its place at {place}, {counts}"
        text = f"the gripper was in its place at {place}, but by the robot's estimate never at rest and aligned there"
        if self.slowest < rest:
            return f"{text} for long enough"
        return f"{text}: never slower than {self.slowest:.4f} m/s, where less than {rest:g} m/s is rest"
