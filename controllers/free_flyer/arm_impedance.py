"""Impedance of a redundant robot's gripper: base and arm near rest, and motions that the gripper ignores."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.free_flyer.arm_model import ArmModel, Chain, OperationalSpace, mass_matrix
from handover.controllers.free_flyer.gains import ImpedanceGains
from handover.controllers.free_flyer.sampled_loop import LinearController, LinearPlant, without_memory
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class NullMotion:
    """How the joints go back to their posture while the gripper stays: frequency, rad/s, and damping ratio."""

    frequency: float
    damping_ratio: float

    @property
    def rate(self) -> float:
        """Damping over inertia, 1/s."""
        return 2.0 * self.damping_ratio * self.frequency

    def scaled(self, factor: float) -> "NullMotion":
        """Return spring and damper times a factor."""
        root = factor**0.5
        return NullMotion(frequency=root * self.frequency, damping_ratio=root * self.damping_ratio)


class ArmAtRest:
    """Base and arm near rest in a posture, in the axes of B.

    Args:
        model: base and arm.
        q_J: angles of the posture, (n,), rad.
    """

    def __init__(self, model: ArmModel, q_J: Floats) -> None:
        chain = Chain(model, np.eye(3), np.zeros(3), q_J)
        self.J, self.B, self.R_BG = chain.jacobian(-1), mass_matrix(chain), chain.R[-1]
        self.space = OperationalSpace.of(self.J, self.B)

    def linear_plant(self, lag: float) -> LinearPlant:
        """Return the robot near rest, the base's wrench behind a propulsion of first order, the joints' torques not.

        States: displacement (6 + n, in m and rad), its rate, thrust (6, if lag > 0). Inputs: commanded wrench on B with
        torques on the joints, external wrench on G. Outputs: displacement and its rate.

        Args:
            lag: time constant of the propulsion, s; 0 if thrust follows its command without delay.
        """
        n = len(self.B)
        inverse: Floats = np.linalg.inv(self.B).astype(np.float64)
        A, E = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 6))
        A[:n, n:], E[n:] = np.eye(n), inverse @ np.transpose(self.J)
        B: Floats = np.vstack([np.zeros((n, n)), inverse])
        C = np.eye(2 * n)
        if lag == 0.0:
            return LinearPlant(A=A, B=B, E=E, C=C)
        thrust = np.vstack([np.eye(6) / lag, np.zeros((n - 6, 6))])
        torques: Floats = np.hstack([np.zeros((2 * n, 6)), B[:, 6:]])
        return LinearPlant(
            A=np.block([[A, B[:, :6]], [np.zeros((6, 2 * n)), -np.eye(6) / lag]]),
            B=np.vstack([torques, np.transpose(thrust)]),
            E=np.vstack([E, np.zeros((6, 6))]),
            C=np.hstack([C, np.zeros((2 * n, 6))]),
        )

    def law(self, gains: ImpedanceGains, null: NullMotion) -> LinearController:
        """Return the law of `ArmImpedanceController` near rest: commanded forces from displacement and its rate."""
        J, B, Z, n = self.J, self.B, self.space.Z, len(self.B)
        K, D = (_in_axes(self.R_BG, gain) for gain in (gains.stiffness(), gains.damping()))
        angles = np.hstack([np.zeros((n - 6, 6)), np.eye(n - 6)])
        rates = np.linalg.solve(self.space.inertia, np.transpose(Z) @ B)
        return without_memory(
            np.hstack(
                [
                    np.transpose(J) @ K @ J + null.frequency**2 * B @ Z @ angles,
                    np.transpose(J) @ D @ J + null.rate * B @ Z @ rates,
                ]
            )
        )


def _in_axes(R: Floats, gain: Floats) -> Floats:
    """Return a gain (6, 6) of translation and rotation whose axes R (3, 3) turns."""
    turned = np.kron(np.eye(2), R)
    return turned @ gain @ np.transpose(turned)
