"""A suction cup at the VSL arm's tip, and an object that it picks up and drops, after [Gandarias2020] sec. II-A."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Vector3, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Kilogram, Metre, MetrePerSecond2, Newton


class InvalidVacuumGripper(InvalidParameters):
    """Parameters out of range, or a gripper that is nowhere; `faults` lists all of them."""

    block = "VacuumGripper"


@dataclass(frozen=True, kw_only=True)
class Params:
    """The cup and the object; all assumed."""

    mass: Kilogram = parameter(
        0.05,
        "mass of the object",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("no object is picked up in the paper; within the loads of sec. V-C, 0 to 100 g"),
    )
    p_WO_0: Vector3[Metre] = parameter(
        np.array([0.35, 0.0, 0.05]),
        "where the object's top is at the start",
        minimum=-10.0,
        maximum=10.0,
        origin=assumed("a corner of the square of sec. V-A, where the tip comes to pick up"),
    )
    reach: Metre = parameter(
        0.01,
        "how far from the object's top the gripper may be to pick it up",
        minimum=0.0,
        maximum=0.1,
        origin=assumed("about the radius of a small suction cup"),
    )
    suction: Newton = parameter(
        5.0,
        "weight that the cup holds",
        minimum=0.0,
        maximum=1e3,
        origin=assumed("a cup of 2 cm across at a vacuum of 0.2 bar, about; the gripper of sec. II-A is not described"),
    )
    landing: Metre = parameter(
        0.05,
        "height of the object's top where it comes to rest when it is dropped",
        minimum=-10.0,
        maximum=10.0,
        origin=assumed("the object stands on the ground and is 5 cm high"),
    )
    gravity: MetrePerSecond2 = parameter(
        9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0, origin=assumed("on the ground")
    )


@dataclass(kw_only=True)
class Inputs:
    """Where the gripper is, and whether it sucks."""

    p_WG: Vector3[Metre] = port(np.array([0.35, 0.0, 0.1]), "position of the gripper")
    vacuum: bool = port(False, "the cup sucks")


@dataclass(kw_only=True)
class Outputs:
    """What hangs on the arm, and where the object is."""

    load: Kilogram = output("mass that hangs on the gripper: the object's while it is held, else 0")
    held: bool = output("the object is held")
    p_WO: Vector3[Metre] = output("position of the object's top")


class VacuumGripper:
    """Holds an object from when it sucks near it until it sucks no longer; then the object falls.

    - Picks up at the first step with vacuum and |p_WG - p_WO| <= reach, if mass gravity <= suction. The object keeps
      the place that it had beside the gripper.
    - It lies at p_WO_0 until it is picked up. Dropped, it falls freely from rest, z'' = -gravity, down to the landing
      height; let go at that height or below, it stays where it is.

    The object touches nothing but the cup: it does not stop an arm that pushes it into the ground.

    Raises:
        InvalidVacuumGripper: by the constructor for parameters out of range; by `step`, which then changes nothing, for
            a position that is not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        if faults := parameter_faults(params):
            raise InvalidVacuumGripper(faults)
        self._params = params
        self._held = False
        self._p_WO = np.array(params.p_WO_0)
        self._p_GO = np.zeros(3)
        self._fallen: float | None = None
        """How long it has been falling, s; None while it is held or lies."""

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where the object is; no time passes."""
        return Outputs(load=self._params.mass if self._held else 0.0, held=self._held, p_WO=np.array(self._p_WO))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        if not np.isfinite(u.p_WG).all():
            raise InvalidVacuumGripper([f"p_WG {u.p_WG} must be finite"])
        if self._held and not u.vacuum:
            self._held, self._fallen = False, 0.0
        elif u.vacuum and not self._held and self._can_pick_up(u):
            self._held, self._fallen = True, None
            self._p_GO = self._p_WO - u.p_WG
        if self._held:
            self._p_WO = u.p_WG + self._p_GO
        elif self._fallen is not None:
            self._fall(self._fallen, dt)
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pack_state((self._held, self._p_WO, self._p_GO, self._fallen))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this gripper or of one with equal parameters."""
        self._held, self._p_WO, self._p_GO, self._fallen = unpack_state(state)

    def _can_pick_up(self, u: Inputs) -> bool:
        p = self._params
        return math.dist(u.p_WG, self._p_WO) <= p.reach and p.mass * p.gravity <= p.suction

    def _fall(self, fallen: float, dt: float) -> None:
        x, y, z = self._p_WO.tolist()
        p = self._params
        lower = z - p.gravity * (fallen + 0.5 * dt) * dt
        self._fallen = fallen + dt if lower > p.landing else None
        self._p_WO = np.array([x, y, max(lower, min(z, p.landing))])
