"""The chain as a straight beam in a wall, where it rests, and how beams bend far."""

from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.chain import Pose, VslChain
from handover.plants.vsl.parameters import Link, Params
from handover.plants.vsl.statics import VslStatics

STIFF = 1e11
ONE_LINK = Params(
    link_2=Link.RIGID,
    EI_rigid=1e9,
    cap=0.0,
    link_mass=0.0,
    servo_mass=0.0,
    gripper_mass=0.0,
    joint_stiffness=STIFF,
    servo_stiffness=STIFF,
)
"""Link 2 does not give: what does is link 3, a straight beam in a wall."""


def rest(params: Params, theta: tuple[float, ...], p: float, load: float, hinges: int = 6) -> tuple[VslChain, Pose]:
    chain = VslChain(params, hinges)
    statics = VslStatics(chain, params.gravity, 1.0 / params.servo_stiffness)
    statics.settle(theta, (p,) * params.links, load)
    return chain, statics.pose


def tip(params: Params, theta: tuple[float, ...], p: float, load: float, hinges: int = 6) -> complex:
    chain, pose = rest(params, theta, p, load, hinges)
    return complex(chain.ends(pose)[-1])


def elastica(force: float, EI: float, l: float) -> tuple[float, float]:
    """Return how far the tip of an inextensible cantilever goes along and across under a transverse force at its tip.

    EI theta'' = -F cos(theta), theta(0) = theta'(l) = 0.
    """

    def slopes(_s: Floats, y: Floats) -> Floats:
        return np.vstack([y[1], -force / EI * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(a: Floats, b: Floats) -> Floats:
        return np.array([a[0], b[1], a[2], a[3]])

    solution: Any = solve_bvp(slopes, ends, np.linspace(0.0, l, 50), np.zeros((4, 50)), tol=1e-9)
    assert solution.success
    return float(solution.y[2, -1]), float(solution.y[3, -1])
