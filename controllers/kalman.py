"""Kalman filter of a position that is expected to stay where it is. [Vervloet2025] eqs. (14)-(15)."""

import numpy as np

from handover.cosim.blocks.ports import Floats


class UnusableMeasurement(ValueError):
    """A measurement that is said to be seen holds numbers that are not finite."""

    def __init__(self, X_new: Floats) -> None:
        super().__init__(f"measurement {X_new.tolist()} is not finite; clear its `seen` flag where nothing is seen")
        self.X_new = X_new


class PositionFilter:
    """Position X, shape (3,), in m, and its covariance P, shape (3, 3), in m^2, from measurements.

    Q, P and R start as multiples of the identity, in m^2. In the long run only Q/R acts on X, as long as R is constant.
    `seen` says whether there ever was a measurement.
    """

    def __init__(self, X: Floats, P: float, Q: float, R: float) -> None:
        self.position: Floats = np.array(X)
        self.covariance: Floats = P * np.eye(3)
        self.seen = False
        self._Q: Floats = Q * np.eye(3)
        self._R: Floats = R * np.eye(3)

    def predict(self) -> None:
        """X <- X, P <- P + Q, eq. (14)."""
        self.covariance = self.covariance + self._Q

    def update(self, X_new: Floats, R: Floats | None = None) -> None:
        """X <- X + K (X_new - X), P <- P - K P with K = P (P + R)^-1, eq. (15).

        Args:
            X_new: the measurement, shape (3,), in m.
            R: its covariance, shape (3, 3), in m^2, where it is not the filter's own.

        Raises:
            UnusableMeasurement: X_new is not finite.
        """
        if not np.isfinite(X_new).all():
            raise UnusableMeasurement(X_new)
        X, P = self.position, self.covariance
        K = np.transpose(np.linalg.solve(P + (self._R if R is None else R), P))  # P and R are symmetric
        P_new = P - K @ P
        self.position = X + K @ (X_new - X)
        self.covariance = 0.5 * (P_new + np.transpose(P_new))  # stays symmetric under rounding
        self.seen = True

    def get_state(self) -> tuple[Floats, Floats, bool]:
        """Return position, covariance and `seen`."""
        return self.position, self.covariance, self.seen

    def set_state(self, state: tuple[Floats, Floats, bool]) -> None:
        """Go back to what `get_state` gave."""
        self.position, self.covariance, self.seen = state
