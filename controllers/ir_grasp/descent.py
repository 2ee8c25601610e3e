"""Gauss-Newton descent of the grasp's cost on residuals that only moves can measure. [Luberto] eqs. (4) to (10).

The control inputs are x = [p_x, p_y, yaw, sigma] (m, m, rad, 1), of different units, and there are fewer residuals r
(m) than inputs. So the step depends on what a unit of each input is worth: x = S z with S = diag(scale) is declared,
and steps and updates are those of least norm in z.
"""

import enum
import math

import numpy as np

from handover.controllers.ir_grasp.moves import X
from handover.controllers.ir_grasp.parameters import Params
from handover.cosim.blocks.ports import Floats

_RANK_TOLERANCE = 1e-12
_ANYWHERE = np.full(4, np.inf)
_GROWTH, _SHRINKAGE = 2.0, 0.5  # of the factor on alpha, by whether a step lessened the cost (assumed)


def cost(r: Floats) -> float:
    """Return f = 1/2 r^T r, eq. (4), in m2."""
    return 0.5 * float(r @ r)


def minimum_norm_step(J: Floats, r: Floats, scale: Floats, damping: float) -> Floats:
    """Return dx = -S J_z^T (J_z J_z^T + damping^2 I)^-1 r with J_z = J S: eq. (9), with the inverse that exists.

    Of all steps that the linear residual cannot tell apart it is the shortest in z. The printed left pseudo-inverse
    asks for as many residuals as inputs.

    Args:
        J: Jacobian of the residuals, shape (residuals, 4), in m per unit of each input.
        r: residuals, shape (residuals,), in m.
        scale: diagonal of S, shape (4,); an input of scale 0 stays where it is.
        damping: lambda, in m, above 0.
    """
    Jz = J * scale
    return -scale * (np.transpose(Jz) @ np.linalg.solve(Jz @ np.transpose(Jz) + damping**2 * np.eye(len(r)), r))


def printed_step(J: Floats, r: Floats, free: Floats) -> Floats:
    """Return dx = -(J^T J)^+ J^T r: eq. (9) as printed, with the inverse of J^T J as a Moore-Penrose inverse.

    With fewer residuals than inputs J^T J is singular at any pose. Its Moore-Penrose inverse is the reading that
    leaves the equation as it is wherever it has a value: (J^T J)^+ J^T = J^+. The step then is the shortest in x as it
    stands, a metre counting as a radian and as a whole closure, without damping.

    Args:
        J: Jacobian of the residuals, shape (residuals, 4).
        r: residuals, shape (residuals,), in m.
        free: shape (4,), 1 where an input may move, 0 where it stays.
    """
    Jf = J * free
    return -np.linalg.pinv(np.transpose(Jf) @ Jf, rcond=_RANK_TOLERANCE, hermitian=True) @ np.transpose(Jf) @ r


def broyden_update(J: Floats, dx: Floats, dr: Floats, scale: Floats) -> Floats:
    """Return the Jacobian nearest to J (in z) that explains the last move: J' dx = dr. Broyden's first update."""
    z = dx / scale
    length2 = float(z @ z)
    return J if length2 == 0.0 else J + np.outer(dr - J @ dx, z / scale) / length2


def step_scaling(dx: Floats, alpha: float, max_step: Floats) -> float:
    """Return alpha of eq. (10): as given, or smaller so that no input moves farther than max_step, shape (4,)."""
    over = np.max(np.abs(dx) / max_step)
    return min(alpha, 1.0 / float(over)) if over > 0.0 else alpha


def bounded_step(
    J: Floats,
    r: Floats,
    x: Floats,
    *,
    scale: Floats | None,
    damping: float,
    alpha: float,
    max_step: Floats,
    limits: tuple[Floats, Floats],
) -> Floats:
    """Return x + alpha dx, eq. (10), within limits, shape (4,).

    An input that the step would take out of its limits stays, and the others take over its part. `scale` is that of
    `minimum_norm_step`; None takes `printed_step`.
    """
    low, high = limits
    free = np.ones(len(x))
    dx = np.zeros(len(x))
    for _ in range(len(x)):
        dx = printed_step(J, r, free) if scale is None else minimum_norm_step(J, r, scale * free, damping)
        dx = step_scaling(dx, alpha, max_step) * dx
        out = (free > 0.0) & (((x + dx > high) & (dx > 0.0)) | ((x + dx < low) & (dx < 0.0)))
        if not np.any(out):
            break
        free[out] = 0.0
    return np.clip(x + dx, low, high)


class Verdict(enum.Enum):
    """What follows a step: closing, for three reasons; return to the best pose; new probing; the next step."""

    REACHED = 0
    STALLED = 1
    USED_UP = 2
    BACK = 3
    PROBE = 4
    STEP = 5


class Descent:
    """Reduces the cost f = 1/2 r^T r of residuals r(x), measured at rest, to the threshold: algorithm 1, steps 7 to 10.

    A step that does not reduce the least cost so far by the share `progress` is counted, and `stalled_steps` of them
    in a row end the descent. One that raises the cost is undone, and alpha halved until a step lowers it.

    Attributes:
        steps: Gauss-Newton steps made.
        best: command of the pose of least cost; empty before the first measurement.
        is_held: whether the reach held the wrist back in the last step.
    """

    def __init__(self, params: Params) -> None:
        self._params = p = params
        pregrasp = np.array([*p.p_WH_pregrasp, p.yaw_pregrasp, p.sigma_pregrasp])
        self._low = np.array([*(pregrasp[:3] - p.reach), 0.0])
        self._high = np.array([*(pregrasp[:3] + p.reach), p.sigma_limit])
        self.steps = 0
        self.best: X = ()
        self.is_held = False
        self._min_cost = math.inf
        self._jacobian: Floats = np.zeros((0, 4))
        self._x: Floats = np.zeros(4)
        self._r: Floats = np.zeros(0)
        self._stalled, self._since_probing, self._trust = 0, 0, 1.0

    @property
    def reached(self) -> bool:
        """Whether the cost measured last is at most the threshold."""
        p = self._params
        return cost(self._r) <= (p.threshold_literal if p.literal else p.threshold)

    def within_reach(self, x: X) -> X:
        """Return the inputs cut to the reach about the pre-grasp pose and to the largest closure."""
        return tuple(np.clip(x, self._low, self._high).tolist())

    def measure(self, x: X, r: Floats, command: X) -> None:
        """Take residuals r measured at inputs x under a command."""
        self._x, self._r = np.array(x), r
        if cost(r) < self._min_cost:
            self._min_cost, self.best = cost(r), command

    def probed(self, jacobian: Floats) -> None:
        """Take a Jacobian that was probed where the last measurement is."""
        self._jacobian, self._since_probing = jacobian, 0

    def next_command(self, command: X) -> X:
        """Return command + alpha dx, eqs. (9) and (10), within max_step and the reach."""
        free, goal = (self._next(command, limits) for limits in ((-_ANYWHERE, _ANYWHERE), (self._low, self._high)))
        self.is_held = bool(np.any((free < self._low)[:3] | (free > self._high)[:3]))
        return tuple(goal.tolist())

    def _next(self, command: X, limits: tuple[Floats, Floats]) -> Floats:
        p = self._params
        return bounded_step(
            self._jacobian,
            self._r,
            np.array(command),
            scale=None if p.literal else p.scale,
            damping=p.damping,
            alpha=p.alpha * self._trust,
            max_step=p.max_step,
            limits=limits,
        )

    def judge(self, x: X, r: Floats, command: X) -> Verdict:
        """Count a step that led to residuals r at inputs x, update the Jacobian by it, and return what follows."""
        p, f, before = self._params, cost(r), self._min_cost
        if not p.literal:
            self._jacobian = broyden_update(self._jacobian, np.array(x) - self._x, r - self._r, p.scale)
        self.measure(x, r, command)
        self.steps += 1
        self._since_probing += 1
        self._stalled = 0 if f < (1.0 - p.progress) * before else self._stalled + 1
        self._trust = min(1.0, _GROWTH * self._trust) if f < before else _SHRINKAGE * self._trust
        if self.reached:
            return Verdict.REACHED
        if self._stalled >= p.stalled_steps:
            return Verdict.STALLED
        if self.steps >= p.max_steps:
            return Verdict.USED_UP
        if f > before:
            return Verdict.BACK
        return Verdict.PROBE if p.literal or self._since_probing >= p.probe_every else Verdict.STEP

    def get_state(self) -> tuple[tuple[int, int, int, bool], tuple[float, float, X], tuple[Floats, Floats, Floats]]:
        """Return counters, alpha's factor, the best pose, and the linear approximation."""
        counters = (self.steps, self._stalled, self._since_probing, self.is_held)
        return counters, (self._trust, self._min_cost, self.best), (self._jacobian, self._x, self._r)

    def set_state(
        self, state: tuple[tuple[int, int, int, bool], tuple[float, float, X], tuple[Floats, Floats, Floats]]
    ) -> None:
        """Restore a state that `get_state` gave."""
        counters, (self._trust, self._min_cost, self.best), (self._jacobian, self._x, self._r) = state
        self.steps, self._stalled, self._since_probing, self.is_held = counters
