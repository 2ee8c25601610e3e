"""The native test units compute what they say, in both standards."""

import math

import pytest
from driven_unit import Started
from fmpy.validation import validate_fmu
from native_declaration import BINARY
from native_units import declarations, native_fmu

HARM_HERE = ("_in_load", "_in_unload", "_in_instantiate", "_in_free")
"""Ends of the names of units that would harm this process, as the validation loads and instantiates them."""


def units_of(fmi: int) -> list[str]:
    known = [d.name for d in declarations().values() if fmi == 3 or not d.needs_fmi3]
    return [name for name in known if not name.endswith(HARM_HERE)]


@pytest.mark.parametrize("fmi", [2, 3])
def test_all_units_are_valid(fmi: int) -> None:
    problems = {name: validate_fmu(str(native_fmu(name, fmi))) for name in units_of(fmi)}
    assert {name: found for name, found in problems.items() if found} == {}
    assert len(problems) > 20


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_mass_swings(started: Started, fmi: int) -> None:
    unit = started("mass", fmi, k=4.0, x0=1.0)
    unit.step(0.0, 1.0)
    assert unit["x"] == pytest.approx(math.cos(2.0), abs=1e-11)
    assert unit["v"] == pytest.approx(-2 * math.sin(2.0), abs=1e-11)


@pytest.mark.parametrize("fmi", [2, 3])
def test_two_masses_swing_against_each_other(started: Started, fmi: int) -> None:
    """Antisymmetric, w^2 = 2 k_c / m; small steps, held inputs."""
    a, b = started("mass", fmi, x0=1.0), started("sprung_mass", fmi, x0=-1.0, k_c=2.0)
    steps, h = 1000, 1e-3
    for i in range(steps):
        b["x1"], b["v1"] = a["x"], a["v"]
        a["f"] = b["f"]
        a.step(i * h, h)
        b.step(i * h, h)
    assert a["x"] == pytest.approx(math.cos(2.0), abs=3e-3)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("name", "given", "outputs"),
    [
        ("sum", {"u1": 2.0, "u2": 3.0, "a1": 2.0, "a2": -1.0, "b": 0.5}, {"y": 1.5}),
        ("integrator", {"u": 2.0, "x0": 1.0}, {"x": 2.0}),
        ("sine", {"a": 2.0, "w": 3.0, "phase": 0.1, "b": 1.0}, {"y": 2.0 * math.sin(1.6) + 1.0}),
        ("ramp", {"slope": 2.0, "b": 1.0}, {"y": 2.0}),
        ("spring", {"x2": 0.5, "v1": 1.0, "k": 4.0, "d": 0.5}, {"f1": 1.5, "f2": -1.5}),
        ("workshop", {"angle_in": 90.0, "temperature_in": 20.0}, {"angle": 90.0, "temperature": 20.0}),
        ("si", {"length_in": 0.5}, {"length": 0.5}),
        ("trivial", {"u": 2.0}, {"y": 3.0}),
        ("hub", {f"u{i}": float(i) for i in range(1, 6)}, {"y": 16.0}),
    ],
)
def test_outputs_after_half_a_second(
    started: Started, name: str, given: dict[str, float], outputs: dict[str, float], fmi: int
) -> None:
    unit = started(name, fmi, **given)
    unit.step(0.0, 0.5)
    assert {y: unit[y] for y in outputs} == pytest.approx(outputs)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_gain_answers_at_once(started: Started, fmi: int) -> None:
    unit = started("gain", fmi, a=3.0, b=1.0)
    unit["u"] = 2.0
    assert unit["y"] == 7.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_serialised_states_come_back(started: Started, fmi: int) -> None:
    for name in {n for n in units_of(fmi) if "_in_" not in n} - {"stateless"}:  # those harm this process
        unit = started(name, fmi)
        fmu = unit.fmu
        save, write, read, restore = (
            (fmu.getFMUstate, fmu.serializeFMUstate, fmu.deSerializeFMUstate, fmu.setFMUstate)
            if fmi == 2
            else (fmu.getFMUState, fmu.serializeFMUState, fmu.deserializeFMUState, fmu.setFMUState)
        )
        before = write(save())
        unit.step(0.0, 0.1 if name == "fixed_step" else 0.01)
        assert write(save()) != before, name
        restore(read(before))
        assert write(save()) == before, name


def test_input_derivatives_are_followed(started: Started) -> None:
    """m x'' = t: x = t^3 / 6."""
    unit = started("mass", 2)
    unit["f"] = 0.0
    unit.fmu.setRealInputDerivatives(unit.references("f"), [1], [1.0])
    unit.step(0.0, 1.0)
    assert unit["x"] == pytest.approx(1 / 6, abs=1e-9)


def test_directional_derivatives_tell_of_the_last_step(started: Started) -> None:
    unit = started("mass", 3, m=2.0)
    unit.step(0.0, 0.5)
    change = unit.fmu.getDirectionalDerivative(unit.references("x", "v"), unit.references("f"), [1.0])
    assert list(change) == pytest.approx([0.5**2 / 4, 0.25], abs=1e-12)


def test_bytes_and_arrays_pass(started: Started) -> None:
    array, data = started("array_passer", 3), started("binary_passer", 3)
    array.set(array.references("u"), [1.0, 2.0, 3.0])
    assert list(array.get(array.references("y"), nValues=3)) == [1.0, 2.0, 3.0]
    data.fmu.setBinary(data.references("u"), [b"\0seven\0"])
    assert [bytes(b) for b in data.fmu.getBinary(data.references("y"))] == [b"\0seven\0"]
    assert declarations()["binary_passer"].variables[0].type == BINARY
