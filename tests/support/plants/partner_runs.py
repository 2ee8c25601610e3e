"""Courses of a gripper about an offered ball, for tests of `HandoverPartner`."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.hand.handover_partner import HandoverPartner
from handover.plants.helix.hand.partner_parameters import Inputs, Outputs, Params

STILL = Params(tremor_rms=0.0, drift_rms=0.0)
P_WO = STILL.p_WO_0
DOWN = Rotation.from_euler("xyz", [np.pi, 0.0, 0.3])
AWAY = np.array([0.0, 0.0, -0.2])


def beside(x: float, y: float, z: float) -> Floats:
    """Return a point seen from the offered ball, in W, m."""
    return P_WO + np.array([x, y, z])


def inputs(p_WG: Floats = P_WO, grip: float = 1.0, turn: Rotation = DOWN) -> Inputs:
    return Inputs(p_WG=p_WG, q_WG=turn.as_quat(scalar_first=True), grip=grip)


def walk(partner: HandoverPartner, u: Inputs, steps: int, dt: float = 0.02) -> list[Outputs]:
    return [partner.step(i * dt, dt, u) for i in range(steps)]


def take(partner: HandoverPartner, p_WG: Floats, turn: Rotation = DOWN, dt: float = 0.02) -> list[Outputs]:
    """Close the gripper at p_WG within a second, and stay for two more."""
    steps = round(3.0 / dt)
    return [partner.step(i * dt, dt, inputs(p_WG, min(1.0, i * dt), turn)) for i in range(steps)]


def taken(p_WG: Floats = P_WO, **changes: Any) -> HandoverPartner:
    partner = HandoverPartner(replace(STILL, **changes))
    take(partner, p_WG)
    return partner


def lift(partner: HandoverPartner) -> Outputs:
    """Lift a closed gripper from the offered ball's place by 0.2 m in 2 s."""
    return [partner.step(3.0 + i * 0.02, 0.02, inputs(beside(0.0, 0.0, 0.002 * i))) for i in range(100)][-1]
