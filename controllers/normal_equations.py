"""One step of linear least squares on few unknowns."""

import numpy as np

from handover.cosim.blocks.ports import Floats


def least_squares(J: Floats, e: Floats) -> tuple[Floats, Floats]:
    """Return x, shape (n,), that minimises |e - J x|, and J^T J, shape (n, n), of J, shape (m, n), and e, shape (m,).

    The sums go without BLAS: its threads cost more than they save on a few hundred rows, and their number would show in
    the last digits.

    Raises:
        numpy.linalg.LinAlgError: J^T J is singular.
    """
    information = np.asarray(np.einsum("ij,ik->jk", J, J), dtype=np.float64)
    slope = np.asarray(np.einsum("ij,i->j", J, e), dtype=np.float64)
    return np.asarray(np.linalg.solve(information, slope), dtype=np.float64), information


def covariance(information: Floats, sigma: float) -> Floats:
    """Return the covariance, shape (n, n), of least squares on rows with noise of standard deviation sigma."""
    return sigma**2 * np.asarray(np.linalg.inv(information), dtype=np.float64)
