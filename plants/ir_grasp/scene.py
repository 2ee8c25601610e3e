"""A soft hand with infrared sensors on its fingertips and an object on a table, seen from above, after [Luberto]."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.ports import Vector2, Vector3, Vector8, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Newton, Number, Radian, Tick
from handover.plants.ir_grasp.parameters import InvalidSceneParameters, Params
from handover.plants.ir_grasp.sensing import Sensing
from handover.plants.ir_grasp.world import DT, Command, GraspWorld, initial_snapshot

_CHECKPOINT = 500  # internal steps after which the world is rebuilt from its own snapshot


class StepSizeError(ValueError):
    """A step is not a multiple of the internal time step; nothing has changed."""

    is_refusal = True

    def __init__(self, dt: float) -> None:
        steps = max(int(dt / DT), 1)
        super().__init__(
            f"GraspScene: a step of {dt:.6g} s is not a multiple of the internal step {DT:g} s; "
            f"{steps * DT:.6g} s or {(steps + 1) * DT:.6g} s would fit"
        )
        self.dt = dt


class InvalidCommand(InvalidParameters):
    """A command that is not finite; `faults` names the inputs."""

    block = "GraspScene"


@dataclass(kw_only=True)
class Inputs:
    """Commands to arm and hand."""

    p_WH_cmd: Vector2[Metre] = port(np.array([-0.25, 0.0]), "commanded position of the wrist, in the world")
    yaw_cmd: Radian = port(0.0, "commanded orientation of the hand")
    sigma_cmd: Number = port(0.0, "commanded closure: 0 open, 1 closed", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    """What encoders and sensors measure, and where things are; three entries are of thumb, index and ring finger."""

    p_WH: Vector2[Metre] = output("position of the wrist, in the world")
    yaw: Radian = output("orientation of the hand")
    sigma: Number = output("closure that the motor has reached", minimum=0.0, maximum=1.0)
    p_WH_meas: Vector2[Metre] = output("position of the wrist by the arm's encoders, in the world")
    yaw_meas: Radian = output("orientation of the hand by the arm's encoders")
    sigma_meas: Number = output("closure by the motor's encoder")
    ticks: Vector3[Tick] = output("last readings of the sensors")
    q: Vector8[Radian] = output("joint angles: thumb 2, index 3, ring 3")
    tension: Newton = output("tension of the tendon")
    q_meas: Vector8[Radian] = output("joint angles by their encoders: thumb 2, index 3, ring 3")
    tension_meas: Newton = output("tension of the tendon by the motor's current")
    p_WO: Vector2[Metre] = output("position of the object, in the world")
    yaw_O: Radian = output("orientation of the object, that of its reference pose included")
    p_ground: Vector2[Metre] = output("how far the ground under the object has carried it, or what stands still on it")
    p_WX: Vector2[Metre] = output("position of the second object, in the world; 0 if there is none")
    touching: int = output("number of the hand's bodies, of palm and 8 phalanges, that touch the object")
    range: Vector3[Metre] = output(
        "distance of the object along the middle of each sensor's beam, whatever hides it; 0.2 if none is met"
    )


class GraspScene:
    """Soft hand, object and table in the plane x-y of W, with three infrared sensors, after [Luberto] sec. III, V.

    - Hand: a palm that follows the wrist's command with bounded speed and acceleration (`follow`). On its right
      (-y of H) it has a thumb of 2 phalanges, on its left index and ring finger of 3. One elastic tendon,
      T = k max(0, sigma L - sum r q), turns all joints, so a blocked finger lets the others close further.
    - Object: rigid, with dry friction on the table and in the hand; `SOLIDS` has the shapes. The ground below it may
      move, as a belt that carries it (`carry_velocity`) or a bump (`nudge`): then friction acts against that motion.
      A second object, a disc that stands at rest, may be pushed by hand and object.
    - Sensors: on the distal phalanges, one active at a time (sec. V-B), for 5 ms (assumed), in the order of the
      fingers; it is read at the end of its time. A reading is the mean over three rays of the beam of
      `InfraredSensor.ticks`, plus noise, rounded. At the start all three have been read. Only objects return
      light, and no finger hides them, unless `fingers_seen`. `Sensing` has what else disturbs readings and encoders.

    Contacts are solved by pymunk, in steps of 1 ms; a step of the block is a multiple of that. pymunk's solver starts
    from impulses that cannot be read. So that a state is complete, the world is rebuilt from its positions and
    velocities every 500 internal steps; a state is that snapshot and the commands since, which `set_state` replays.

    Raises:
        InvalidSceneParameters: by the constructor, for parameters of which no scene can be built, or a hand that would
            start in the object.
        StepSizeError: by `step`, for steps that are no multiple of 1 ms.
        InvalidCommand: by `step`, for commands that are not finite; all are named.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal(
            "encoders",
            TerminalKind.MEASUREMENTS,
            p_WH="p_WH_meas",
            yaw="yaw_meas",
            sigma="sigma_meas",
            tension="tension_meas",
            q="q_meas",
        ),
        terminal("hand", TerminalKind.COMMAND, "p_WH_cmd", "yaw_cmd", "sigma_cmd"),
    )
    period: ClassVar[Fraction | None] = None
    variable_step: ClassVar[bool] = False

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        self._checkpoint = initial_snapshot(params)
        self._since: list[tuple[int, Command]] = []  # internal steps and their command
        self._replayed = 0  # internal steps since the checkpoint
        self._world = GraspWorld(params, self._checkpoint)
        _check_overlap(self._world)
        self._sensing = Sensing(params, self._world)

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where everything is and what was read last; no time passes."""
        w = self._world
        x, y, yaw = w.wrist
        x_O, y_O, yaw_O = w.thing
        x_meas, y_meas, yaw_meas, sigma_meas = self._sensing.measured(w)
        q, tension = w.joints, w.tension
        q_meas, tension_meas = self._sensing.measured_joints(q, tension)
        return Outputs(
            p_WH=np.array([x, y]),
            yaw=yaw,
            sigma=w.sigma,
            p_WH_meas=np.array([x_meas, y_meas]),
            yaw_meas=yaw_meas,
            sigma_meas=sigma_meas,
            ticks=np.array(self._sensing.ticks),
            q=np.array(q),
            tension=tension,
            q_meas=np.array(q_meas),
            tension_meas=tension_meas,
            p_WO=np.array([x_O, y_O]),
            yaw_O=yaw_O,
            p_ground=np.array(w.ground),
            p_WX=np.zeros(2) if w.other is None else np.array(w.other),
            touching=w.touching,
            range=np.array(self._sensing.ranges(w)),
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        steps = round(dt / DT)
        if steps < 1 or abs(steps * DT - dt) > 1e-6 * DT:
            raise StepSizeError(dt)
        command = _command(u)
        while steps > 0:
            if self._replayed == _CHECKPOINT:
                self._renew()
            n = min(steps, self._sensing.until_reading, _CHECKPOINT - self._replayed)
            self._advance(n, command)
            self._sensing.advance(n, self._world)
            steps -= n
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the last checkpoint, the commands since, and the sensors."""
        return pack_state((self._checkpoint, self._since, self._sensing.get_state()))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this scene or of one with equal parameters."""
        self._checkpoint, since, sensing = unpack_state(state)
        self._sensing.set_state(sensing)
        self._world, self._since, self._replayed = GraspWorld(self._params, self._checkpoint), [], 0
        for steps, command in since:
            self._advance(steps, command)

    def _advance(self, steps: int, command: Command) -> None:
        for _ in range(steps):
            self._world.advance(command)
        if self._since and self._since[-1][1] == command:
            steps_before, _ = self._since.pop()
            self._since.append((steps_before + steps, command))
        else:
            self._since.append((steps, command))
        self._replayed += steps

    def _renew(self) -> None:
        self._checkpoint, self._since, self._replayed = self._world.snapshot, [], 0
        self._world = GraspWorld(self._params, self._checkpoint)


def _command(u: Inputs) -> Command:
    """Return what is commanded, without negative zeros: equal commands are kept once."""
    x, y, yaw, sigma = *u.p_WH_cmd.tolist(), float(u.yaw_cmd), float(u.sigma_cmd)
    if not all(map(math.isfinite, (x, y, yaw, sigma))):
        commands = {"p_WH_cmd": (x, y), "yaw_cmd": (yaw,), "sigma_cmd": (sigma,)}
        wrong = {name: values for name, values in commands.items() if not all(map(math.isfinite, values))}
        raise InvalidCommand([f"{name} must be finite, not {list(values)}" for name, values in wrong.items()])
    return x + 0.0, y + 0.0, yaw + 0.0, min(max(sigma, 0.0), 1.0) + 0.0


def _check_overlap(world: GraspWorld) -> None:
    """Refuse a start in which two bodies are in one another."""
    faults: list[str] = []
    if overlaps := world.overlaps():
        faults.append(
            f"the hand would start in the object: {_depths(overlaps)}; choose p_WH_0, yaw_H_0 or sigma_0 clear of it"
        )
    if overlaps := world.overlaps_of_other():
        faults.append(
            f"the second object would start in what is there: {_depths(overlaps)}; choose p_WX_0 or other_radius clear "
            "of hand and object"
        )
    if faults:
        raise InvalidSceneParameters(faults)


def _depths(overlaps: list[tuple[str, float]]) -> str:
    return ", ".join(f"{name} by {1e3 * depth:.2g} mm" for name, depth in overlaps)
