"""A host that steps all units in parallel (Jacobi) gives the free-flyer's scenarios the verdict that they have here."""

from pathlib import Path

import pytest

import handover


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "given"),
    [
        ("flyer_failed_reception", {"behaviour": "rigid"}),
        ("flyer_collaborative", {"behaviour": "compliant"}),
        ("flyer_impedance", {"behaviour": "rigid", "kind": "torque", "axis": "y"}),
        ("flyer_impedance", {"behaviour": "compliant", "kind": "force", "axis": "y"}),
    ],
)
def test_a_run_succeeds_though_thrust_comes_some_steps_later(scenario: str, given: dict[str, str], tmp_path: Path):
    done = handover.run(scenario, seed=11, parameters=given, algorithm="jacobi", out=tmp_path / "r", report=False)
    assert done.success, done.reason
