"""Partial derivatives of a unit that has them, against differences of its outputs through the same interface."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray
from support.fmus.ctypes_host import DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.unit_calls import INPUTS, OUTPUTS, TANGENT, derivative, references
from support.fmus.workshop import Workshop, expect_error
from support.wording import Wording

EPSILON = 1e-6

both = pytest.mark.parametrize("fmi", [2, 3])


def outputs(host: CtypesHost) -> NDArray[np.float64]:
    return np.array([x for n, size in OUTPUTS.items() for x in host.get(n, size)])


def jacobian_by_differences(host: CtypesHost) -> NDArray[np.float64]:
    """Central differences in initialisation mode, where outputs follow inputs without a step."""
    columns: list[NDArray[np.float64]] = []
    for name, size in INPUTS.items():
        at = host.get(name, size)
        for i in range(size):
            ends: list[NDArray[np.float64]] = []
            for sign in (1, -1):
                host.set(name, [x + sign * EPSILON * (i == j) for j, x in enumerate(at)])
                ends.append(outputs(host))
            host.set(name, at)
            columns.append((ends[0] - ends[1]) / (2 * EPSILON))
    return np.column_stack(columns)


@both
def test_derivatives_are_the_differences_of_the_outputs(workshop: Workshop, fmi: int):
    host = workshop.host(TANGENT, fmi)
    host.enter()
    J = jacobian_by_differences(host)
    assert np.linalg.matrix_rank(J) >= 3
    for seed in [*np.eye(7), np.arange(7.0) - 2.5]:
        status, dy = derivative(host, seed.tolist())
        assert status == OK, host.log[-1]
        assert dy == pytest.approx(J @ seed, abs=1e-7)
    some = [1.0, 2.0, 3.0, 4.0]
    status, dy = derivative(host, some, knowns={"s": 3, "a": 1}, unknowns={"p": 3})
    assert status == OK
    assert dy == pytest.approx(J[1:, 4:7] @ some[:3] + J[1:, 0] * 4.0, abs=1e-7)
    if fmi == 3:
        weights = np.array([0.5, -1.0, 2.0, 3.0])
        status, result = derivative(host, weights.tolist(), "GetAdjointDerivative")
        assert status == OK
        assert result == pytest.approx(weights @ J, abs=1e-7)


@both
def test_derivatives_are_there_in_step_mode_and_after_and_not_before(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(TANGENT, fmi)
    expect_error(wording, host, derivative(host, [1.0] * 7)[0])
    host.initialise()
    first = derivative(host, [1.0] * 7)
    host.set("a", [1.0])
    assert host.step(0.0, 0.1) == OK
    second = derivative(host, [1.0] * 7)
    assert first[0] == second[0] == OK
    assert first[1] != second[1]
    assert host.call("Terminate") == OK
    assert derivative(host, [1.0] * 7) == second


@both
def test_what_is_no_real_input_or_output_or_of_another_size_is_refused(workshop: Workshop, fmi: int, wording: Wording):
    host = workshop.host(TANGENT, fmi)
    host.initialise()
    for knowns, unknowns, seed in [
        ({"n": 1}, OUTPUTS, [1.0]),
        ({"y": 1}, OUTPUTS, [1.0]),
        (INPUTS, {"a": 1}, [1.0] * 7),
        ({"gain": 1}, OUTPUTS, [1.0]),
        (INPUTS, OUTPUTS, [float("nan")] * 7),
    ]:
        expect_error(wording, host, derivative(host, seed, knowns=knowns, unknowns=unknowns)[0])
    assert derivative(host, [666.0] + [0.0] * 6)[0] == ERROR
    wording.check(host.log[-1].splitlines()[-1])  # of what is not an output
    if fmi == 3:
        expect_error(wording, host, derivative(host, [1.0] * 6)[0])
        k, u = references(host, INPUTS), references(host, OUTPUTS)
        arguments = (u, SIZE(2), k, SIZE(3), None, SIZE(7), (DOUBLE * 4)(), SIZE(4))
        expect_error(wording, host, host.call("GetDirectionalDerivative", *arguments))
    assert derivative(host, [1.0] * 7)[0] == OK
    assert host.step(0.0, 0.1) == OK


@both
def test_only_a_unit_that_has_derivatives_says_so(workshop: Workshop, fmi: int, wording: Wording):
    names = {2: ["providesDirectionalDerivative"], 3: ["providesDirectionalDerivatives", "providesAdjointDerivatives"]}
    for block, expected in ((TANGENT, "true"), ("scalars:Scalars", None)):
        host = workshop.host(block, fmi)
        interface = ET.parse(host.folder / "modelDescription.xml").getroot().find("CoSimulation")
        assert interface is not None
        assert [interface.get(n) for n in names[fmi]] == [expected] * len(names[fmi])
    host.initialise()
    expect_error(wording, host, derivative(host, [1.0], knowns={"u1": 1}, unknowns={"y1": 1})[0])
