"""The fields that `handover play` offers for parameters: their sliders, which there are, and what is told of faults."""

import pytest

from handover.cosim.blocks.variable import Causality, Declared, Kind
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.live.parameter_fields import field_groups, field_of, without_call


@pytest.mark.parametrize(
    ("default", "minimum", "lowest"),
    [
        ("0.25", None, [0.0]),  # as of a mass
        ("0.1,0.2,0.3", None, [0.0, 0.0, 0.0]),
        ("0.0", None, [-3.0]),
        ("0.5,-0.5", None, [-1.0, -2.0]),  # as of a position
        ("2.0", -1.0, [-1.0]),
    ],
)
def test_a_slider_begins_at_the_declared_minimum_or_at_0_for_what_is_positive(
    default: str, minimum: float | None, lowest: list[float]
):
    declared = Declared(name="x", kind=Kind.REAL, causality=Causality.PARAMETER, minimum=minimum)
    assert [slider[0] for slider in field_of(declared, default).sliders] == lowest


def test_a_parameter_of_an_algorithm_that_no_session_runs_by_is_shown_only_where_it_is_given():
    for given in ((), ("parallel_step=0.004",)):
        groups = field_groups(RunRequest(subject="flyer_impedance", parameters=given))
        names = [field.name for group in groups for field in group.fields]
        assert ("parallel_step" in names) == bool(given)
        assert "force" in names


def test_a_fault_is_told_without_the_call_that_refused_it():
    told = "p: out of reach"
    for call in ("fmi3GetFloat64 answered Error", "fmi2ExitInitializationMode answered Discard"):
        assert without_call(f"{told} ({call}); set by the scenario") == f"{told}; set by the scenario"
    assert without_call("x (of fmi3GetFloat64) is wrong") == "x (of fmi3GetFloat64) is wrong"
