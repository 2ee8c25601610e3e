"""A virtual mass on a spring and a damper, which a wrench displaces: the admittance of a free-flyer's gripper."""

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody
from handover.controllers.free_flyer.gains import ImpedanceGains, PidGains
from handover.controllers.free_flyer.sampled_loop import LinearController, discretised
from handover.controllers.free_flyer.wrench_observer import ThrustModel, WrenchObserver
from handover.cosim.blocks.ports import Floats


class VirtualBody:
    """k_M x'' + k_B x' + k_D x = F, the admittance of second order of eq. (2.17), sampled exactly with F held.

    x is the displacement from the goal: position, and rotation vector, whose rate is taken for the angular velocity, as
    it is where the body turns about one axis. All in the goal's axes, as (6,) or (6, n).

    Args:
        body: whose mass matrix k_M is a multiple of; the virtual one has its centre of mass in G.
        gains: stiffness k_D and damping k_B.
        ratio: virtual over real mass and inertia.
        period: for which F is held, s.
    """

    def __init__(self, body: FlyerBody, gains: ImpedanceGains, ratio: float, period: float) -> None:
        O, I = np.zeros((6, 6)), np.eye(6)
        inverse: Floats = np.linalg.inv(ratio * body.mass_matrix()).astype(np.float64)
        A = np.block([[O, I], [-inverse @ gains.stiffness(), -inverse @ gains.damping()]])
        self._A, self._B = discretised(A, np.vstack([O, inverse]), period)

    def moved(self, state: Floats, wrench: Floats) -> Floats:
        """Return displacement and twist, 12 rows, a period later."""
        return self._A @ state + self._B @ wrench


def admittance_law(
    body: FlyerBody,
    virtual: VirtualBody,
    observer: WrenchObserver,
    thrust: ThrustModel,
    position: PidGains,
    attitude: PidGains,
    period: float,
) -> LinearController:
    """Return the law of `AdmittanceController` near the goal: commanded wrench on B from displacement and twist of G.

    Its state: the observer's memory (6), displacement and twist of the virtual body (12), thrust (6) and the commands
    that have not yet arrived (6 each). Each row block is followed as a linear function of state and measurement.
    """
    M, J = body.mass_matrix(), body.jacobian()
    base, to_gripper = np.linalg.inv(J), np.transpose(np.linalg.inv(J))
    P, D = (np.diag(np.repeat([getattr(position, k), getattr(attitude, k)], 3)) for k in ("k_P", "k_D"))
    sizes = [6, 12, 6] + [6] * thrust.remembered
    n = sum(sizes)
    memory, z, y, *rest = np.split(np.eye(n + 12), np.cumsum([*sizes, 6]))
    past, x_G, v_G = rest[:-2], rest[-2], rest[-1]
    momentum = M @ base @ v_G
    w = observer.estimate(memory, momentum)
    z_next = virtual.moved(z, to_gripper @ w)
    a = (z_next[6:] - z[6:]) / period
    u = M @ (base @ a + P @ base @ (z[:6] - x_G) + D @ base @ (z[6:] - v_G)) - w
    y_next, mean = thrust.over_period(y, [u, *past])
    waiting = [u, *past][: thrust.remembered]
    following = np.vstack([observer.following(memory, momentum, mean), z_next, y_next, *waiting])
    return LinearController(A=following[:, :n], B=following[:, n:], C=-u[:, :n], D=-u[:, n:])
