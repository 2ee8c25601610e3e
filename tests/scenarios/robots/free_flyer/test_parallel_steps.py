"""A host that steps all units in parallel (Jacobi) gives the free-flyer's scenarios the verdict that they have here."""

from pathlib import Path

import pytest

import handover


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["flyer_robot_to_human", "flyer_impedance"])
def test_a_run_succeeds_though_thrust_comes_some_steps_later(scenario: str, tmp_path: Path):
    done = handover.run(scenario, seed=11, algorithm="jacobi", out=tmp_path / "r", report=False)
    assert done.success, done.reason
