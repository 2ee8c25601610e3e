"""Model-based and hybrid, learning-based kinematics of the VSL arm. [Gandarias2020] secs. III-A, IV-B and IV-C."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.vsl import default_model, default_physics_model, default_small_model, default_window_model
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import Learned, VslModel, turned
from handover.controllers.vsl.model_text import InvalidModel, parse_model, read_model
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Ampere, Hertz, Metre, Pascal, PerSecond, Radian, RadianPerSecond, Second

__all__ = ["Elbow", "HybridKinematics", "Inputs", "InvalidModel", "Learned", "Method", "Outputs", "Params"]

_SHIPPED = {
    (Learned.CUBIC, False): default_model.DEFAULT_MODEL,
    (Learned.CUBIC, True): default_window_model.DEFAULT_MODEL,
    (Learned.SMALL, False): default_small_model.DEFAULT_MODEL,
    (Learned.PHYSICS, False): default_physics_model.DEFAULT_MODEL,
}
"""Texts of the models that ship, by what they are and whether they were trained on currents without friction."""

_ON_THE_WAY = 0.05
"""Angle between command and encoder, rad, from which a joint is on its way and the tip not yet to judge (assumed)."""

_DAMPING = 0.01
"""Of the inverse of the Jacobian, m: singular values below it, near a stretched elbow, count for less (assumed)."""

_SHORTEST_LEVER = 0.03
"""m; of an arm that stands upright, currents say nothing of a load (assumed)."""

_SAME_TIME = 1e-9
"""s; rounding of sums of intervals."""


class Method(enum.IntEnum):
    """How joint angles are commanded and the tip's position is estimated."""

    MODEL_BASED = 0
    HYBRID = 1
    ESTIMATE = 2


@dataclass(frozen=True, kw_only=True)
class Params:
    """Method, model and arm; the lengths are assumed."""

    method: Method = parameter(Method.HYBRID, "rigid kinematics, with what was learned, or with its estimate only")
    learned: Learned = parameter(Learned.CUBIC, "what corrects rigid kinematics")
    model: str = parameter("", "JSON file of a trained model; empty: the one that ships; no published one does")
    window: bool = parameter(False, "free the currents of gear friction by which way each joint has been turning")
    closed_loop: bool = parameter(False, "turn the joints until the tracker sees the tip where it is wanted")
    elbow: Elbow = parameter(Elbow.UP, "which way the elbow points")
    L_1: Metre = parameter(0.15, "height of the shoulder", minimum=0.0, maximum=10.0)
    L_2: Metre = parameter(0.225, "length of link 2", minimum=0.001, maximum=10.0)
    L_3: Metre = parameter(0.225, "length of link 3", minimum=0.001, maximum=10.0)
    i_lag: Second = parameter(
        0.2, "time constant of each of two lags that smooth the currents (assumed)", minimum=0.0, maximum=60.0
    )
    qd_correction: RadianPerSecond = parameter(
        0.2, "joint speed that corrections are granted besides the path's (assumed)", minimum=0.0, maximum=100.0
    )
    reversal: Radian = parameter(
        0.002, "turn that reverses the gears' friction, of the window (assumed)", minimum=1e-6, maximum=1.0
    )
    tracker_rate: Hertz = parameter(
        30.0, "rate of the tracker's readings, of the closed loop", minimum=0.1, maximum=50.0
    )
    K_I: PerSecond = parameter(
        3.0, "share of the tip's error that the closed loop takes away in a second (assumed)", minimum=0.0, maximum=20.0
    )
    dq_max: Radian = parameter(0.2, "largest turn of a joint by the closed loop (assumed)", minimum=0.0, maximum=3.0)


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


@dataclass(kw_only=True)
class Outputs:
    """Commands, and where the tip is taken to be."""

    q_cmd: Vector3[Radian] = output("commanded joint angles, eq. (11)")
    qd_cmd: Vector3[RadianPerSecond] = output("commanded joint velocities")
    p_WG_model: Vector3[Metre] = output("position of the tip by rigid kinematics, eq. (1), in the world")
    p_WG_est: Vector3[Metre] = output("position of the tip by the method chosen, eq. (10), in the world")
    outside: bool = output("the learned model is asked about what it was not trained on")


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
    and 0.15 s and more do not; at 0.5 s the tip's error is half as large again on a path at 0.05 m/s. The gears'
    friction acts the same way: commanded to hold still, the arm hunts, at 0.5 bar and 75 g the tip by 4 mm up and down
    in 3 s.

    The window: i - c d in place of i, with c as trained and d in [-1, 1] which way each gear's friction acts. That
    follows from the unit's own commands, which have no noise: see `turned`. What is smoothed then is not the currents
    but what a load adds to the usual ones i_0(q, p) at its levers b(q): i - c d - i_0 = lambda b + e, with e square to
    b. lambda and e change with the load alone, so that smoothing them does not lag behind the posture.

    The closed loop, at the tracker's rate: q_cmd has dq besides, dq' = K_I J~^+ (f(q_ref) - p_WG_meas), with q_ref of
    the period that ends and the corrected Jacobian J~, that of h included (without, MODEL_BASED, J); J~^+ is its damped
    inverse. dq rests while joints are on their way, and stays within dq_max.

    `outside` reports that the input of g or h is outside the polytope of its training; see `Domain` for what follows.

    Raises:
        InvalidModel: by the constructor, if the model is used and cannot be read, is not what `learned` and `window`
            say, or was trained for other links.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "q_cmd": ("q_ref", "q_meas", "p_meas", "i_meas", "p_WG_meas"),
        "qd_cmd": ("qd_ref",),
        "p_WG_model": ("q_meas",),
        "p_WG_est": ("q_meas", "p_meas", "i_meas"),
        "outside": ("q_ref", "q_meas", "p_meas", "i_meas"),
    }
    period: ClassVar[Fraction | None] = Fraction(1, 50)

    def __init__(self, params: Params) -> None:
        self._params = p = params
        self._kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
        self._model = _model(p, self._kinematics) if p.method is not Method.MODEL_BASED else None
        self._i: tuple[Floats, Floats] | None = None
        """Currents, or what explains them, smoothed once and twice."""
        self._before: tuple[Floats, Floats] | None = None
        """q_ref and q_cmd of the period that ends."""
        self._direction = np.zeros(2)
        """Which way the friction of joints 2 and 3 acts."""
        self._dq = np.zeros(3)
        """What the closed loop turns the joints by."""
        self._readings = 0
        """Readings of the tracker until now."""

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that a step from here would give; no time passes."""
        i = self._currents(u, self._smoothed(self._carried(u), 0.0)[1])
        return self._command(u, i, self._dq)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Return the command that holds until t + dt."""
        self._i = self._smoothed(self._carried(u), dt)
        i = self._currents(u, self._i[1])
        if self._params.closed_loop:
            self._integrate(t, u, i)
        y = self._command(u, i, self._dq)
        if self._before is not None:
            turn = (y.q_cmd - self._before[1])[1:]
            self._direction = turned(self._direction, turn, self._params.reversal)
        self._before = np.array(u.q_ref), y.q_cmd
        return y

    def get_state(self) -> bytes:
        """Return what is smoothed, and what window and closed loop remember."""
        return pack_state((self._i, self._before, self._direction, self._dq, self._readings))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        self._i, self._before, self._direction, self._dq, self._readings = unpack_state(state)

    def _carried(self, u: Inputs) -> Floats:
        """Return what is smoothed: the currents; of a window what explains them, [lambda, e_2, e_3]."""
        if not self._params.window or self._model is None:
            return u.i_meas
        usual, levers = self._model.currents(u.q_meas, u.p_meas)
        more = u.i_meas[1:] - self._direction * self._model.friction - usual
        by_lever = levers @ more / max(levers @ levers, _SHORTEST_LEVER**2)
        return np.concatenate([[by_lever], more - by_lever * levers])

    def _currents(self, u: Inputs, carried: Floats) -> Floats:
        """Return the currents, shape (3,), A, that what is smoothed makes at the present posture."""
        if not self._params.window or self._model is None:
            return carried
        usual, levers = self._model.currents(u.q_meas, u.p_meas)
        return np.concatenate([[0.0], usual + carried[0] * levers + carried[1:]])

    def _smoothed(self, i_meas: Floats, dt: float) -> tuple[Floats, Floats]:
        if self._i is None or self._params.i_lag == 0.0:
            return np.array(i_meas), np.array(i_meas)
        share = 1.0 - math.exp(-dt / self._params.i_lag)
        once = self._i[0] + share * (i_meas - self._i[0])
        return once, self._i[1] + share * (once - self._i[1])

    def _integrate(self, t: float, u: Inputs, i: Floats) -> None:
        """Turn the joints on by a share of the tip's error, if the tracker has a reading that it had not."""
        p = self._params
        readings = math.floor((t + _SAME_TIME) * p.tracker_rate) + 1
        if readings == self._readings:
            return
        self._readings = readings
        if self._before is None or np.max(np.abs(self._before[1] - u.q_meas)) > _ON_THE_WAY:
            return
        error = self._kinematics.forward(self._before[0]) - u.p_WG_meas
        J = (
            self._kinematics.jacobian(u.q_meas)
            if self._model is None
            else self._model.tip_jacobian(u.q_meas, u.p_meas, i)
        )
        damped = np.transpose(J) @ np.linalg.solve(J @ np.transpose(J) + _DAMPING**2 * np.eye(3), error)
        self._dq = np.clip(self._dq + p.K_I / p.tracker_rate * damped, -p.dq_max, p.dq_max)

    def _command(self, u: Inputs, i: Floats, dq: Floats) -> Outputs:
        p, model, p_WG = self._params, self._model, self._kinematics.forward(u.q_meas)
        corrected = model is not None and p.method is Method.HYBRID
        q_cmd = model.command(u.q_ref, u.p_meas, i) if model is not None and corrected else np.array(u.q_ref)
        return Outputs(
            q_cmd=q_cmd + dq if p.closed_loop else q_cmd,
            qd_cmd=self._granted(u.qd_ref) if corrected or p.closed_loop else np.array(u.qd_ref),
            p_WG_model=p_WG,
            p_WG_est=np.array(p_WG) if model is None else model.tip(u.q_meas, u.p_meas, i),
            outside=model is not None and model.outside(u.q_ref, u.q_meas, u.p_meas, i),
        )

    def _granted(self, qd_ref: Floats) -> Floats:
        return qd_ref + self._params.qd_correction * np.sign(qd_ref)


def _model(p: Params, kinematics: VslKinematics) -> VslModel:
    """Return the model to be used.

    Raises:
        InvalidModel: there is none, it cannot be read, is of another kind, or was trained for other links than these.
    """
    kind, remedy = p.learned.name.lower(), train_command(p.learned, window=p.window)
    source = p.model or f"{kind}{' with a window' if p.window else ''}, as it ships"
    if p.model:
        model = read_model(Path(p.model))
    elif text := _SHIPPED.get((p.learned, p.window)):
        model = parse_model(text, source)
    else:
        raise InvalidModel(source, "there is none: train one and name its file by the parameter model", remedy)
    if model.kind is not p.learned:
        raise InvalidModel(
            source, f"it is a {model.kind.name.lower()} model, and the parameter learned says {kind}", remedy
        )
    if (model.friction != (0.0, 0.0)) is not p.window:
        trained = "without a window" if p.window else "with a window, on currents without friction"
        raise InvalidModel(
            source, f"it was trained {trained}, and the parameter window says {str(p.window).lower()}", remedy
        )
    if model.kinematics != kinematics:
        raise InvalidModel(
            source, f"it was trained for {_geometry_text(model.kinematics)}, not {_geometry_text(kinematics)}", remedy
        )
    return model


def train_command(learned: Learned, *, window: bool) -> str:
    """Return the command that trains such a model."""
    kind = "" if learned is Learned.CUBIC else f" --learned {learned.name.lower()}"
    return f"handover vsl-train{kind}{' --window' if window else ''}"


def _geometry_text(k: VslKinematics) -> str:
    return f"L_1, L_2, L_3 = {k.L_1:g}, {k.L_2:g}, {k.L_3:g} m with the elbow {k.elbow.name.lower()}"
