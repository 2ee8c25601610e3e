import numpy as np
import pytest

from handover.scenarios.helix.evaluation import model_mismatch

HANGING = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])


def test_a_model_that_hangs_is_as_far_from_the_arm_as_the_arm_has_gone():
    found = model_mismatch(HANGING, np.array([0.03, 0.04, -0.58]))
    assert found.model_travel == pytest.approx(0.0, abs=1e-12)
    assert found.arm_travel == found.apart == pytest.approx(0.13)


def test_a_model_that_bends_towards_minus_y_of_the_base_is_at_plus_y_of_the_world():
    """R_WB = diag(1, -1, -1)."""
    bent = HANGING + np.array([0.0, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    towards, away = (model_mismatch(bent, np.array([0.0, y, -0.65])).apart for y in (0.2, -0.2))
    assert towards < 0.1 < away
