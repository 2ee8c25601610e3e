"""A free-flyer's model of its own body, and whether a control loop around that body is stable.

The body is one rigid body with a gripper on a fixed arm, [Fernandes2020] sec. 4.1.2. `stability_faults` closes the loop
at its rate, delay and lag by linear theory (`SampledLoop`), and names the delay or gains with which it would be stable.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from handover.controllers.free_flyer.sampled_loop import LinearController, LinearPlant, SampledLoop, largest_stable
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.geometry import skew
from handover.cosim.blocks.ports import Floats

_MAX_DELAY = 0.5  # s; the longest delay that is proposed as a remedy


@dataclass(frozen=True, kw_only=True)
class FlyerBody:
    """Mass in kg, inertia I_B (3, 3) about the centre of mass B in kg m2, gripper p_BG (3,) in m; G has the axes of B.

    The manipulator's joints are fixed, eq. (4.1), so the generalised velocity is the base's twist.
    """

    mass: float
    I_B: Floats
    p_BG: Floats

    def faults(self) -> list[str]:
        """Return what is impossible for a rigid body."""
        faults: list[str] = []
        if not 0.0 < self.mass < np.inf:
            faults.append(f"mass = {self.mass:g} kg must be positive and finite")
        if not np.all(np.isfinite(self.p_BG)):
            faults.append(f"p_BG = {self.p_BG.tolist()} must be finite")
        if not positive_definite(self.I_B):
            faults.append(f"I_B = {self.I_B.tolist()} must be symmetric and positive definite")
        else:
            small, middle, large = np.linalg.eigvalsh(self.I_B)
            if large > (small + middle) * (1.0 + 1e-9):
                faults.append(
                    f"I_B's principal moments {small:g}, {middle:g}, {large:g} kg m2: none may exceed the others' sum"
                )
        return faults

    def jacobian(self) -> Floats:
        """Return J (6, 6), eqs. (3.10) and (3.11) without arm joints: the twist of B to that of G, in the axes of B.

        Errata: block 12 is -[R p]x N; with angular velocities in place of rates of Euler angles N drops out.
        """
        J = np.eye(6)
        J[:3, 3:] = -skew(self.p_BG)
        return J

    def mass_matrix(self) -> Floats:
        """Return the mass matrix (6, 6) of the twist of B, in the axes of B."""
        M = np.zeros((6, 6))
        M[:3, :3], M[3:, 3:] = self.mass * np.eye(3), self.I_B
        return M

    def linear_plant(self, lag: float) -> LinearPlant:
        """Return the body near rest, behind a propulsion of first order.

        States: displacement of B (m, rad), twist of B, thrust (6, if lag > 0). Inputs: commanded wrench on B, external
        wrench on G. Outputs: displacement of G, twist of G. All in the axes of B.

        Args:
            lag: time constant of the propulsion, s; 0 if thrust follows its command without delay.
        """
        O, I, J = np.zeros((6, 6)), np.eye(6), self.jacobian()
        inverse: Floats = np.linalg.inv(self.mass_matrix()).astype(np.float64)
        A, C = np.block([[O, I], [O, O]]), np.block([[J, O], [O, J]])
        B, E = np.vstack([O, inverse]), np.vstack([O, inverse @ np.transpose(J)])
        if lag == 0.0:
            return LinearPlant(A=A, B=B, E=E, C=C)
        no_rows, no_columns = np.zeros((6, 12)), np.zeros((12, 6))
        return LinearPlant(
            A=np.block([[A, B], [no_rows, -I / lag]]),
            B=np.vstack([no_columns, I / lag]),
            E=np.vstack([E, O]),
            C=np.hstack([C, no_columns]),
        )


def positive_definite(M: Floats) -> bool:
    """Return whether a matrix is finite, symmetric (to rounding) and positive definite."""
    if not np.all(np.isfinite(M)) or np.max(np.abs(M - np.transpose(M))) > 1e-9 * np.max(np.abs(M)):
        return False
    return bool(np.all(np.linalg.eigvalsh(M) > 0.0))


class InvalidControllerParameters(InvalidParameters):
    """Parameters with which a controller cannot work; `faults` lists what is wrong with them."""

    def __init__(self, block: str, faults: list[str]) -> None:
        self.block = block
        super().__init__(faults)


class Linearised(Protocol):
    """A robot that has a linear model near rest."""

    def linear_plant(self, lag: float) -> LinearPlant:
        """Return the robot near rest, behind a propulsion of first order with a time constant in s."""
        ...


def stability_faults(
    body: Linearised, law: Callable[[float, float], LinearController], period: float, delay: float, lag: float
) -> list[str]:
    """Return nothing for a stable loop, else what is wrong and by how much delay or gains must shrink.

    Args:
        body: the robot.
        law: makes the controller with all of its gains times a factor, for a delay, which it may know of.
        period: time between two samples, s.
        delay: time from a measurement to the command's arrival at the propulsion, s.
        lag: time constant of the propulsion, s.
    """
    times = (("delay", delay), ("lag", lag))
    if faults := [f"{name} = {x:g} s must be finite and not negative" for name, x in times if not 0.0 <= x < math.inf]:
        return faults
    plant = body.linear_plant(lag)

    def pole_radius(factor: float, delay: float) -> float:
        return SampledLoop(plant, law(factor, delay), period, delay).pole_radius

    if (radius := pole_radius(1.0, delay)) < 1.0:
        return []
    fault = (
        f"the loop is unstable at {1.0 / period:g} Hz with a delay of {delay:g} s and a propulsion lag of {lag:g} s: "
        f"its largest pole has |z| = {radius:.4f}, which must be less than 1"
    )
    remedies: list[str] = []
    if (limit := largest_stable(lambda shorter: pole_radius(1.0, shorter), min(delay, _MAX_DELAY))) >= 0.001:
        remedies.append(f"a delay of at most about {_floor(limit):g} s")
    if (limit := largest_stable(lambda factor: pole_radius(factor, delay), 1.0)) >= 0.001:
        remedies.append(f"at most about {_floor(limit):g} times these gains")
    return [fault + ("; it is stable with " + " or with ".join(remedies) if remedies else "; no remedy was found")]


def _floor(limit: float) -> float:
    """Return a limit with three decimals that is not above it."""
    return math.floor(1000.0 * limit) / 1000.0
