"""A host that steps all units in parallel (Jacobi) gives each scenario of the free-flyer the same verdict."""

from pathlib import Path

import pytest

import handover
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, Wrench

HANDOVERS = ("flyer_robot_to_human", "flyer_human_to_robot", "flyer_failed_reception", "flyer_collaborative")


@pytest.mark.slow
@pytest.mark.parametrize("behaviour", [b.item for b in Behaviour])
@pytest.mark.parametrize("scenario", HANDOVERS)
def test_a_handover_succeeds_as_it_does_in_sequence(scenario: str, behaviour: str, tmp_path: Path):
    ended = [
        handover.run(
            scenario,
            seed=11,
            parameters={"behaviour": behaviour},
            algorithm=algorithm,
            out=tmp_path / algorithm,
            report=False,
        )
        for algorithm in ("gauss-seidel", "jacobi")
    ]
    assert [run.success for run in ended] == [True, True], [run.reason for run in ended]


@pytest.mark.slow
@pytest.mark.parametrize("behaviour", [b.item for b in Behaviour])
def test_every_push_agrees_with_the_impedance_model_though_thrust_comes_some_steps_later(
    behaviour: str, tmp_path: Path
):
    for kind in Wrench:
        for axis in Axis:
            parameters = {"behaviour": behaviour, "kind": kind.name.lower(), "axis": axis.name.lower()}
            run = handover.run(
                "flyer_impedance",
                seed=11,
                parameters=parameters,
                algorithm="jacobi",
                out=tmp_path / f"{kind}{axis}",
                report=False,
            )
            assert run.success, (parameters, run.reason)
