"""A person's hand that offers a ball, guides the arm if asked to, and lets go, after [Vervloet2025] sec. 3.5."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import (
    Hertz,
    Kilogram,
    Metre,
    MetrePerSecond2,
    Newton,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Number,
    Second,
)
from handover.plants.hand_tremor import HandTremor


class InvalidPartnerParameters(InvalidParameters):
    """Parameters that contradict each other; `faults` lists all of them."""

    block = "HandoverPartner"


class Holder(enum.IntEnum):
    """Who holds the ball."""

    HAND = 0
    GRIPPER = 1
    FREE = 2


@dataclass(frozen=True, kw_only=True)
class Params:
    """Where the ball is offered, how still, and when it changes hands; all assumed but the place's surroundings."""

    p_WO_0: Vector3[Metre] = parameter(
        np.array([0.18, 0.0, -0.60]), "where the ball is offered, in the world", minimum=-2.0, maximum=2.0
    )
    p_OH: Vector3[Metre] = parameter(
        np.array([0.0, 0.0, -0.04]), "middle of the palm seen from the ball, in the world", minimum=-0.2, maximum=0.2
    )
    ball_mass: Kilogram = parameter(0.02, "mass of the ball", minimum=0.0, maximum=1.0)
    gravity: MetrePerSecond2 = parameter(9.81, "gravity, along -z of the world", minimum=0.0, maximum=30.0)
    tremor_rms: Metre = parameter(0.001, "root mean square length of the tremor", minimum=0.0, maximum=0.05)
    tremor_frequency: Hertz = parameter(8.0, "middle of the tremor's band", minimum=0.1, maximum=50.0)
    tremor_bandwidth: Hertz = parameter(2.0, "width of the tremor's band at half power", minimum=0.01, maximum=50.0)
    drift_rms: Metre = parameter(0.003, "root mean square length of the drift", minimum=0.0, maximum=0.1)
    drift_time: Second = parameter(5.0, "correlation time of the drift", minimum=0.1, maximum=1000.0)
    capture_lateral: Metre = parameter(
        0.03, "how far beside the gripper's axis the fingers get hold of the ball", minimum=0.0, maximum=0.2
    )
    capture_axial: Metre = parameter(
        0.03, "how far along the axis from the gripper's point they do", minimum=0.0, maximum=0.2
    )
    capture_grip: Number = parameter(0.95, "closure from which the gripper holds", minimum=0.0, maximum=1.0)
    release_grip: Number = parameter(0.5, "closure below which the gripper lets fall", minimum=0.0, maximum=1.0)
    withdrawal: Metre = parameter(0.15, "how far the hand withdraws", minimum=0.0, maximum=1.0)
    withdrawal_time: Second = parameter(1.0, "how long that takes", minimum=0.01, maximum=60.0)
    floor: Metre = parameter(-1.2, "height at which a fallen ball rests", minimum=-100.0, maximum=2.0)
    guide_stiffness: NewtonPerMetre = parameter(
        0.0, "stiffness with which a person draws the gripper to the ball", minimum=0.0, maximum=1000.0
    )
    guide_damping: NewtonSecondPerMetre = parameter(
        2.0, "damping of the guided gripper, where there is guidance", minimum=0.0, maximum=100.0
    )
    guide_force_max: Newton = parameter(5.0, "largest force of guidance", minimum=0.0, maximum=50.0)
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    def check(self) -> None:
        """Raise InvalidPartnerParameters, with all faults, if values contradict each other."""
        faults: list[str] = []
        if not self.tremor_bandwidth < 2.0 * self.tremor_frequency:
            faults.append(
                f"tremor_bandwidth {self.tremor_bandwidth:g} Hz must be less than twice tremor_frequency "
                f"{self.tremor_frequency:g} Hz"
            )
        if not self.release_grip < self.capture_grip:
            faults.append(
                f"release_grip {self.release_grip:g} must be less than capture_grip {self.capture_grip:g}, or the ball "
                "falls when it is taken"
            )
        if not self.floor < self.p_WO_0[2]:
            faults.append(f"floor {self.floor:g} m must lie below the offered ball, {self.p_WO_0[2]:g} m")
        if faults:
            raise InvalidPartnerParameters(faults)


@dataclass(kw_only=True)
class Inputs:
    """What the gripper does."""

    p_WG: Vector3[Metre] = port(np.array([0.0, 0.0, -0.7]), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(np.array([0.0, 1.0, 0.0, 0.0]), "orientation of the gripper in the world")
    grip: Number = port(0.0, "closure of the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    """Where ball and hand are, in the world, and what the gripper feels of them."""

    p_WO: Vector3[Metre] = output("position of the ball")
    p_WH: Vector3[Metre] = output("position of the middle of the palm")
    f_G: Vector3[Newton] = output("force on the gripper, in the world: guidance, then the ball's weight")
    holder: Holder = output("who holds the ball")


class HandoverPartner:
    """Offers a ball in a hand that trembles, until a closed gripper has it, after [Vervloet2025] sec. 3.5.

    - HAND: the ball is at p_WO_0 plus `HandTremor`. If guide_stiffness k > 0, a person leads the gripper to it, with
      f_G = k (p_WO - p_WG) - c v_WG cut at guide_force_max, v_WG from the last two positions. Forces trail positions by
      a step: with the arm, at 20 ms, k from 10 to 50 N/m is calm with c = 2 N s/m, and swings up with c = 0 or 4.
    - GRIPPER, once grip >= capture_grip with the ball between the fingers: p_GO, seen from the gripper's frame G whose
      z points along its axis to its tip, is at most capture_lateral beside that axis and capture_axial along it. The
      ball keeps its place in G, f_G is its weight (its inertia and its lever about G are left out), and the hand
      withdraws, outwards from the arm's axis and down. A ball beside the fingers stays in the hand.
    - FREE, once grip < release_grip: the ball falls with the velocity that it had, and rests on the floor.

    The conditions are judged at the beginning of a step, with inputs and ball of the same instant, and the outputs at
    its end follow from the inputs held during it. Force and ball therefore trail the gripper by one step.

    Raises:
        InvalidPartnerParameters: by the constructor, for parameters that contradict each other.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._params = params
        self._tremor = HandTremor(
            params.tremor_rms,
            params.tremor_frequency,
            params.tremor_bandwidth,
            params.drift_rms,
            params.drift_time,
            params.seed,
        )
        self._holder = Holder.HAND
        self._p_WO: Floats = np.array(params.p_WO_0, dtype=np.float64)
        self._v_WO: Floats = np.zeros(3)
        self._p_GO: Floats = np.zeros(3)
        self._f_G: Floats = np.zeros(3)
        self._withdrawing = 0.0  # seconds since the hand let go
        self._p_WG: Floats | None = None  # at the previous step
        self._elapsed = 0.0  # length of that step, s

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where ball and hand are; no time passes."""
        return Outputs(p_WO=np.array(self._p_WO), p_WH=self._palm(), f_G=np.array(self._f_G), holder=self._holder)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        self._change_holder(u)
        self._tremor.advance(dt)
        if self._holder is not Holder.HAND:
            self._withdrawing += dt
        {Holder.HAND: self._offer, Holder.GRIPPER: self._carry, Holder.FREE: self._fall}[self._holder](dt, u)
        self._p_WG, self._elapsed = np.array(u.p_WG), dt
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the complete state."""
        arrays = (self._p_WO, self._v_WO, self._p_GO, self._f_G, self._p_WG)
        times = (self._withdrawing, self._elapsed)
        return pack_state((self._tremor.get_state(), int(self._holder), arrays, times))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this partner or of one with equal parameters."""
        tremor, holder, arrays, (self._withdrawing, self._elapsed) = unpack_state(state)
        self._tremor.set_state(tremor)
        self._holder = Holder(holder)
        self._p_WO, self._v_WO, self._p_GO, self._f_G, self._p_WG = arrays

    def _change_holder(self, u: Inputs) -> None:
        p = self._params
        if self._holder is Holder.HAND and u.grip >= p.capture_grip:
            p_GO = np.transpose(rotation_of(u.q_WG)) @ (self._p_WO - u.p_WG)
            if np.hypot(p_GO[0], p_GO[1]) <= p.capture_lateral and abs(p_GO[2]) <= p.capture_axial:
                self._holder = Holder.GRIPPER
                self._p_GO = p_GO
        elif self._holder is Holder.GRIPPER and u.grip < p.release_grip:
            self._holder = Holder.FREE

    def _offer(self, dt: float, u: Inputs) -> None:  # noqa: ARG002
        self._p_WO = self._params.p_WO_0 + self._tremor.displacement
        self._f_G = self._guidance(u.p_WG)

    def _carry(self, dt: float, u: Inputs) -> None:
        p_WO = u.p_WG + rotation_of(u.q_WG) @ self._p_GO
        self._v_WO = (p_WO - self._p_WO) / dt
        self._p_WO = p_WO
        self._f_G = np.array([0.0, 0.0, -self._params.ball_mass * self._params.gravity])

    def _fall(self, dt: float, u: Inputs) -> None:  # noqa: ARG002
        g = np.array([0.0, 0.0, -self._params.gravity])
        self._p_WO = self._p_WO + dt * self._v_WO + dt**2 / 2.0 * g
        self._v_WO = self._v_WO + dt * g
        if self._p_WO[2] <= self._params.floor:
            self._p_WO[2] = self._params.floor
            self._v_WO = np.zeros(3)
        self._f_G = np.zeros(3)

    def _guidance(self, p_WG: Floats) -> Floats:
        p = self._params
        if p.guide_stiffness == 0.0:
            return np.zeros(3)
        v_WG = np.zeros(3) if self._p_WG is None else (p_WG - self._p_WG) / self._elapsed
        f = p.guide_stiffness * (self._p_WO - p_WG) - p.guide_damping * v_WG
        return f * min(1.0, p.guide_force_max / max(float(np.linalg.norm(f)), 1e-12))

    def _palm(self) -> Floats:
        """Return p_WH: at the ball's place while it is offered, then withdrawing along a minimum-jerk course."""
        p = self._params
        outwards = np.array([p.p_WO_0[0], p.p_WO_0[1], 0.0])
        away = outwards / max(float(np.linalg.norm(outwards)), 1e-9) - np.array([0.0, 0.0, 1.0])
        s = min(self._withdrawing / p.withdrawal_time, 1.0)
        course = p.withdrawal * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        return p.p_WO_0 + self._tremor.displacement + p.p_OH + course * away / np.linalg.norm(away)
