"""Two free-flyers that hand one large object over as one, proposed by [Fernandes2020] sec. 6.3."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from handover.controllers.free_flyer import handover_parameters
from handover.controllers.free_flyer.flyer_controller import SampledController
from handover.controllers.free_flyer.handover_state_machine import (
    HandoverPhase,
    HandoverStateMachine,
    HandoverTask,
    Pose,
    gripper_motion,
)
from handover.controllers.free_flyer.handover_state_machine import Inputs as RobotInputs
from handover.controllers.free_flyer.handover_state_machine import Outputs as RobotOutputs
from handover.controllers.free_flyer.ports import unit_quaternion
from handover.controllers.free_flyer.velocity_monitor import VelocityMonitor
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    dot,
    lerp,
    nlerp,
    rotate,
    rotation_matrix,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Radian, RadianPerSecond

_PROPOSED = assumed("sec. 6.3 proposes two robots with a larger object, and gives no values")

__all__ = ["HandoverPhase", "HandoverTask", "HandoverTeam", "Inputs", "InvalidTeamParameters", "Outputs", "Params"]

_NAME = "HandoverTeam"
_CUBE = 0.305
"""Edge of a robot, m. [Fernandes2020] sec. 2.1"""


class InvalidTeamParameters(InvalidParameters):
    """Parameters with which no handover by two robots is possible; `faults` lists what is wrong with them."""

    block = _NAME


@dataclass(frozen=True, kw_only=True)
class Params(handover_parameters.Params):
    """Those of one robot, whose places here are where the middle between both grippers goes; all are assumed."""

    p_WG_handover: Vector3[Metre] = parameter(
        np.array([0.28, 0.0, 0.0]), "where the middle between the grippers hands over", origin=_PROPOSED
    )
    p_WO_0: Vector3[Metre] = parameter(
        np.array([0.10, -0.80, 0.0]), "where the object is fetched: its centre", origin=_PROPOSED
    )
    p_OG: Vector3[Metre] = parameter(
        np.array([0.28, 0.0, 0.0]),
        "middle between the places where it is gripped, seen from its centre, in the world",
        minimum=-2.0,
        maximum=2.0,
        origin=_PROPOSED,
    )
    p_WG_retreat: Vector3[Metre] = parameter(
        np.array([0.68, 0.0, 0.0]), "where the middle between the grippers retreats to", origin=_PROPOSED
    )
    grip_spacing: Metre = parameter(
        0.50,
        "between the grippers, along y of G; the first robot's is at +y",
        minimum=_CUBE,
        maximum=2.0,
        origin=_PROPOSED,
    )
    together: bool = parameter(
        True,
        "the robots take each step together, and heed the middle's velocity; else each for itself",
        origin=derived("sec. 6.3: on two robots where the object could be simultaneously carried"),
    )

    @property
    def offsets(self) -> tuple[Vector, Vector]:
        """Each robot's place beside the middle, in G, m."""
        return (0.0, 0.5 * self.grip_spacing, 0.0), (0.0, -0.5 * self.grip_spacing, 0.0)

    def of_middle(self) -> handover_parameters.Params:
        """Return the parameters of a robot that has nothing but a gripper, in the middle between the two."""
        return replace(self._of_one(), p_BG=np.zeros(3))

    def of_robot(self, i: int) -> handover_parameters.Params:
        """Return the parameters of the first robot, 0, or the second, 1, by itself."""
        beside = {q: self._beside(q, i) for q in ("q_WG_handover", "q_WG_object")}
        return replace(
            self._of_one(),
            p_WG_handover=self.p_WG_handover + beside["q_WG_handover"],
            p_WG_retreat=self.p_WG_retreat + beside["q_WG_handover"],
            p_OG=self.p_OG + beside["q_WG_object"],
        )

    def check(self) -> None:
        """Raise InvalidTeamParameters, with all faults, if the handover is not possible."""
        first, second = (self.of_robot(i).faults() for i in (0, 1))
        both = [fault for fault in first if fault in second]
        faults = both + [
            f"robot {i}: {fault}" for i, its in ((1, first), (2, second)) for fault in its if fault not in both
        ]
        if faults:
            raise InvalidTeamParameters(faults)

    def _of_one(self) -> handover_parameters.Params:
        values: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(handover_parameters.Params)}
        return handover_parameters.Params(**values)

    def _beside(self, name: str, i: int) -> np.ndarray[Any, np.dtype[np.float64]]:
        q = getattr(self, name)
        if not 1e-6 < np.linalg.norm(q) < np.inf:
            return np.zeros(3)  # reported as a fault
        return np.array(rotate(rotation_matrix(unit_quaternion(q, _NAME, name)), self.offsets[i]))


@dataclass(kw_only=True)
class Inputs:
    """Both navigations' estimates of their base, and both grippers' angles."""

    p_WB_meas_1: Vector3[Metre] = port(np.zeros(3), "first robot: estimated position of the centre of mass")
    q_WB_meas_1: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "first robot: estimated attitude")
    v_WB_meas_1: Vector3[MetrePerSecond] = port(
        np.zeros(3), "first robot: estimated velocity of the centre of mass, in the world"
    )
    w_WB_meas_1: Vector3[RadianPerSecond] = port(np.zeros(3), "first robot: estimated angular velocity, in the world")
    gripper_angle_1: Radian = port(0.0, "first robot: angle between the gripper's main links")
    p_WB_meas_2: Vector3[Metre] = port(np.zeros(3), "second robot: estimated position of the centre of mass")
    q_WB_meas_2: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "second robot: estimated attitude")
    v_WB_meas_2: Vector3[MetrePerSecond] = port(
        np.zeros(3), "second robot: estimated velocity of the centre of mass, in the world"
    )
    w_WB_meas_2: Vector3[RadianPerSecond] = port(np.zeros(3), "second robot: estimated angular velocity, in the world")
    gripper_angle_2: Radian = port(0.0, "second robot: angle between the gripper's main links")


@dataclass(kw_only=True)
class Outputs:
    """Of each robot where its gripper is to be, which controller is on, and what gripper and light do."""

    phase_1: HandoverPhase = output("what the first robot is doing")
    p_WG_goal_1: Vector3[Metre] = output("where the first gripper is to be")
    q_WG_goal_1: Vector4[Number] = output("orientation that it is to have")
    impedance_1: bool = output("the first robot's impedance control is on")
    pose_1: bool = output("the first robot's pose control is on")
    closure_1: Number = output("first gripper's command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light_1: bool = output("the first robot's signal light")
    failed_receptions_1: int = output("times that the first gripper, or either, closed on nothing", minimum=0.0)
    failed_deliveries_1: int = output(
        "times that the first robot, or either, still had what it had released, or what it had not released was gone",
        minimum=0.0,
    )
    speed_1: MetrePerSecond = output("speed, low-passed, by which the first robot is moved by a person", minimum=0.0)
    phase_2: HandoverPhase = output("what the second robot is doing")
    p_WG_goal_2: Vector3[Metre] = output("where the second gripper is to be")
    q_WG_goal_2: Vector4[Number] = output("orientation that it is to have")
    impedance_2: bool = output("the second robot's impedance control is on")
    pose_2: bool = output("the second robot's pose control is on")
    closure_2: Number = output("second gripper's command: 0 open, 1 closed", minimum=0.0, maximum=1.0)
    light_2: bool = output("the second robot's signal light")
    failed_receptions_2: int = output("times that the second gripper, or either, closed on nothing", minimum=0.0)
    failed_deliveries_2: int = output(
        "times that the second robot, or either, still had what it had released, or what it had not released was gone",
        minimum=0.0,
    )
    speed_2: MetrePerSecond = output("speed, low-passed, by which the second robot is moved by a person", minimum=0.0)


class HandoverTeam(SampledController[Inputs, Outputs]):
    """Runs a handover by two robots that hold one object, by the rules of `HandoverStateMachine`.

    - Together: one machine for both, whose gripper is the middle between theirs. Its goals are those of the middle,
      which each robot follows at its place beside it. A transition that needs rest in place needs it of each robot. One
      that needs a gripper that holds something needs it of both. So both release in the same step, or neither, and
      after a reception of one alone both open. What has been released is gone only when neither holds it, once both
      have closed again to verify. A person's pull or push is the middle's velocity, the mean of the grippers'. What
      turns or squeezes the object has none, and releases nothing. GIVEN_UP keeps each gripper where it is.
    - Not together: a machine for each robot, which knows nothing of the other; for comparison.

    After a release robots yield until they no longer move away from their place. The pull leads both towards the
    person. The impedance's spring brakes them with all their thrust, a retreat's trajectory only by the bound of its
    acceleration, which is lower (both assumed).

    Raises:
        InvalidTeamParameters: by the constructor, for goals out of reach of either robot, or thresholds or times that
            cannot work; all are named.
        InvalidOrientation: an estimated attitude is zero or not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        (f.name for f in fields(Outputs)), tuple(f.name for f in fields(Inputs))
    )
    terminals: ClassVar[tuple[Terminal, ...]] = tuple(
        t
        for r in (1, 2)
        for t in (
            terminal(f"estimate_{r}", TerminalKind.MOTION, **{f"{x}_WB_meas": f"{x}_WB_meas_{r}" for x in "pqvw"}),
            terminal(f"goal_{r}", TerminalKind.POSE, **{f"{x}_WG_goal": f"{x}_WG_goal_{r}" for x in "pq"}),
        )
    )

    def __init__(self, params: Params) -> None:
        params.check()
        self._params, self._T = params, float(self.period)
        self._p_BG = vector(params.p_BG)
        self._middle = _MiddleMachine(params, self._T) if params.together else None
        self._robots = [] if params.together else [_YieldingMachine(params.of_robot(i)) for i in (0, 1)]

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Measure, decide, and return the commands that hold until t + dt; at most one transition."""
        seen = [_seen_by(u, 1), _seen_by(u, 2)]
        if self._middle is None:
            return _outputs([robot.step(t, dt, its) for robot, its in zip(self._robots, seen, strict=True)])
        (p_1, q_1, v_1), (p_2, q_2, v_2) = (gripper_motion(its, self._p_BG, _NAME) for its in seen)
        self._middle.measure([(p_1, q_1), (p_2, q_2)], [v_1, v_2])
        y = self._middle.step(
            t,
            dt,
            RobotInputs(
                p_WB_meas=np.array(lerp(p_1, p_2, 0.5)),
                q_WB_meas=np.array(nlerp(q_1, q_2, 0.5)),
                v_WB_meas=np.array(lerp(v_1, v_2, 0.5)),
                gripper_angle=self._middle.angle_of(u.gripper_angle_1, u.gripper_angle_2),
            ),
        )
        goals = self._middle.goals()
        return _outputs([replace(y, p_WG_goal=np.array(p), q_WG_goal=np.array(q)) for p, q in goals])

    def get_state(self) -> bytes:
        """Return the complete state."""
        machines = self._robots if self._middle is None else [self._middle]
        return pack_state([machine.get_state() for machine in machines])

    def set_state(self, state: bytes) -> None:
        """Restore a state of this team or of one with equal parameters."""
        machines = self._robots if self._middle is None else [self._middle]
        for machine, its in zip(machines, unpack_state(state), strict=True):
            machine.set_state(its)


class _YieldingMachine(HandoverStateMachine):
    """The machine of a robot that yields after its release until it no longer follows the pull."""

    def __init__(self, params: handover_parameters.Params) -> None:
        super().__init__(params)
        self._p_WG = ZERO  # as of this step

    def _count_settled(self, here: Pose) -> None:
        super()._count_settled(here)
        self._p_WG, _ = here

    def _release_object(self, angle: float) -> HandoverPhase | None:
        place = self._p_WG if self._goal is None else self._goal[0]
        recedes = dot(self._monitor.velocity, subtract(self._p_WG, place)) > 0.0
        brakes = recedes and not self._params.verify  # a robot that verifies coasts
        return None if brakes else super()._release_object(angle)


class _MiddleMachine(_YieldingMachine):
    """The machine of the middle between two grippers, which has arrived where each of them has."""

    def __init__(self, params: Params, period: float) -> None:
        super().__init__(params.of_middle())
        self._offsets = params.offsets
        self._monitors = [VelocityMonitor(params.filter_time, period) for _ in self._offsets]
        self._heres: list[Pose] = []
        self._stays: list[Pose] | None = None
        """Where each gripper stays while it has not been sent anywhere."""

    def measure(self, heres: Sequence[Pose], velocities: Sequence[Vector]) -> None:
        """Take in pose and velocity, m/s, of each gripper."""
        self._heres = list(heres)
        for monitor, v in zip(self._monitors, velocities, strict=True):
            monitor.measure(v)
        if self._goal is None:
            self._stays = self._heres

    def angle_of(self, first: float, second: float) -> float:
        """Return the angle, rad, that counts for both: of the one that holds less, or, to verify a release, more."""
        return (max if self._phase is HandoverPhase.VERIFY_RELEASE else min)(first, second)

    def goals(self) -> list[Pose]:
        """Return where each gripper is to be."""
        if self._stays is not None or self._goal is None:
            return self._stays or self._heres
        p_WG, q_WG = self._goal
        R = rotation_matrix(q_WG)
        return [(add(p_WG, rotate(R, beside)), q_WG) for beside in self._offsets]

    def get_state(self) -> bytes:
        """Return that of the machine, and of each gripper where it stays and how fast it was."""
        return pack_state((super().get_state(), self._stays, [monitor.get_state() for monitor in self._monitors]))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this machine or of one with equal parameters."""
        machine, stays, monitors = unpack_state(state)
        super().set_state(machine)
        self._stays = None if stays is None else list(stays)
        for monitor, its in zip(self._monitors, monitors, strict=True):
            monitor.set_state(its)

    def _count_settled(self, here: Pose) -> None:
        super()._count_settled(here)
        each = [
            self._in_place(goal, at, monitor.speed)
            for goal, at, monitor in zip(self.goals(), self._heres, self._monitors, strict=True)
        ]
        self._near = all(near for near, _ in each)
        if not all(settled for _, settled in each):
            self._settled = 0

    def _enter(self, phase: HandoverPhase, here: Pose) -> None:
        before = self._goal
        super()._enter(phase, here)
        if phase is HandoverPhase.GIVEN_UP:
            self._stays = self._heres
        elif self._goal != before:
            self._stays = None


def _seen_by(u: Inputs, robot: int) -> RobotInputs:
    return RobotInputs(**{f.name: getattr(u, f"{f.name}_{robot}") for f in fields(RobotInputs)})


def _outputs(ys: Sequence[RobotOutputs]) -> Outputs:
    values: dict[str, Any] = {}
    for i, y in enumerate(ys, 1):
        values |= {f"{name}_{i}": value for name, value in vars(y).items() if name != "speed_G"}
        values[f"speed_{i}"] = y.speed_G
    return Outputs(**values)
