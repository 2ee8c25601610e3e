"""A person's hand that offers a ball, guides the arm if asked to, and lets go, after [Vervloet2025] sec. 3.5."""

from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.plants.hand_motion import HandTremor, minimum_jerk
from handover.plants.helix.hand.bowl import Bowl
from handover.plants.helix.hand.guidance import Guidance, GuidanceGains
from handover.plants.helix.hand.partner_parameters import Holder, Inputs, Outputs, Params, place_aside

_NEAR = 0.12
"""Distance of the gripper from the ball beyond which it touches neither ball nor hand, m."""
_LOST = 0.05
"""How long nothing may touch the ball before nobody holds it, s: it may jump a little."""
_OVER, _BRING_SPEED = 0.04, 0.1
"""How much higher than its place the gripper must be for the person to bring the ball there, m, and how fast, m/s."""


class HandoverPartner:
    """Offers a ball in a hand that trembles, until a closed gripper has it, after [Vervloet2025] sec. 3.5.

    The hand is at p_WO_0 plus `HandTremor`, and moves to p_WO_1 in a minimum-jerk course if move_for > 0. The ball lies
    still in its palm, held with hold_force, until the gripper comes near. From then on ball, hand, and the gripper's
    fingers and palm are bodies, and what they touch with moves them (`ball_contact`). Nothing but contact holds the
    ball.

    Where the arm hangs nobody can hold a ball. A person whose ball is to go nearer than `room` to the arm's axis waits
    at that distance, in the same direction. Once the gripper is 4 cm higher than the ball's place, the person brings it
    there.

    If guide_stiffness k > 0, a person leads the gripper to the ball: see `Guidance`; v_WG is from the last two
    positions.

    With help_speed > 0 the person brings the ball to G, in a straight line, while a gripper that is near closes.

    The person lets go once the gripper has looked closed (grip >= closed_grip) and its fingers have pressed on the ball
    with felt_grasp in all, both for reaction_time. First thumb and fingers let go, within release_time. Then the hand
    withdraws outwards from the arm's axis and down. Pressed with more than force_max, the person does the same at once.

    - HAND: the hand touches the ball, or has within the last 50 ms.
    - GRIPPER: the gripper does, and the hand does not.
    - FREE: neither. From then on the ball falls with the velocity that it had, and nobody catches it. Where there is a
      `Bowl` and the ball's centre comes through the rim's plane within the rim, it rolls in there until it rests. Else
      it rests on the floor, whatever is in its way.

    The gripper's motion in a step is taken as even between the inputs of the step before and those of this one. Forces,
    ball and hand therefore trail the gripper by one step. With the arm, contacts are calm at 10 ms, where 5 ms gives
    the same, and throw the ball about at 20 ms. Guidance is calm with k from 10 to 50 N/m and c = 2 N s/m.

    Raises:
        InvalidPartnerParameters: by the constructor, for parameters out of range or that contradict each other.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),)
    period: ClassVar[Fraction | None] = None
    deferred: ClassVar[tuple[str, ...]] = ("handover.plants.helix.hand.held_ball",)

    def __init__(self, params: Params) -> None:
        # imported here, since Numba takes long to load, and ports are read without it
        from handover.plants.helix.hand.held_ball import HeldBall

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
        self._help: Floats = np.zeros(3)  # how far the person has brought the ball to the gripper
        self._aside, self._waits = (
            place_aside(params.p_WO_0, params.room),
            True,
        )  # how far the ball is held from its place
        self._place: Floats = params.p_WO_0 + self._aside  # where the ball is held out, without tremor
        self._p_WO: Floats = np.array(self._place)
        self._v_WO: Floats = np.zeros(3)
        self._is_touched = False  # whether the gripper has come so near that the ball moves by contact
        self._ball = HeldBall(params)
        self._ball.lie(self._p_WO, self._v_WO)
        self._felt = 0.0  # how long the person has felt a closed gripper's grasp, s
        self._is_let_go = False
        self._withdrawing = 0.0  # seconds since then
        self._untouched = np.zeros(2)  # how long hand and gripper have not touched the ball, s
        self._f_G: Floats = np.zeros(3)
        self._f_H: Floats = np.array([0.0, 0.0, -params.ball_mass * params.gravity])
        self._guidance = Guidance(
            GuidanceGains(
                stiffness=params.guide_stiffness,
                damping=params.guide_damping,
                force_max=params.guide_force_max,
                height=params.guide_height,
                speed=params.guide_speed,
            )
        )
        self._bowl = Bowl(params.p_WD, params.bowl_radius, params.bowl_depth, params.ball_radius)
        self._in_bowl = False
        self._p_WG: Floats | None = None  # at the previous step
        self._elapsed = 0.0  # length of that step, s

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where ball and hand are; no time passes."""
        return Outputs(
            p_WO=np.array(self._p_WO),
            p_WH=self._held() + self._ball.displacement + self._params.p_OH,
            f_G=np.array(self._f_G),
            f_H=np.array(self._f_H),
            holder=self._holder,
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        self._tremor.advance(dt)
        if self._is_let_go:
            self._withdrawing += dt
        else:
            place = self._offered_at(t + dt)
            self._place = place + self._brought(place, dt, u) + self._helped(dt, u)
        self._is_touched = self._is_touched or bool(np.linalg.norm(u.p_WG - self._p_WO) < _NEAR)
        if self._holder is Holder.FREE:
            self._fall(dt)
        elif self._is_touched:
            self._touch(dt, u)
        else:
            before, self._p_WO = self._p_WO, self._held()
            self._ball.lie(self._p_WO, (self._p_WO - before) / dt)
            self._f_G = np.zeros(3)
        if self._holder is Holder.HAND and not self._is_let_go:
            v_WG = np.zeros(3) if self._p_WG is None else (u.p_WG - self._p_WG) / self._elapsed
            self._f_G = self._f_G + self._guidance.force(self._p_WO, u.p_WG, v_WG, dt)
        self._p_WG, self._elapsed = np.array(u.p_WG), dt
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        """Return the complete state."""
        places = (self._aside, self._help, self._place)
        arrays = (self._p_WO, self._v_WO, self._f_G, self._f_H, self._untouched, self._p_WG)
        times = (self._felt, self._withdrawing, self._elapsed)
        flags = (self._waits, self._is_touched, self._is_let_go, self._in_bowl)
        parts = (self._tremor.get_state(), self._guidance.get_state(), self._ball.get_state())
        return pack_state((parts, int(self._holder), flags, places, arrays, times))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this partner or of one with equal parameters."""
        (tremor, guidance, ball), holder, flags, places, arrays, times = unpack_state(state)
        self._tremor.set_state(tremor)
        self._guidance.set_state(guidance)
        self._ball.set_state(ball)
        self._holder = Holder(holder)
        self._waits, self._is_touched, self._is_let_go, self._in_bowl = flags
        self._aside, self._help, self._place = places
        self._p_WO, self._v_WO, self._f_G, self._f_H, self._untouched, self._p_WG = arrays
        self._felt, self._withdrawing, self._elapsed = times

    def _touch(self, dt: float, u: Inputs) -> None:
        p = self._params
        contact = self._ball.move(u.p_WG, rotation_of(u.q_WG), u.grip, self._held(), self._pressing(), dt)
        self._p_WO, self._v_WO = self._ball.p_WO, self._ball.v_WO
        self._f_G, self._f_H = contact.f_G, contact.f_H
        is_felt = u.grip >= p.closed_grip and contact.by_gripper >= p.felt_grasp
        self._felt = self._felt + dt if is_felt else 0.0
        is_pressed = float(np.linalg.norm(contact.f_H)) > p.force_max
        self._is_let_go = self._is_let_go or is_pressed or (is_felt and self._felt >= p.reaction_time)
        touches = np.array([contact.by_hand > 0.0, contact.by_gripper > 0.0])
        self._untouched = np.where(touches, 0.0, self._untouched + dt)
        by_hand, by_gripper = self._untouched < _LOST
        self._holder = Holder.HAND if by_hand else Holder.GRIPPER if by_gripper else Holder.FREE

    def _fall(self, dt: float) -> None:
        g = np.array([0.0, 0.0, -self._params.gravity])
        before = self._p_WO
        self._p_WO = before + dt * self._v_WO + dt**2 / 2.0 * g
        self._v_WO = self._v_WO + dt * g
        if self._params.bowl_radius > 0.0:
            is_below = self._p_WO[2] < self._params.p_WD[2]
            self._in_bowl = is_below and (self._in_bowl or self._bowl.catches(before, self._p_WO))
        if self._in_bowl:
            self._p_WO, self._v_WO = self._bowl.roll(self._p_WO, self._v_WO, dt)
        if self._p_WO[2] <= self._params.floor:
            self._p_WO[2] = self._params.floor
            self._v_WO = np.zeros(3)
        self._f_G, self._f_H = np.zeros(3), np.zeros(3)

    def _offered_at(self, t: float) -> Floats:
        """Return where the hand holds the ball out, without tremor."""
        p = self._params
        if p.move_for == 0.0:
            return p.p_WO_0
        return p.p_WO_0 + minimum_jerk((t - p.move_from) / p.move_for) * (p.p_WO_1 - p.p_WO_0)

    def _brought(self, place: Floats, dt: float, u: Inputs) -> Floats:
        """Return how far from its place the ball is held since the arm is there, or was."""
        self._waits = self._waits and u.p_WG[2] < place[2] + _OVER
        left = float(np.linalg.norm(self._aside))
        if left > 0.0 and not self._waits:
            self._aside = max(0.0, 1.0 - _BRING_SPEED * dt / left) * self._aside
        return self._aside

    def _helped(self, dt: float, u: Inputs) -> Floats:
        """Return how far the person brings the ball to the gripper, evenly in a straight line while that closes."""
        p, way = self._params, u.p_WG - self._place
        distance = float(np.linalg.norm(way))
        if p.help_speed > 0.0 and u.grip > 0.0 and 0.0 < distance < p.help_within:
            self._help = self._help + min(1.0, p.help_speed * dt / distance) * way
        return self._help

    def _pressing(self) -> float:
        """Return the force with which the person presses the ball to the palm, N: evenly less once it is let go."""
        p = self._params
        if not self._is_let_go:
            return p.hold_force
        return p.hold_force * max(0.0, 1.0 - self._withdrawing / p.release_time) if p.release_time > 0.0 else 0.0

    def _held(self) -> Floats:
        """Return where a ball would lie in the hand: held out, or withdrawing along a minimum-jerk course."""
        p = self._params
        outwards = np.array([self._place[0], self._place[1], 0.0])
        away = outwards / max(float(np.linalg.norm(outwards)), 1e-9) - np.array([0.0, 0.0, 1.0])
        course = p.withdrawal * minimum_jerk((self._withdrawing - p.release_time) / p.withdrawal_time)
        return self._place + self._tremor.displacement + course * away / np.linalg.norm(away)
