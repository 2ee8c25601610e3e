"""Statics of the VSL arm's chain: where it rests under its weight, against bending, shear and joints."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from handover.plants.vsl.chain import Pose, VslChain

_TOLERANCE = 1e-12
_ITERATIONS = 12
_MAX_NEWTON_STEP = 0.5  # rad: a Newton step that is longer is cut
_MAX_SHARE, _MIN_SHARE = 1.0 / 4.0, 1.0 / 1024.0  # steps, as shares of gravity, in which it is increased


_LINKS = {1: "link 2", 2: "links 2 and 3", 3: "links 2, 3 and 4"}


class NoEquilibrium(RuntimeError):
    """The arm buckles under its load, or there is no stable rest that its unloaded shape leads to."""

    is_refusal = True

    def __init__(self, theta: Sequence[float], p: Sequence[float], load: float) -> None:
        super().__init__(
            f"VslArm: no stable rest at joint angles ({_listed(theta, ', ')}) rad with a load of {load:.4g} kg and "
            f"{_listed(p, ' and ')} Pa in {_LINKS[len(p)]}: the arm buckles; more pressure or less load holds it"
        )
        self.theta, self.p, self.load = theta, p, load


def _listed(numbers: Sequence[float], between: str) -> str:
    return between.join(f"{x:.4g}" for x in numbers)


class _Body(NamedTuple):
    """Length, shear compliance, weight lifted, compliance of the hinge at the root and the angle of its rest."""

    l: float
    c: float
    A: float
    b: float
    offset: float


class VslStatics:
    """Rest of the chain: the least potential energy, found from the tip inwards by Newton's method for one unknown.

    All weights are dead loads, so with the weight A_i that body i lifts (half its own, all of what follows)

        shear:   s_i = -c_i A_i cos phi_i
        hinge:   tau_i = tau_i+1 - A_i (l_i cos phi_i - s_i sin phi_i),   tau_n = 0
        inwards: phi_i-1 = phi_i - b_i tau_i - offset_i

    with offsets theta_2 at the shoulder, theta_3 at the elbow, if there is one. The angle of the tip's body therefore
    gives all others, down to the ground's, which must be 0. Its derivative is computed with it, and is positive at
    every hinge if the rest is stable. The search begins at the last rest; if it does not converge, gravity is increased
    from 0 in steps.

    A payload buckles the arm by linear buckling analysis: the stiffness of the springs less that by which the weights
    push along the links, both in the shape without load, is not positive definite. Only upright is there then no rest
    at all; an arm that leans a little would bend right over, far from where any payload is carried.

    Args:
        chain: whose rest it is.
        gravity: in m/s2.
        droop: of the servos, which adds to the compliance of the joints, rad/(N m).

    Raises:
        NoEquilibrium: by `settle` and `advance`.
    """

    def __init__(self, chain: VslChain, gravity: float, droop: float) -> None:
        self._chain = chain
        self._gravity = gravity
        self._droop = droop
        self._weight = [gravity * m for m in chain.carried.tolist()]
        self._tip = 0.0
        self.force = 0.0
        """Of a face on the tip: none stops an arm that is at rest at every instant."""
        none = (0.0,) * len(chain.joints)
        self.pose = Pose(np.zeros(len(chain)), np.zeros(len(chain)), none, none)

    def settle(self, theta: Sequence[float], p: Sequence[float], load: float) -> None:
        """Rest at the angles of the chain's joints that the servos aim at, rad, wherever the arm was before."""
        if _buckles(self._bodies(theta, p, load, 1.0), sum(theta)):
            raise NoEquilibrium(theta, p, load)
        tip, reached, share = sum(theta), 0.0, _MAX_SHARE
        while reached < 1.0:
            bodies = self._bodies(theta, p, load, min(reached + share, 1.0))
            found = _newton(bodies, tip)
            if found is not None and self._rest(bodies, found):
                tip, reached, share = found, reached + share, min(2.0 * share, _MAX_SHARE)
            elif share > _MIN_SHARE:
                share /= 2.0
            else:
                raise NoEquilibrium(theta, p, load)

    def advance(
        self,
        dt: float,  # noqa: ARG002
        theta: tuple[Sequence[float], Sequence[float]],
        p: Sequence[float],
        load: float,
        qd_1: float,  # noqa: ARG002
    ) -> None:
        """Rest at the last of the angles; time, the first angles and the speed of J1 do not matter."""
        bodies = self._bodies(theta[1], p, load, 1.0)
        if _buckles(bodies, sum(theta[1])):
            raise NoEquilibrium(theta[1], p, load)
        tip = _newton(bodies, self._tip)
        if tip is None or not self._rest(bodies, tip):
            self.settle(theta[1], p, load)

    def acceleration(self, qd_1: float) -> None:
        """Return None: at rest at every instant."""

    def snapshot(self) -> tuple[Any, ...]:
        """Return the complete state, plain data; its arrays are replaced and never written to."""
        return self._tip, tuple(self.pose)

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Restore a state of this chain or of one with equal parameters."""
        self._tip, pose = snapshot
        self.pose = Pose(*pose)

    def _bodies(self, theta: Sequence[float], p: Sequence[float], load: float, share: float) -> list[_Body]:
        """Return all bodies from the tip inwards, at a share of gravity."""
        chain = self._chain
        hinge, shear = chain.springs(p)
        offset = [0.0] * len(hinge)
        for joint, angle in zip(chain.joints, theta, strict=True):
            offset[joint] = angle
            hinge[joint] += self._droop
        weight = [share * (w + self._gravity * load) for w in self._weight]
        return [_Body(*body) for body in zip(chain.lengths, shear, weight, hinge, offset, strict=True)][::-1]

    def _rest(self, bodies: list[_Body], tip: float) -> bool:
        """Take the pose that belongs to a tip angle if it is stable; return whether."""
        angles: list[float] = []
        shears: list[float] = []
        taus: list[float] = []
        tau, dtau, phi, dphi = 0.0, 0.0, tip, 1.0
        for l, c, A, b, offset in bodies:
            co, si = math.cos(phi), math.sin(phi)
            cA = c * A
            angles.append(phi)
            shears.append(-cA * co)
            tau -= A * co * (l + cA * si)
            dtau -= A * (cA * (co * co - si * si) - l * si) * dphi
            taus.append(tau)
            phi -= b * tau + offset
            dphi -= b * dtau
            if dphi <= 0.0:
                return False
        self._tip = tip
        torque = tuple(-taus[-1 - joint] for joint in self._chain.joints)
        droop = tuple(self._droop * tau for tau in torque)
        self.pose = Pose(np.array(angles[::-1]), np.array(shears[::-1]), torque, droop)
        return True


def _buckles(bodies: list[_Body], tip: float) -> bool:
    """Return whether the weights buckle the arm, by the shape without load, in which the tip's body is at an angle.

    The derivative of the ground's angle by the tip's is taken along that shape: as at a rest it is positive at every
    hinge if the second derivative of the potential energy is positive definite.
    """
    dtau, phi, dphi = 0.0, tip, 1.0
    co, si = math.cos(phi), math.sin(phi)
    for l, c, A, b, offset in bodies:
        dtau -= A * (c * A * (co * co - si * si) - l * si) * dphi
        dphi -= b * dtau
        if dphi <= 0.0:
            return True
        if offset:
            phi -= offset
            co, si = math.cos(phi), math.sin(phi)
    return False


def _newton(bodies: list[_Body], tip: float) -> float | None:
    """Return the tip's angle for which the ground's is 0, or None if there is none near."""
    for _ in range(_ITERATIONS):
        tau, dtau, phi, dphi = 0.0, 0.0, tip, 1.0
        for l, c, A, b, offset in bodies:
            co, si = math.cos(phi), math.sin(phi)
            cA = c * A
            tau -= A * co * (l + cA * si)
            dtau -= A * (cA * (co * co - si * si) - l * si) * dphi
            phi -= b * tau + offset
            dphi -= b * dtau
        if dphi <= 0.0:
            return None
        change = phi / dphi
        tip -= max(-_MAX_NEWTON_STEP, min(change, _MAX_NEWTON_STEP))
        if abs(change) < _TOLERANCE:
            return tip
    return None
