"""Arm with one to three links of variable stiffness, its motors, air and sensors, after [Gandarias2020]."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.ports import Floats, Polyline25, Vector2, Vector3, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Ampere, Kilogram, Metre, Newton, Pascal, Radian, RadianPerSecond
from handover.plants.vsl.actuators import PressureLine, VslServo
from handover.plants.vsl.chain import Complexes, Pose, VslChain
from handover.plants.vsl.dynamics import NoConvergence, StartsInFace, VslDynamics
from handover.plants.vsl.parameters import (
    MAX_ANGLE,
    MAX_LOAD,
    MAX_PRESSURE,
    InvalidVslArmParameters,
    Link,
    Motion,
    Params,
)
from handover.plants.vsl.sensors import Sensors, quantized
from handover.plants.vsl.statics import NoEquilibrium, VslStatics

__all__ = ["Inputs", "InvalidInput", "InvalidVslArmParameters", "Link", "Motion", "Outputs", "Params", "VslArm"]


class InvalidInput(InvalidParameters):
    """Inputs that are not finite, or an angle, load or pressure out of range; `faults` lists all of them."""

    block = "VslArm"


@dataclass(kw_only=True)
class Inputs:
    """Commands to motors and regulators, and what hangs on the gripper."""

    q_cmd: Vector3[Radian] = port(
        np.array([0.0, 0.8411, -1.6821]), "commanded joint angles", minimum=-MAX_ANGLE, maximum=MAX_ANGLE
    )
    qd_cmd: Vector3[RadianPerSecond] = port(
        np.zeros(3), "speeds at which the joints go there, whatever their sign; 0: as fast as they can"
    )
    p_cmd: Vector2[Pascal] = port(
        np.array([1.0e5, 1.0e5]), "commanded pressures of links 2 and 3", minimum=0.0, maximum=MAX_PRESSURE
    )
    p_cmd_4: Pascal = port(1.0e5, "commanded pressure of the third of three links", minimum=0.0, maximum=MAX_PRESSURE)
    load: Kilogram = port(0.0, "mass that hangs on the gripper", minimum=0.0, maximum=MAX_LOAD)


@dataclass(kw_only=True)
class Outputs:
    """What the robot's computer and the tracker measure, and where the arm is."""

    q_meas: Vector3[Radian] = output("joint angles by the encoders, which do not see what is behind the gears")
    i_meas: Vector3[Ampere] = output("currents of the motors, positive for a torque that turns the joint forwards")
    p_meas: Vector2[Pascal] = output("pressures of links 2 and 3 by the transducers")
    p_meas_4: Pascal = output("pressure of the third of three links by its transducer; of fewer: 0")
    tilt_meas: Vector2[Radian] = output("angles of the ends of links 2 and 3 above the horizontal, by accelerometers")
    tilt_meas_4: Radian = output("angle of the end of the third of three links above the horizontal; of fewer: 0")
    p_WG: Vector3[Metre] = output("position of the gripper")
    p_WG_meas: Vector3[Metre] = output("position of the gripper by the tracker")
    f_G: Newton = output("largest force within the step of the face that stops the gripper, upwards")
    shape: Polyline25[Metre] = output(
        "centre line: the base, 12 points on link 2, 12 from there to the gripper; on a single link all 24"
    )


class VslArm:
    """Arm that bends under its weight, by a pseudo-rigid chain in the plane that J1 turns, after [Gandarias2020].

    It has two links; or one, with the gripper at its end; or a third, screwed to link 3 without a joint (fig. 2).

    - W has its origin at the foot of the axis of J1, z up. With stiff links and joints p_WG is the last column of
      eq. (1), for angles q = (theta_1, theta_2, theta_3), theta_2 from the horizontal, theta_3 from link 2.
    - Bodies, springs: `VslChain`. QUASI_STATIC: at rest at every instant, `VslStatics`. DYNAMIC: `VslDynamics`.
    - Servos go to q_cmd at qd_cmd, `VslServo`. Under the torque tau of J2 or J3 the encoder shows
      q = q_aim - tau / servo_stiffness (with a lag, if DYNAMIC); the joint yields by tau / joint_stiffness more,
      behind the encoder. Friction shows in the current only. J1 carries no weight and does not yield: its current is
      friction and what changes the arm's angular momentum about it, (I w)' = I w' + I' w.
    - Air: `PressureLine`. A rigid link has a line that is closed behind the transducer.
    - J1 may be a stepper motor: it stands at the nearest whole step, which it counts. Commands and readings may be
      rounded to what a converter resolves. Noise of the readings, tilt by accelerometers: `Sensors`.

    The arm starts at rest in q_0 with the load of its first instant; a load that is put on later has the gripper's
    velocity. What hangs on it is the input, or, from its first time on, what `load_steps` says. A step ends with the
    rest or motion under the inputs held during it.

    Raises:
        InvalidVslArmParameters: by the constructor, for parameters of which no arm can be built.
        InvalidInput: by `outputs` and `step`, which then change nothing.
        NoEquilibrium: by `outputs` and `step`, if the load buckles the arm; of an arm that swings by `outputs` and the
            first `step` alone: later it falls over, as an arm would.
        StartsInFace: by `outputs` and `step`, if it would start below the face.
        NoConvergence: by `step`, if there is no solution of the equations of motion.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("joints", TerminalKind.COMMAND, "q_cmd", "qd_cmd"),
        terminal("sensors", TerminalKind.MEASUREMENTS, "q_meas", "p_meas", "i_meas"),
    )

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        dynamic = params.motion is Motion.DYNAMIC
        self._chain = VslChain(params, params.hinges_dynamic if dynamic else params.hinges)
        self._mechanics: VslStatics | VslDynamics = (
            VslDynamics(self._chain, params)
            if dynamic
            else VslStatics(self._chain, params.gravity, 1.0 / params.servo_stiffness)
        )
        friction: list[float] = (params.gear_friction * params.friction_factor).tolist()
        self._servos = [
            VslServo(angle, params.servo_speed, params.kt, friction, params.sliding)
            for angle, friction in zip(params.q_0.tolist(), friction, strict=False)
        ][: 1 + len(self._chain.joints)]
        self._lines = [
            PressureLine(p, params.pressure_time, params.leak_time, params.valve_tolerance, params.valve_band)
            for p in (*params.p_0.tolist(), params.p_4_0)[: params.links]
        ]
        self._parts = (self._mechanics, *self._servos, *self._lines)
        self._loads = params.loads()
        self._sensors = Sensors(params, self._chain.sensors)
        self._qd_1 = 0.0
        self._q = [0.0] * len(self._servos)  # what the encoders show, and the currents, without noise
        self._i = list(self._q)
        self._started = False

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return where the arm is, at the start at rest with its load; no time passes."""
        if not self._started:
            _check_inputs(u)
            self._rest(self._load(t, u))
        return self._seen()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        _check_inputs(u)
        before, load = self._snapshot(), self._load(t, u)
        try:
            if not self._started:
                self._rest(load)
                self._started = True
            self._advance(dt, u, load)
        except (NoEquilibrium, NoConvergence, StartsInFace):
            self._restore(before)
            raise
        self._sensors.draw()
        return self._seen()

    def get_state(self) -> bytes:
        """Return the complete state, random generator included."""
        return pack_state((self._snapshot(), self._sensors.get_state()))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this arm or of one with equal parameters."""
        snapshot, sensors = unpack_state(state)
        self._restore(snapshot)
        self._sensors.set_state(sensors)

    def _snapshot(self) -> tuple[Any, ...]:
        """Return all that a step changes before it can fail, as references: nothing of it is ever written to."""
        return [part.snapshot() for part in self._parts], self._qd_1, self._q, self._i, self._started

    def _restore(self, snapshot: tuple[Any, ...]) -> None:
        parts, self._qd_1, self._q, self._i, self._started = snapshot
        for part, own in zip(self._parts, parts, strict=True):
            part.restore(own)

    def _rest(self, load: float) -> None:
        self._mechanics.settle(self._aims()[1:], self._pressures(), load)
        self._q = self._shown()
        for servo, q in zip(self._servos, self._q, strict=True):
            servo.rest(q)
        self._i = self._currents(0.0)

    def _load(self, t: float, u: Inputs) -> float:
        """Return what hangs on the gripper in a step from t."""
        scheduled = self._loads.at(t)
        return u.load if scheduled is None else scheduled[0]

    def _advance(self, dt: float, u: Inputs, load: float) -> None:
        first = self._aims()
        P = self._params
        for servo, command, speed in zip(self._servos, u.q_cmd.tolist(), u.qd_cmd.tolist(), strict=False):
            servo.move(quantized(command, P.encoder_step), speed, dt)
        for line, p_cmd in zip(self._lines, (*u.p_cmd.tolist(), u.p_cmd_4), strict=False):
            line.advance(dt, quantized(p_cmd, P.regulator_step))
        last = self._aims()
        before, pose = self._qd_1, self._mechanics.pose
        self._qd_1 = (last[0] - first[0]) / dt
        self._mechanics.advance(dt, (first[1:], last[1:]), self._pressures(), load, self._qd_1)
        self._q = self._shown()
        for servo, q in zip(self._servos, self._q, strict=True):
            servo.slide(q)
        L = self._angular_momentum(self._qd_1, self._mechanics.pose, load)
        self._i = self._currents((L - self._angular_momentum(before, pose, load)) / dt)

    def _angular_momentum(self, qd_1: float, pose: Pose, load: float) -> float:
        """Return that about the axis of J1, which turns at the speed qd_1, kg m2/s."""
        return self._chain.inertia_about_J1(pose, load) * qd_1 if qd_1 else 0.0

    def _aims(self) -> tuple[float, ...]:
        return tuple(servo.angle for servo in self._servos)

    def _pressures(self) -> tuple[float, ...]:
        return tuple(line.p for line in self._lines)

    @property
    def _theta_1(self) -> float:
        """Where J1 stands."""
        return quantized(self._servos[0].angle, self._params.base_step)

    def _shown(self) -> list[float]:
        """Return what encoders, and the count of a stepper motor, show, without noise."""
        pose = self._mechanics.pose
        aims = self._aims()[1:]
        return [self._theta_1, *(aim - droop for aim, droop in zip(aims, pose.droop, strict=True))]

    def _currents(self, tau_1: float) -> list[float]:
        """Return the currents, without noise, for a torque of J1 and those that hold the links."""
        i = [
            servo.current(torque)
            for servo, torque in zip(self._servos, (tau_1, *self._mechanics.pose.torque), strict=True)
        ]
        return [0.0, *i[1:]] if self._params.base_step else i

    def _seen(self) -> Outputs:
        pose = self._mechanics.pose
        ends = self._chain.ends(pose)
        p_WG = self._in_world(ends[-1:])[0]
        shape = np.zeros((25, 3))
        shape[1:] = self._in_world(self._chain.centre_line(ends))
        read = self._sensors.read(self._q, self._i, self._pressures(), p_WG)
        tilts = self._sensors.tilts(pose, self._mechanics.acceleration(self._qd_1))
        return Outputs(
            q_meas=read.q,
            i_meas=read.i,
            p_meas=read.p[:2],
            p_meas_4=float(read.p[2]),
            tilt_meas=np.array(tilts[:2]),
            tilt_meas_4=tilts[2],
            p_WG=p_WG,
            p_WG_meas=read.p_WG,
            f_G=self._mechanics.force,
            shape=shape,
        )

    def _in_world(self, points: Complexes) -> Floats:
        """Return points of the arm's plane, seen from the shoulder, in W, (k, 3)."""
        theta_1 = self._theta_1
        p = np.empty((len(points), 3))
        p[:, 0] = math.cos(theta_1) * points.real
        p[:, 1] = math.sin(theta_1) * points.real
        p[:, 2] = self._params.L_1 + points.imag
        return p


def _check_inputs(u: Inputs) -> None:
    """Raise InvalidInput for what is not finite, and for an angle, load or pressure out of range."""
    faults: list[str] = []
    if not np.isfinite((*u.q_cmd, *u.qd_cmd, *u.p_cmd)).all():
        faults.append(f"q_cmd {u.q_cmd}, qd_cmd {u.qd_cmd} and p_cmd {u.p_cmd} must be finite")
    else:
        if not float(np.abs(u.q_cmd).max()) <= MAX_ANGLE:
            faults.append(f"q_cmd {u.q_cmd} rad must be from {-MAX_ANGLE:.4g} to {MAX_ANGLE:.4g} rad")
        if not 0.0 <= min(u.p_cmd) <= max(u.p_cmd) <= MAX_PRESSURE:
            faults.append(f"p_cmd {u.p_cmd} Pa must be from 0 to {MAX_PRESSURE:g} Pa")
    if not 0.0 <= u.p_cmd_4 <= MAX_PRESSURE:
        faults.append(f"p_cmd_4 {u.p_cmd_4:g} Pa must be from 0 to {MAX_PRESSURE:g} Pa")
    if not 0.0 <= u.load <= MAX_LOAD:
        faults.append(f"load {u.load:g} kg must be from 0 to {MAX_LOAD:g} kg")
    if faults:
        raise InvalidInput(faults)
