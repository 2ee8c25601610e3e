"""Parameters of a free-flyer's handover, and what is wrong with them. [Fernandes2020] sec. 4.1.2 and 4.3."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.controllers.free_flyer.ports import ARM, Behaviour, unit_quaternion
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.plain_rotation import rotate, rotation_matrix, vector
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, parameter
from handover.cosim.blocks.units import Metre, MetrePerSecond, MetrePerSecond2, Number, Radian, Second

NAME = "HandoverStateMachine"

_VELOCITIES = {Behaviour.RIGID: (0.059, 0.021), Behaviour.COMPLIANT: (0.08, 0.037)}  # release, receive: sec. 4.1.2
_REMEDY = "move it there, or move workspace_low or workspace_high"


class InvalidHandoverParameters(InvalidParameters):
    """Parameters with which no handover is possible; `faults` lists what is wrong with them."""

    block = NAME


class HandoverTask(enum.IntEnum):
    """What is handed over to whom; sec. 5.5 has the last three."""

    HOLD = 0
    ROBOT_TO_HUMAN = 1
    HUMAN_TO_ROBOT = 2
    COLLABORATIVE = 3


@dataclass(frozen=True, kw_only=True)
class Params:
    """Places, thresholds and times; velocities, angle and handover place as stated, all else assumed."""

    task: HandoverTask = parameter(
        HandoverTask.HOLD,
        "HOLD stays at the handover place and yields; COLLABORATIVE gives, waits there, and receives",
        origin=assumed("sec. 5.5; hold is for trying the impedance control"),
    )
    behaviour: Behaviour = parameter(
        Behaviour.RIGID, "behaviour that the velocities below are for", origin=stated("table 4.1")
    )
    release_velocity: MetrePerSecond = parameter(
        0.0,
        "speed of the gripper above which it is pulled; 0: as stated for the behaviour",
        minimum=0.0,
        maximum=10.0,
        origin=stated("0 stands for published.velocity_hand by behaviour, sec. 4.1.2"),
    )
    receive_velocity: MetrePerSecond = parameter(
        0.0,
        "speed above which an object is put into it; 0: as stated for the behaviour",
        minimum=0.0,
        maximum=10.0,
        origin=stated("0 stands for published.velocity_gripper by behaviour, sec. 4.1.2"),
    )
    angle_threshold: Radian = parameter(
        0.71,
        "gripper angle above which a closed gripper holds something",
        minimum=0.0,
        maximum=6.3,
        origin=stated("sec. 4.1.2, beta"),
    )
    p_WG_handover: Vector3[Metre] = parameter(
        np.array([0.0, -0.07, 0.0]), "where the gripper hands over", origin=stated("sec. 4.1.3, 4.3.1")
    )
    q_WG_handover: Vector4[Number] = parameter(
        np.array([1.0, 0.0, 0.0, 0.0]), "its orientation there", origin=stated("sec. 4.3.1: 0 orientation in all axes")
    )
    p_WO_0: Vector3[Metre] = parameter(
        np.array([-0.10, -0.57, 0.0]), "where the object is fetched: its centre", origin=NOT_GIVEN
    )
    p_OG: Vector3[Metre] = parameter(
        np.array([0.0, -0.07, 0.0]),
        "where it is gripped, seen from its centre, in the world",
        minimum=-1.0,
        maximum=1.0,
        origin=derived("as handover_place.p_OG"),
    )
    q_WG_object: Vector4[Number] = parameter(
        np.array([1.0, 0.0, 0.0, 0.0]), "orientation of the gripper at the object", origin=NOT_GIVEN
    )
    approach: Metre = parameter(
        0.15, "length of the straight approach to the object, along -x of G", minimum=0.0, maximum=5.0, origin=NOT_GIVEN
    )
    p_WG_retreat: Vector3[Metre] = parameter(
        np.array([0.40, -0.07, 0.0]), "where the gripper retreats to", origin=NOT_GIVEN
    )
    p_BG: Vector3[Metre] = parameter(
        ARM,
        "gripper, seen from the centre of mass",
        minimum=-5.0,
        maximum=5.0,
        origin=assumed("not given: Astrobee's arm stretched out"),
    )
    workspace_low: Vector3[Metre] = parameter(
        np.array([-0.30, -1.5, -1.5]),
        "smallest coordinates of gripper and robot: the person is beyond, at -x",
        origin=NOT_GIVEN,
    )
    workspace_high: Vector3[Metre] = parameter(
        np.array([2.0, 1.5, 1.5]), "largest coordinates of gripper and robot", origin=NOT_GIVEN
    )
    gated: bool = parameter(
        True,
        "the robot yields, signals and heeds the speed only once at rest; else as soon as it is within gate_error",
        origin=assumed("not given: fig. 3.1 has no condition of rest between arrival, impedance control and signal"),
    )
    gate_error: Metre = parameter(
        0.05,
        "distance from the handover place below which impedance control may begin",
        minimum=1e-4,
        maximum=10.0,
        origin=NOT_GIVEN,
    )
    gate_speed: MetrePerSecond = parameter(
        0.01, "speed below which the gripper is at rest", minimum=1e-4, maximum=10.0, origin=NOT_GIVEN
    )
    tolerance: Metre = parameter(
        0.01,
        "distance from the goal at which it has arrived, and at which it signals",
        minimum=1e-4,
        maximum=10.0,
        origin=NOT_GIVEN,
    )
    tolerance_angle: Radian = parameter(
        0.05, "angle at which it has arrived anywhere", minimum=1e-3, maximum=3.2, origin=NOT_GIVEN
    )
    settle_time: Second = parameter(
        0.5, "time at rest and in place that makes it arrived", minimum=0.0, maximum=60.0, origin=NOT_GIVEN
    )
    gripper_time: Second = parameter(
        1.0, "time that opening or closing takes", minimum=0.0, maximum=60.0, origin=NOT_GIVEN
    )
    signal_time: Second = parameter(1.0, "time that the light is on", minimum=0.0, maximum=60.0, origin=NOT_GIVEN)
    pause: Second = parameter(
        4.0,
        "COLLABORATIVE: time from the release to the next signal, at least",
        minimum=0.0,
        maximum=600.0,
        origin=NOT_GIVEN,
    )
    filter_time: Second = parameter(
        0.08, "time constant of the velocity's low-pass", minimum=0.0, maximum=10.0, origin=NOT_GIVEN
    )
    gradual: bool = parameter(
        False,
        "the fingers follow pull and push on the way to the threshold, and back, instead of waiting for it",
        origin=derived("sec. 6.3 proposes it; sec. 3.1.2 opens the gripper at the threshold"),
    )
    gradual_share: Number = parameter(
        0.5,
        "gradual: part of the threshold above which they follow the speed",
        minimum=0.0,
        maximum=0.95,
        origin=NOT_GIVEN,
    )
    pull_acceleration: MetrePerSecond2 = parameter(
        0.15,
        "gradual: acceleration above which the gripper is pulled: thrust gives less",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("not given: Astrobee's thrust accelerates the gripper by less than 0.13 m/s2"),
    )
    braking: MetrePerSecond2 = parameter(
        0.03,
        "gradual: deceleration at which a pull has ended: thrust gives more",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("not given: less than thrust brakes it by"),
    )
    free_angle: Radian = parameter(
        0.25,
        "gradual, verify: how far they open from what they hold until it is free for certain",
        minimum=0.0,
        maximum=3.0,
        origin=assumed("not given: more than person.release_angle"),
    )
    verify: bool = parameter(
        False,
        "after a release the fingers close once more: where they hold something, it was not taken",
        origin=assumed("not given: sec. 3.2 takes what was released for delivered"),
    )
    verify_wait: Second = parameter(
        0.1, "verify: time from the object's being free to their closing", minimum=0.0, maximum=60.0, origin=NOT_GIVEN
    )
    attempts: int = parameter(
        5, "failed receptions, or deliveries, before it gives up", minimum=1, maximum=1000, origin=NOT_GIVEN
    )
    patience: Second = parameter(
        60.0, "time in a phase after which the robot gives up", minimum=0.1, maximum=1e5, origin=NOT_GIVEN
    )

    def velocities(self) -> tuple[float, float]:
        """Return the thresholds for release and reception; 0 for one that is neither given nor stated."""
        release, receive = _VELOCITIES.get(self.behaviour, (0.0, 0.0))
        return self.release_velocity or release, self.receive_velocity or receive

    def object_goal(self) -> Floats:
        """Return p_WG where the object is grasped."""
        return self.p_WO_0 + self.p_OG

    def standoff(self) -> Floats:
        """Return p_WG where the straight approach to the object begins."""
        R_WG = rotation_matrix(unit_quaternion(self.q_WG_object, NAME, "q_WG_object"))
        return self.object_goal() + np.array(rotate(R_WG, (self.approach, 0.0, 0.0)))

    @property
    def fetches(self) -> bool:
        """Whether the task begins with an object to be fetched."""
        return self.task in (HandoverTask.ROBOT_TO_HUMAN, HandoverTask.COLLABORATIVE)

    def check(self) -> None:
        """Raise InvalidHandoverParameters, with all faults, if the handover is not possible."""
        faults = self.faults()
        if faults:
            raise InvalidHandoverParameters(faults)

    def faults(self) -> list[str]:
        """Return what makes the handover impossible."""
        return self._place_faults() + self._velocity_faults() + self._time_faults()

    def _place_faults(self) -> list[str]:
        faults = [
            f"{name} = {q.tolist()} must be finite and not zero"
            for name, q in (("q_WG_handover", self.q_WG_handover), ("q_WG_object", self.q_WG_object))
            if not 1e-6 < np.linalg.norm(q) < np.inf
        ]
        low, high = self.workspace_low, self.workspace_high
        if not np.all(low < high):
            faults.append(f"workspace_low = {low.tolist()} must be less than workspace_high = {high.tolist()}")
        return faults or [fault for name, p_WG, q_WG in self._places() for fault in self._outside(name, p_WG, q_WG)]

    def _places(self) -> list[tuple[str, Floats, Floats]]:
        """Gripper goals of the task: name, position, orientation."""
        places = [("p_WG_handover", self.p_WG_handover, self.q_WG_handover)]
        if self.fetches:
            places.append(("p_WO_0 + p_OG", self.object_goal(), self.q_WG_object))
            places.append(("the approach to the object", self.standoff(), self.q_WG_object))
        if self.task is not HandoverTask.HOLD:
            places.append(("p_WG_retreat", self.p_WG_retreat, self.q_WG_handover))
        return places

    def _outside(self, name: str, p_WG: Floats, q_WG: Floats) -> list[str]:
        arm = rotate(rotation_matrix(unit_quaternion(q_WG, NAME, name)), vector(self.p_BG))
        low, high = self.workspace_low, self.workspace_high
        return [
            f"{name} takes the {what} to {np.round(p, 3).tolist()} m, out of the workspace from {low.tolist()} to "
            f"{high.tolist()} m: {_REMEDY}"
            for what, p in (("gripper", p_WG), ("robot's centre of mass", p_WG - np.array(arm)))
            if not np.all((low <= p) & (p <= high))
        ]

    def _velocity_faults(self) -> list[str]:
        faults: list[str] = []
        for name, v in zip(("release_velocity", "receive_velocity"), self.velocities(), strict=True):
            if v == 0.0:
                faults.append(f"{name} must be given, since none is stated for the behaviour {self.behaviour.name}")
            elif not v > self.gate_speed:
                faults.append(
                    f"{name} = {v:g} m/s must exceed gate_speed = {self.gate_speed:g} m/s, or rest exceeds it too"
                )
            elif self.gradual and not self.gradual_share * v > self.gate_speed:
                faults.append(
                    f"gradual_share = {self.gradual_share:g} of {name} = {v:g} m/s must exceed gate_speed = "
                    f"{self.gate_speed:g} m/s, or the fingers move at rest"
                )
        return faults

    def _time_faults(self) -> list[str]:
        times = {name: getattr(self, name) for name in ("settle_time", "gripper_time", "signal_time")}
        if self.task is HandoverTask.COLLABORATIVE:
            times["pause"] = self.pause
        if self.verify and self.fetches:
            times["verify_wait + gripper_time"] = self.verify_wait + self.gripper_time
        return [
            f"{name} = {time:g} s must not exceed patience = {self.patience:g} s, or it gives up first"
            for name, time in times.items()
            if self.task is not HandoverTask.HOLD and not time <= self.patience
        ]
