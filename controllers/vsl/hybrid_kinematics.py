"""Model-based and hybrid, learning-based kinematics of the VSL arm. [Gandarias2020] secs. III-A, IV-B and IV-C."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.vsl.feedback import (
    CurrentFilter,
    ImuTip,
    ModelMonitor,
    TipFeedback,
    VibrationDamping,
    is_moving,
)
from handover.controllers.vsl.kinematics import ArmParameters, Elbow, VslKinematics
from handover.controllers.vsl.learned_model import Learned, VslModel
from handover.controllers.vsl.model_text import InvalidModel, read_model
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Ampere, Hertz, Metre, Number, Pascal, PerSecond, Radian, RadianPerSecond, Second

__all__ = [
    "Elbow",
    "HybridKinematics",
    "Imu",
    "Inputs",
    "InvalidModel",
    "Learned",
    "Method",
    "Outputs",
    "Params",
    "UnusedParameters",
]

_SHIPPED = {
    (Learned.CUBIC, False): "cubic",
    (Learned.CUBIC, True): "friction",
    (Learned.SMALL, False): "small",
    (Learned.PHYSICS, False): "physics",
}
"""Names of the models that ship, by what they are and whether they were trained on currents without friction.

Each was written by `train_command` with `--points 1500 --seed 0 --out controllers/vsl/models/NAME.json`.
"""


_PERIOD = Fraction(1, 50)  # s

LENGTHS = ("L_1", "L_2", "L_3")
"""Parameters of the links' lengths: of the kinematics, of planners and of the arm."""


class Method(enum.IntEnum):
    """How joint angles are commanded and the tip's position is estimated."""

    MODEL_BASED = 0
    HYBRID = 1
    ESTIMATE = 2


class Imu(enum.IntEnum):
    """Inertial measurement units at the ends of links 2 and 3, the paper's future work, and what they are for.

    NONE: there are none. MONITOR: they tell that the arm is not the one that was learned from. FEEDBACK: besides, the
    joints turn until they see the tip where it is wanted.
    """

    NONE = 0
    MONITOR = 1
    FEEDBACK = 2


@dataclass(frozen=True, kw_only=True)
class Params(ArmParameters):
    """Method, model and arm; the lengths are assumed."""

    method: Method = parameter(Method.HYBRID, "rigid kinematics, with what was learned, or with its estimate only")
    learned: Learned = parameter(
        Learned.CUBIC,
        "what corrects: polynomials, a small network, the paper's, which needs a model, or a beam",
        origin=assumed("sec. IV-B has networks; polynomials of third degree learn the same from fewer points"),
    )
    model: str = parameter(
        "",
        "JSON file of a trained model; empty: the one that ships; no published one does",
        origin=assumed("the trained model that ships; the paper's is not public"),
    )
    friction_compensation: bool = parameter(
        False,
        "free the currents of gear friction by which way each joint has been turning",
        origin=stated("sec. VI names time series of data as future work"),
    )
    closed_loop: bool = parameter(
        False,
        "turn the joints until the tracker sees the tip where it is wanted",
        origin=stated("sec. VI names closed-loop control as future work; the paper's is open loop"),
    )
    imu: Imu = parameter(
        Imu.NONE,
        "IMUs at the links' ends: none, to monitor the learned model, or for feedback, too",
        origin=stated("sec. VI names IMUs as future work; the paper's arm has none"),
    )
    vibration_damping: bool = parameter(
        False,
        "turn the joints against swings that the path's changes of speed excite",
        origin=stated("sec. VI names models of the dynamics as future work"),
    )
    i_lag: Second = parameter(
        0.2,
        "time constant of each of two lags that smooth the currents (assumed)",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("the paper mentions no smoothing of the currents"),
    )
    qd_correction: RadianPerSecond = parameter(
        0.2,
        "joint speed that corrections are granted besides the path's (assumed)",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("the paper gives the speed of the uncorrected joints only, algorithms 1 and 2"),
    )
    reversal: Radian = parameter(
        0.002,
        "turn that reverses the gears' friction, of its compensation (assumed)",
        minimum=1e-6,
        maximum=1.0,
        origin=assumed("play within which a gear's friction turns round, of its compensation; not in the paper"),
    )
    tracker_rate: Hertz = parameter(
        30.0,
        "rate of the tracker's readings, of the closed loop",
        minimum=0.1,
        maximum=50.0,
        origin=assumed("NDI Aurora (sec. IV-A); its maker states about 40 Hz, less with several sensors"),
    )
    tracker_lag: Second = parameter(
        0.2,
        "time constant by which the tip's errors are smoothed, of either loop (assumed)",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("such that the closed loop does not swing the arm up at 0.5 bar and 75 g; not in the paper"),
    )
    K_I: PerSecond = parameter(
        2.0,
        "share of the tip's error that either loop takes away in a second (assumed)",
        minimum=0.0,
        maximum=20.0,
        origin=assumed("such that the closed loop does not swing the arm up at 0.5 bar and 75 g; not in the paper"),
    )
    dq_max: Radian = parameter(
        0.2,
        "largest turn of a joint by either loop (assumed)",
        minimum=0.0,
        maximum=3.0,
        origin=assumed("twice what the joints turn further at 0.5 bar and 100 g; not in the paper"),
    )
    imu_shares: Vector2[Number] = parameter(
        np.array([0.75, 1.0]),
        "share of a link's bend, joint included, by which it leads off its joint's angle, of links 2 and 3 (assumed)",
        minimum=0.0,
        maximum=1.5,
        origin=assumed(
            "fitted to 120 postures of VslArm at 0.4 to 2 bar, to 0.6 mm; 1/2 to 2/3 of a cantilever, 1 "
            "where joints yield"
        ),
    )
    mismatch_lag: Second = parameter(
        2.0,
        "time constant by which measured less estimated tips are smoothed (assumed)",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("outlasts what gear friction does to the estimate as a path begins; not in the paper"),
    )
    mismatch_limit: Metre = parameter(
        0.004,
        "smoothed distance of them from which the arm is not the one learned from",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("above the 3.9 mm that it reaches on the arm that was learned from; not in the paper"),
    )
    K_F: Number = parameter(
        0.6,
        "share of the bending by a path's accelerations that is commanded ahead (assumed)",
        minimum=0.0,
        maximum=2.0,
        origin=assumed(
            "of what the currents say of bending, the servos' share does not yield so fast; not in the paper"
        ),
    )
    K_D: PerSecond = parameter(
        4.0,
        "share of the bending by a swing that joints yield by in a second (assumed)",
        minimum=0.0,
        maximum=20.0,
        origin=assumed("damps a swing of 4 Hz within about two periods; not in the paper"),
    )
    qd_max: RadianPerSecond = parameter(
        4.8,
        "joint speed where a bend is commanded ahead: as fast as the servos can",
        minimum=0.0,
        maximum=100.0,
        origin=derived("about the no-load speed of a Dynamixel XM430-W350-T (46 rev/min at 12 V)"),
    )


@dataclass(kw_only=True)
class Inputs:
    """References, and what the arm's own sensors measure."""

    q_ref: Vector3[Radian] = port(np.zeros(3), "wanted joint angles, by rigid kinematics")
    qd_ref: Vector3[RadianPerSecond] = port(np.zeros(3), "wanted joint velocities")
    q_meas: Vector3[Radian] = port(np.zeros(3), "joint angles by the encoders")
    p_meas: Vector2[Pascal] = port(np.zeros(2), "pressures of links 2 and 3 above the air's")
    i_meas: Vector3[Ampere] = port(np.zeros(3), "motor currents")
    p_WG_meas: Vector3[Metre] = port(
        np.zeros(3), "position of the tip by the tracker, in the world; of the closed loop"
    )
    tilt_meas: Vector2[Radian] = port(
        np.zeros(2), "angles of the ends of links 2 and 3 above the horizontal, by the IMUs, if there are any"
    )


@dataclass(kw_only=True)
class Outputs:
    """Commands, and where the tip is taken to be."""

    q_cmd: Vector3[Radian] = output("commanded joint angles, eq. (11)")
    qd_cmd: Vector3[RadianPerSecond] = output("commanded joint velocities")
    p_WG_model: Vector3[Metre] = output("position of the tip by rigid kinematics, eq. (1), in the world")
    p_WG_est: Vector3[Metre] = output("position of the tip by the method chosen, eq. (10), in the world")
    outside: bool = output("the learned model is asked about what it was not trained on")
    innovation: Metre = output("smoothed distance of the tip by tracker or IMUs from the estimate; 0 without")
    model_mismatch: bool = output("by that distance the arm is not the one learned from; false without a sensor")


class UnusedParameters(InvalidParameters):
    """Parameters out of range, or set where nothing that was learned uses them; `faults` lists all of them."""

    block = "HybridKinematics"


class HybridKinematics:
    """Rigid kinematics, and what was learned of their error. [Gandarias2020] eqs. (1), (10), (11).

    MODEL_BASED: q_cmd = q_ref, and the tip is taken to be at p_WG = f(q_meas), eq. (1).
    HYBRID: q_cmd = q_ref + g(q_ref, p, i), eq. (11), and p_WG = f(q_meas) + h(q_meas, p, i), eq. (10), with g and h of
    `VslModel`: what `learned` says. p and i are measured as the command for the next period is made; the current of
    joint 1 is left out. Since a correction moves joints of its own accord, qd_cmd grants qd_correction besides
    |qd_ref|, with the sign of qd_ref; 0, no limit, stays 0.
    ESTIMATE: commands as MODEL_BASED, and p_WG as HYBRID.

    The command feeds the currents back to themselves: an arm that swings feels its own inertia, and takes it for a
    load. Two lags of i_lag in series attenuate that. With an arm that swings at 4 Hz, 0.1 s and less amplify the swing,
    and 0.15 s and more do not. At 0.5 s the tip's error is half as large again on a path at 0.05 m/s. The gears'
    friction acts the same way: commanded to hold still, the arm hunts. At 0.5 bar and 75 g the tip goes 4 mm up and
    down in 3 s.

    Beyond the source, each can be used alone: friction compensation (`CurrentFilter`), the closed loop (`TipFeedback`)
    and the damping of vibrations (`VibrationDamping`). The closed loop is by the tracker, of both methods, or by IMUs
    of an arm that does not shake. Without friction compensation the damping only commands ahead. With closed_loop IMUs
    do nothing: the tracker sees the tip itself.

    `outside` reports that the input of g or h is outside the polytope of its training; see `Domain` for what follows.
    The angle of joint 1, about which the arm is symmetric, decides nothing, and a load only by the currents. It cannot
    show that the arm is another: with stiffer links the inputs are the same. `model_mismatch` does, by the tracker in
    closed loop or by IMUs, see `ImuTip` and `ModelMonitor`. Without either, or while links shake, it cannot be known,
    and the last answer stays, false at first.

    The innovation by IMUs, on paths at 0.5 to 1.5 bar with 25 to 100 g, is 3.9 mm at most on the arm that was learned
    from. It is 4.3 mm with links 10 % heavier (error as before). It is above the limit of 4 mm in the cases tried in
    which stiffer or softer links double the error. Friction that doubles the error shows only while its direction
    turns, and in one of two cases. On the arm that was learned from, while it swings, IMUs may add to the error.

    Raises:
        UnusedParameters: by the constructor, for MODEL_BASED with a model, friction_compensation, vibration_damping, or
            kind of model of its own.
        InvalidModel: by the constructor, if the model is used and cannot be read, is not what `learned` and
            `friction_compensation` say, or was trained for other links.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "q_cmd": ("q_ref", "qd_ref", "q_meas", "p_meas", "i_meas", "p_WG_meas", "tilt_meas"),
        "qd_cmd": ("q_ref", "qd_ref", "q_meas", "p_meas", "i_meas"),
        "p_WG_model": ("q_meas",),
        "p_WG_est": ("q_meas", "p_meas", "i_meas"),
        "outside": ("q_ref", "q_meas", "p_meas", "i_meas"),
        "innovation": ("q_meas", "p_meas", "i_meas", "p_WG_meas", "tilt_meas"),
        "model_mismatch": ("q_meas", "p_meas", "i_meas", "p_WG_meas", "tilt_meas"),
    }
    period: ClassVar[Fraction | None] = _PERIOD
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("joints", TerminalKind.COMMAND, "q_cmd", "qd_cmd"),
        terminal("sensors", TerminalKind.MEASUREMENTS, "q_meas", "p_meas", "i_meas"),
    )

    def __init__(self, params: Params) -> None:
        if faults := parameter_faults(params) or _idle(params):
            raise UnusedParameters(faults)
        self._params = p = params
        self._kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
        self._model = _model(p, self._kinematics) if p.method is not Method.MODEL_BASED else None
        self._currents = CurrentFilter(self._model if p.friction_compensation else None, p.i_lag, p.reversal)
        rate = p.tracker_rate if p.closed_loop else float(1 / _PERIOD)
        self._loop = TipFeedback(self._kinematics, self._model, rate, p.tracker_lag, p.K_I, p.dq_max)
        self._looped = p.closed_loop or p.imu is Imu.FEEDBACK
        self._imu_tip = ImuTip(self._kinematics, p.imu_shares)
        self._monitor = ModelMonitor(p.mismatch_lag, p.mismatch_limit)
        self._damping = _damping(p, self._model)
        self._before: tuple[Floats, Floats] | None = None
        """q_ref and q_cmd of the period that ends."""

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that a step from here would give; no time passes."""
        return self._command(u, self._currents.now(u))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Return the command that holds until t + dt."""
        i, at_once = self._currents.step(u, dt), False
        tip = self._seen(dt, u)
        if self._looped and tip is not None:
            self._loop.step(t, u, tip, i, self._before)
        if self._damping is not None:
            at_once = self._damping.step(dt, u, i, self._currents.oscillation(u, i))
        y = self._command(u, i)
        if at_once:
            y.qd_cmd = np.copysign(self._params.qd_max, y.qd_cmd)
        if self._before is not None:
            if tip is not None and self._model is not None and not is_moving(self._before[1], u.q_meas):
                self._monitor.step(dt, tip, y.p_WG_est)
                y.innovation, y.model_mismatch = self._monitor.innovation, self._monitor.mismatch
            self._currents.turn(y.q_cmd - self._before[1])
        self._before = np.array(u.q_ref), y.q_cmd
        return y

    def get_state(self) -> bytes:
        """Return what currents, the tip's loop, swings and the monitor were, and the command."""
        damping = None if self._damping is None else self._damping.get_state()
        return pack_state(
            (
                self._currents.get_state(),
                self._loop.get_state(),
                damping,
                self._imu_tip.get_state(),
                self._monitor.get_state(),
                self._before,
            )
        )

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        currents, loop, damping, imu_tip, monitor, self._before = unpack_state(state)
        self._currents.set_state(currents)
        self._loop.set_state(loop)
        self._imu_tip.set_state(imu_tip)
        self._monitor.set_state(monitor)
        if self._damping is not None:
            self._damping.set_state(damping)

    def _seen(self, dt: float, u: Inputs) -> Floats | None:
        """Return where tracker or IMUs see the tip, shape (3,), m; None if they do not."""
        p = self._params
        if p.closed_loop:
            return u.p_WG_meas
        return None if p.imu is Imu.NONE else self._imu_tip.step(dt, u)

    def _command(self, u: Inputs, i: Floats) -> Outputs:
        p, model, p_WG = self._params, self._model, self._kinematics.forward(u.q_meas)
        corrected = model is not None and p.method is Method.HYBRID
        q_cmd = model.command(u.q_ref, u.p_meas, i) if model is not None and corrected else np.array(u.q_ref)
        if self._looped:
            q_cmd = q_cmd + self._loop.dq
        if self._damping is not None:
            q_cmd = q_cmd + self._damping.dq
        return Outputs(
            q_cmd=q_cmd,
            qd_cmd=self._granted(u.qd_ref) if corrected or self._looped else np.array(u.qd_ref),
            p_WG_model=p_WG,
            p_WG_est=np.array(p_WG) if model is None else model.tip(u.q_meas, u.p_meas, i),
            outside=model is not None and model.outside(u.q_ref, u.q_meas, u.p_meas, i),
            innovation=self._monitor.innovation,
            model_mismatch=self._monitor.mismatch,
        )

    def _granted(self, qd_ref: Floats) -> Floats:
        return qd_ref + self._params.qd_correction * np.sign(qd_ref)


def _damping(p: Params, model: VslModel | None) -> VibrationDamping | None:
    """Return what is done against vibrations, if anything: without friction compensation nothing by currents."""
    if model is None or not p.vibration_damping:
        return None
    return VibrationDamping(model, p.K_F, p.K_D if p.friction_compensation else 0.0)


def _idle(p: Params) -> list[str]:
    """Return what is set and has no effect by the method chosen."""
    if p.method is not Method.MODEL_BASED:
        return []
    default = Params()
    given = [
        name
        for name in ("learned", "model", "friction_compensation", "vibration_damping")
        if getattr(p, name) != getattr(default, name)
    ]
    return [f"{name}: without effect with method=MODEL_BASED, which uses nothing that was learned" for name in given]


def shipped_file(name: str) -> Path:
    """Return the file of a model that ships: cubic, friction (cubic, of currents without friction), small, physics."""
    return Path(__file__).with_name("models") / f"{name}.json"


def _model(p: Params, kinematics: VslKinematics) -> VslModel:
    """Return the model to be used.

    Raises:
        InvalidModel: there is none, it cannot be read, is of another kind, or was trained for other links than these.
    """
    kind = p.learned.name.lower()
    remedy = train_command(p.learned, kinematics, friction_compensation=p.friction_compensation)
    source = p.model or f"{kind}{' with friction compensation' if p.friction_compensation else ''}, as it ships"
    if p.model:
        model = read_model(Path(p.model))
    elif name := _SHIPPED.get((p.learned, p.friction_compensation)):
        model = read_model(shipped_file(name))
    else:
        raise InvalidModel(source, "there is none: train one and name its file by the parameter model", remedy)
    if model.kind is not p.learned:
        raise InvalidModel(
            source, f"it is a {model.kind.name.lower()} model, and the parameter learned says {kind}", remedy
        )
    if (model.friction != (0.0, 0.0)) is not p.friction_compensation:
        trained, wanted = ("with", "true") if p.friction_compensation else ("without", "false")
        raise InvalidModel(
            source,
            f"it was trained on currents {trained} friction, and the parameter friction_compensation says {wanted}",
            remedy,
        )
    if model.kinematics != kinematics:
        raise InvalidModel(
            source, f"it was trained for {_geometry_text(model.kinematics)}, not {_geometry_text(kinematics)}", remedy
        )
    return model


def train_command(learned: Learned, kinematics: VslKinematics, *, friction_compensation: bool) -> str:
    """Return the command that trains such a model for such links."""
    kind = "" if learned is Learned.CUBIC else f" --learned {learned.name.lower()}"
    elbow = "" if kinematics.elbow is Elbow.UP else f" --elbow {kinematics.elbow.name.lower()}"
    usual = Params()
    links = "".join(
        f" --arm {name}={length!r}"
        for name in LENGTHS
        if (length := float(getattr(kinematics, name))) != getattr(usual, name)
    )
    return f"handover vsl-train{kind}{' --friction-compensation' if friction_compensation else ''}{elbow}{links}"


def _geometry_text(k: VslKinematics) -> str:
    return f"L_1, L_2, L_3 = {k.L_1:g}, {k.L_2:g}, {k.L_3:g} m with the elbow {k.elbow.name.lower()}"
