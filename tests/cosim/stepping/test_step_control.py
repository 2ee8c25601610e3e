"""The controller of the step on a plant with a known answer."""

import pytest

from handover.cosim.stepping.step_control import PiController


@pytest.mark.parametrize("power", [2, 3])
def test_the_step_settles_where_the_error_is_just_tolerated(power: int):
    """The error is (h / h_0)^k: with the margin s, (s / r)^(1 / k) = 1 asks for r = s^(k / 0.3) at rest."""
    controller, h, h_0 = PiController(power), 1.0, 37.0
    for _ in range(60):
        h *= controller.after_acceptance((h / h_0) ** power)
    assert (h / h_0) ** power == pytest.approx(0.9 ** (power / 0.3), rel=1e-3)


def test_a_growing_error_is_answered_before_it_is_too_large():
    steady, growing = PiController(2), PiController(2)
    steady.after_acceptance(0.5)
    growing.after_acceptance(0.1)
    assert growing.after_acceptance(0.5) < steady.after_acceptance(0.5)


def test_changes_are_limited_and_a_rejected_step_gets_shorter():
    assert PiController(2).after_acceptance(0.0) == 5.0
    assert PiController(2).after_rejection(1e30) == 0.2
    assert PiController(2).after_rejection(float("inf")) == 0.2
    assert PiController(2).after_rejection(1.0001) <= 0.9
    assert PiController(2).after_rejection(4.0) == pytest.approx(0.45)
