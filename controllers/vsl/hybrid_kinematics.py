"""Model-based and hybrid, learning-based kinematics of the VSL arm. [Gandarias2020] secs. III-A, IV-B and IV-C."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import VslModel
from handover.controllers.vsl.model_text import InvalidModel, parse_model, read_model
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Ampere, Metre, Pascal, Radian, RadianPerSecond, Second

__all__ = ["Elbow", "HybridKinematics", "Inputs", "InvalidModel", "Method", "Outputs", "Params"]


class Method(enum.IntEnum):
    """How joint angles are commanded and the tip's position is estimated."""

    MODEL_BASED = 0
    HYBRID = 1


@dataclass(frozen=True, kw_only=True)
class Params:
    """Method, model and arm; the lengths are assumed."""

    method: Method = parameter(Method.HYBRID, "rigid kinematics alone, or with what was learned")
    model: str = parameter("", "JSON file of a trained model; empty: the one that ships")
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


@dataclass(kw_only=True)
class Inputs:
    """References, and what the arm's own sensors measure."""

    q_ref: Vector3[Radian] = port(np.zeros(3), "wanted joint angles, by rigid kinematics")
    qd_ref: Vector3[RadianPerSecond] = port(np.zeros(3), "wanted joint velocities")
    q_meas: Vector3[Radian] = port(np.zeros(3), "joint angles by the encoders")
    p_meas: Vector2[Pascal] = port(np.zeros(2), "pressures of links 2 and 3 above the air's")
    i_meas: Vector3[Ampere] = port(np.zeros(3), "motor currents")


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
    `VslModel`, cubic polynomials where the source has networks. p and i are measured as the command for the next period
    is made; the current of joint 1 is left out. Since a correction moves joints of its own accord, qd_cmd grants
    qd_correction besides |qd_ref|, with the sign of qd_ref; 0, no limit, stays 0.

    The command feeds the currents back to themselves: an arm that swings feels its own inertia, and takes it for a
    load. Two lags of i_lag in series attenuate that. With an arm that swings at 4 Hz, 0.1 s and less amplify the swing,
    and 0.15 s and more do not; at 0.5 s the tip's error is half as large again on a path at 0.05 m/s. The gears'
    friction acts the same way: commanded to hold still, the arm hunts, at 0.5 bar and 75 g the tip by 4 mm up and down
    in 3 s.

    `outside` reports that the input of g or h is outside the polytope of its training; see `Cubic` for what follows.

    Raises:
        InvalidModel: by the constructor, if HYBRID and the model cannot be read, or was trained for other links.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "q_cmd": ("q_ref", "p_meas", "i_meas"),
        "qd_cmd": ("qd_ref",),
        "p_WG_model": ("q_meas",),
        "p_WG_est": ("q_meas", "p_meas", "i_meas"),
        "outside": ("q_ref", "q_meas", "p_meas", "i_meas"),
    }
    period: ClassVar[Fraction | None] = Fraction(1, 50)

    def __init__(self, params: Params) -> None:
        self._params = p = params
        self._kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
        self._model = _model(p, self._kinematics) if p.method is Method.HYBRID else None
        self._i: tuple[Floats, Floats] | None = None
        """Currents, smoothed once and twice."""

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that a step from here would give; no time passes."""
        return self._command(u, self._smoothed(u.i_meas, 0.0)[1])

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that holds until t + dt."""
        self._i = self._smoothed(u.i_meas, dt)
        return self._command(u, self._i[1])

    def get_state(self) -> bytes:
        """Return the smoothed currents."""
        return pack_state(self._i)

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        self._i = unpack_state(state)

    def _smoothed(self, i_meas: Floats, dt: float) -> tuple[Floats, Floats]:
        if self._i is None or self._params.i_lag == 0.0:
            return np.array(i_meas), np.array(i_meas)
        share = 1.0 - math.exp(-dt / self._params.i_lag)
        once = self._i[0] + share * (i_meas - self._i[0])
        return once, self._i[1] + share * (once - self._i[1])

    def _command(self, u: Inputs, i: Floats) -> Outputs:
        p_WG = self._kinematics.forward(u.q_meas)
        model = self._model
        if model is None:
            q_cmd, qd_cmd = np.array(u.q_ref), np.array(u.qd_ref)
            return Outputs(q_cmd=q_cmd, qd_cmd=qd_cmd, p_WG_model=p_WG, p_WG_est=np.array(p_WG), outside=False)
        return Outputs(
            q_cmd=model.command(u.q_ref, u.p_meas, i),
            qd_cmd=u.qd_ref + self._params.qd_correction * np.sign(u.qd_ref),
            p_WG_model=p_WG,
            p_WG_est=model.tip(u.q_meas, u.p_meas, i),
            outside=model.outside(u.q_ref, u.q_meas, u.p_meas, i),
        )


def _model(p: Params, kinematics: VslKinematics) -> VslModel:
    """Return the model to be used.

    Raises:
        InvalidModel: it cannot be read, or was trained for other links than these.
    """
    model = read_model(Path(p.model)) if p.model else parse_model(DEFAULT_MODEL, "that ships")
    if model.kinematics != kinematics:
        raise InvalidModel(
            p.model or "that ships",
            f"it was trained for {_geometry_text(model.kinematics)}, not {_geometry_text(kinematics)}",
        )
    return model


def _geometry_text(k: VslKinematics) -> str:
    return f"L_1, L_2, L_3 = {k.L_1:g}, {k.L_2:g}, {k.L_3:g} m with the elbow {k.elbow.name.lower()}"
