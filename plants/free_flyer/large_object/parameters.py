"""Parameters of a large object with four handles, of two grippers and of a person's hands that hold it by these."""

from dataclasses import dataclass, fields
from itertools import combinations
from typing import Any

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.plain_rotation import (
    Vector,
    add,
    distance,
    inverse_rotate,
    normalize,
    quaternion,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Vector3, parameter
from handover.cosim.blocks.units import (
    Kilogram,
    Metre,
    Newton,
    NewtonMetreSecondPerRadian,
    NewtonSecondPerMetre,
    Number,
    Second,
)
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.hand_kinematics import RADIUS
from handover.plants.free_flyer.hand.parameters import MIN_ROOM, ContactParams, StartHolder

_PROPOSED = assumed("sec. 6.3 proposes two robots with a larger object, and gives no values")


class InvalidLargeObjectParameters(InvalidParameters):
    """Parameters, or a start, that contradict each other; `faults` lists all of them."""

    block = "LargeObjectAndHands"


@dataclass(frozen=True, kw_only=True)
class Params(ContactParams):
    """All values are assumed: [Fernandes2020] sec. 6.3 proposes such an object, and gives none of it.

    The handles are bars along y of the object with the section of the thesis's own object, for which gripper and hand
    are made. Effort, arm and grip are those of each hand and of each gripper. The grips are damped more than that
    one's: 8 N s/m are enough between a robot and 0.1 kg, but between two robots, whose wrenches act a step later, a
    spring k needs more than k times the step.
    """

    p_WO_0: Vector3[Metre] = parameter(
        np.array([0.10, -0.80, 0.0]), "where a free object is at the start", origin=_PROPOSED
    )
    p_WH_0: Vector3[Metre] = parameter(
        np.array([-0.65, 0.0, -0.05]), "where the middle between the hands rests", origin=_PROPOSED
    )
    object_mass: Kilogram = parameter(3.0, "mass of the object", minimum=0.001, maximum=100.0, origin=_PROPOSED)
    object_size: Vector3[Metre] = parameter(
        np.array([0.40, 0.70, 0.05]),
        "sides of the object, a box, without its handles",
        minimum=0.001,
        maximum=2.0,
        origin=_PROPOSED,
    )
    p_OG: Vector3[Metre] = parameter(
        np.array([0.28, 0.0, 0.0]),
        "middle between the handles for the grippers",
        minimum=-2.0,
        maximum=2.0,
        origin=_PROPOSED,
    )
    p_OH: Vector3[Metre] = parameter(
        np.array([-0.28, 0.0, 0.0]),
        "middle between the hands' handles, or the one hand's",
        minimum=-2.0,
        maximum=2.0,
        origin=_PROPOSED,
    )
    pull_direction: Vector3[Number] = parameter(
        np.array([-1.0, 0.0, 0.0]),
        "direction of a pull, in the world",
        origin=assumed("sec. 6.3: away from both robots, which hold the object side by side"),
    )
    effort: Newton = parameter(
        2.0,
        "force of each hand's pull at rest",
        minimum=0.05,
        maximum=100.0,
        origin=assumed("not given; the scenario's is its parameter strength"),
    )
    fist_offset: Metre = parameter(
        0.0,
        "where along y of G fists push",
        minimum=-0.3,
        maximum=0.3,
        origin=assumed("fists push in the middle of the palms"),
    )
    grip_damping: NewtonSecondPerMetre = parameter(
        40.0,
        "damping of the grip",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed(
            "between two robots coupled at 16 ms a grip needs more than person.grip_damping, or its energy rises"
        ),
    )
    grip_turn_damping: NewtonMetreSecondPerRadian = parameter(
        0.3, "its turning damping", minimum=0.0, maximum=100.0, origin=assumed("as grip_damping")
    )
    palm_damping: NewtonSecondPerMetre = parameter(
        20.0, "damping of the palm", minimum=0.0, maximum=1000.0, origin=assumed("as grip_damping")
    )
    handle_size: Vector3[Metre] = parameter(
        np.array([0.021, 0.12, 0.017]),
        "sides of each handle, whose mass is the object's",
        minimum=0.001,
        maximum=1.0,
        origin=assumed("the section of person.object_size, which gripper and hand are made for"),
    )
    grip_spacing: Metre = parameter(
        0.50, "between the grippers' handles, along y; the first is at +y", minimum=0.0, maximum=2.0, origin=_PROPOSED
    )
    hands: int = parameter(
        2, "how many hands the person uses", minimum=1, maximum=2, origin=derived("sec. 6.3: both hands")
    )
    hand_spacing: Metre = parameter(
        0.50,
        "between the hands' handles, along y; the first is at +y",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("sec. 6.3: both hands; about the width of shoulders"),
    )
    hand_delay: Second = parameter(
        0.0,
        "how much later than the first the second hand closes and opens",
        minimum=0.0,
        maximum=10.0,
        origin=_PROPOSED,
    )

    @property
    def grip_places(self) -> tuple[Vector, Vector]:
        """Middles of the grippers' handles, seen from the object's centre, m."""
        first, second = _pair(vector(self.p_OG), self.grip_spacing)
        return first, second

    @property
    def hand_places(self) -> list[Vector]:
        """Middle of the handle of each hand that the person uses, likewise."""
        return [vector(self.p_OH)] if self.hands == 1 else _pair(vector(self.p_OH), self.hand_spacing)

    @property
    def of_handle(self) -> ContactParams:
        """The parameters of who holds a handle, to whom its sides are the object's."""
        values: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(ContactParams)}
        values["object_size"] = self.handle_size
        return ContactParams(**values)

    @property
    def angle_object(self) -> float:
        """Angle of a gripper closed on a handle, in rad."""
        return self.of_handle.angle_object

    def check(self) -> None:
        """Raise InvalidLargeObjectParameters, with all faults, if values contradict each other."""
        faults = self._handle_faults() + self.of_handle.gripper_faults() + self.person_faults() + self._start_faults()
        if faults:
            raise InvalidLargeObjectParameters(faults)

    def _handle_faults(self) -> list[str]:
        faults: list[str] = []
        sides = np.asarray(self.handle_size)
        if not sides[1] >= max(sides[0], sides[2]):
            faults.append(f"handle_size {sides.tolist()} m: the second side must be the longest, handles lie along y")
        places = {f"handle {i} of the grippers": place for i, place in enumerate(self.grip_places, 1)}
        places |= {f"handle {i} of the hands": place for i, place in enumerate(self.hand_places, 1)}
        room, half = Box(scale(0.5, vector(self.object_size))), (0.0, 0.5 * float(sides[1]), 0.0)
        needed = 0.5 * float(max(sides[0], sides[2])) + 2.0 * RADIUS
        for name, place in places.items():
            least = min(room.distance(p) for p in (subtract(place, half), place, add(place, half)))
            if least < needed:
                faults.append(
                    f"{name} stands {least:.3g} m off the object; fingers need {needed:.3g} m from its middle line"
                )
        for (name, a), (other, b) in combinations(places.items(), 2):
            if distance(a, b) < max(MIN_ROOM, float(sides[1])):
                faults.append(f"{name} and {other} are {distance(a, b):.3g} m apart, less than a handle's length")
        return faults

    def _start_faults(self) -> list[str]:
        if self.object_with is StartHolder.HAND:
            return []
        R_WO = rotation_matrix(normalize(quaternion(self.q_WO_0)))
        apart = inverse_rotate(R_WO, subtract(vector(self.p_WH_0), vector(self.p_WO_0)))
        gap = Box(scale(0.5, vector(self.object_size))).distance(apart) - self.fist_radius
        fault = f"p_WH_0 and p_WO_0: the hands start {-gap:.3g} m inside the object; move one away"
        return [fault] if gap < 0.0 else []


def _pair(middle: Vector, spacing: float) -> list[Vector]:
    half = (0.0, 0.5 * spacing, 0.0)
    return [add(middle, half), subtract(middle, half)]
