"""Parameters of the Helix handover; origins of the defaults are in `paper.toml`."""

import enum
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre, Number, Radian, Second
from handover.scenarios.experiment.paper import paper_values


class Place(enum.IntEnum):
    """Where the hand is, seen from the cameras behind the arm. [Vervloet2025] sec. 3.5.1."""

    FRONT = 0
    FRONT_LEFT = 1
    LEFT = 2
    BACK_LEFT = 3

    @property
    def azimuth(self) -> float:
        """Direction from the arm's axis in W, rad, from +x (away from the cameras) towards +y (their left)."""
        return float(np.pi / 4 * self)


class Cover(enum.IntEnum):
    """Which camera's lens is covered for a while."""

    NONE = 0
    LEFT = 1
    RIGHT = 2


class Tuning(enum.IntEnum):
    """Sets of the controller's parameters; `paper.toml` lists their values."""

    OWN = 0
    THESIS = 1


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One handover."""

    alpha: Number = parameter(0.25, "step size of the Jacobian control, eq. (21)", minimum=0.01, maximum=1.0)
    place: Place = parameter(Place.FRONT, "where the hand offers the ball")
    azimuth: Radian = parameter(
        0.0, "turn of the offered ball about the arm's axis from that place, to the left", minimum=-np.pi, maximum=np.pi
    )
    radius: Metre = parameter(0.16, "distance of the offered ball from the arm's axis", minimum=0.0, maximum=2.0)
    height: Metre = parameter(-0.6, "height of the offered ball in W", minimum=-1.1, maximum=0.0)
    control_period: Second = parameter(0.5, "period of the controller", minimum=0.1, maximum=10.0)
    threshold: Metre = parameter(0.05, "error at which the arm descends onto the ball", minimum=0.001, maximum=0.08)
    tuning: Tuning = parameter(Tuning.OWN, "bounds and weights of the controller: ours, or the thesis's")
    cover: Cover = parameter(Cover.NONE, "camera whose lens is covered for a while")
    cover_from: Second = parameter(4.0, "time at which the lens is covered", minimum=0.0, maximum=600.0)
    cover_for: Second = parameter(2.0, "how long the lens is covered", minimum=0.0, maximum=600.0)
    patience: Second = parameter(60.0, "time by which the gripper must begin to close", minimum=1.0, maximum=600.0)

    @property
    def p_WO(self) -> Floats:
        """Position of the offered ball in W, shape (3,), m."""
        a = self.place.azimuth + self.azimuth
        return np.array([self.radius * np.cos(a), self.radius * np.sin(a), self.height])

    @property
    def period(self) -> Fraction:
        """The controller's period as an exact number of milliseconds."""
        return Fraction(round(self.control_period * 1000), 1000)

    @property
    def settings(self) -> dict[str, Any]:
        """The controller's parameters of the tuning."""
        return paper_values("helix", self.tuning.name.lower())

    def covered(self, side: Cover) -> tuple[float, float]:
        """Return from when until when a lens is covered, in seconds; (0, 0) where it is not."""
        return (self.cover_from, self.cover_from + self.cover_for) if self.cover is side else (0.0, 0.0)
