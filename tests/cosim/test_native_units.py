import math
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import fmpy.fmi3
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from native_declaration import BINARY, Declaration
from native_units import declarations, native_fmu

Started = Callable[..., "Driven"]


class Driven:
    """A native unit, driven through FMPy by names."""

    def __init__(self, file: Path, folder: Path, fmi: int, declaration: Declaration) -> None:
        self._declaration = declaration
        fmpy.extract(str(file), str(folder))
        slave = fmpy.fmi2.FMU2Slave if fmi == 2 else fmpy.fmi3.FMU3Slave
        name = declaration.name
        self.fmu: Any = slave(guid=name, modelIdentifier=name, unzipDirectory=str(folder), instanceName=name)
        self.get: Any = self.fmu.getReal if fmi == 2 else self.fmu.getFloat64
        self.set: Any = self.fmu.setReal if fmi == 2 else self.fmu.setFloat64

    def references(self, *names: str) -> list[int]:
        return [self._declaration.reference(name) for name in names]

    def __getitem__(self, name: str) -> float:
        return self.get(self.references(name))[0]

    def __setitem__(self, name: str, value: float) -> None:
        self.set(self.references(name), [value])

    def step(self, t: float, h: float) -> Any:
        return self.fmu.doStep(currentCommunicationPoint=t, communicationStepSize=h)


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    """Start units with parameters; free them at the end."""
    made: list[Driven] = []

    def start(name: str, fmi: int, event_mode: bool = False, **values: float) -> Driven:
        unit = Driven(native_fmu(name, fmi), tmp_path / str(len(made)), fmi, declarations()[name])
        made.append(unit)
        unit.fmu.instantiate(**({"eventModeUsed": True, "earlyReturnAllowed": True} if event_mode else {}))
        for parameter, value in values.items():
            unit[parameter] = value
        if fmi == 2:
            unit.fmu.setupExperiment(startTime=0.0)
        unit.fmu.enterInitializationMode()
        unit.fmu.exitInitializationMode()
        return unit

    yield start
    for unit in made:
        unit.fmu.freeInstance()


def units_of(fmi: int) -> list[str]:
    return [d.name for d in declarations().values() if fmi == 3 or not d.needs_fmi3]


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
    for name in set(units_of(fmi)) - {"stateless"}:
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


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_stateless_unit_refuses_to_save(started: Started, fmi: int) -> None:
    unit = started("stateless", fmi)
    with pytest.raises(FMICallException):
        unit.fmu.getFMUstate() if fmi == 2 else unit.fmu.getFMUState()


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


def test_a_ball_returns_early_and_bounces(started: Started) -> None:
    unit = started("ball", 3, event_mode=True)
    impact = math.sqrt(2 / 9.81)
    unit.fmu.updateDiscreteStates()
    unit.fmu.enterStepMode()
    event, terminate, early, last = unit.step(0.0, 1.0)
    assert (event, terminate, early) == (True, False, True)
    assert last == pytest.approx(impact)
    unit.fmu.enterEventMode()
    unit.fmu.updateDiscreteStates()
    assert unit["v"] == pytest.approx(0.7 * 9.81 * impact)


def test_a_ball_announces_its_impact(started: Started) -> None:
    unit = started("ball", 3, event_mode=True)
    assert not unit.fmu.updateDiscreteStates()[4]
    unit.fmu.reset()
    unit.fmu.setBoolean(unit.references("announces"), [True])
    unit.fmu.enterInitializationMode()
    unit.fmu.exitInitializationMode()
    *_, defined, when = unit.fmu.updateDiscreteStates()
    assert (defined, when) == (True, pytest.approx(math.sqrt(2 / 9.81)))


def test_a_ball_without_event_mode_bounces_within_its_step(started: Started) -> None:
    unit = started("ball", 2)
    unit.step(0.0, 0.6)
    assert unit.fmu.getInteger(unit.references("bounces")) == [1]
    assert unit["v"] > 0


def test_a_counter_counts_and_carries(started: Started) -> None:
    unit = started("counter_tenths", 3, event_mode=True)
    counts: list[tuple[int, bool]] = []
    for _ in range(3):
        unit.fmu.setClock(unit.references("tick"), [True])
        counts.append((unit.fmu.getInt32(unit.references("count"))[0], unit.fmu.getClock(unit.references("carry"))[0]))
        unit.fmu.updateDiscreteStates()
    assert counts == [(1, False), (2, True), (3, False)]
    assert unit.fmu.getClock(unit.references("tick")) == [False]


def test_a_long_step_is_discarded_in_fmi2_with_the_time_reached(started: Started) -> None:
    unit = started("discards", 2)
    with pytest.raises(FMICallException) as caught:
        unit.step(0.0, 0.1)
    assert caught.value.status == fmpy.fmi2.fmi2Discard
    assert unit.fmu.getRealStatus(fmpy.fmi2.fmi2LastSuccessfulTime) == pytest.approx(0.04)


def test_a_long_step_is_discarded_in_fmi3_and_can_be_shorter(started: Started) -> None:
    unit = started("discards", 3)
    with pytest.raises(FMICallException) as caught:
        unit.step(0.0, 0.1)
    assert caught.value.status == fmpy.fmi3.fmi3Discard
    unit.step(0.0, 0.03)
    assert unit["y"] == pytest.approx(0.03)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("name", "status"), [("errs", 3), ("fatal", 4)])
def test_a_fault_is_answered(started: Started, name: str, status: int, fmi: int) -> None:
    unit = started(name, fmi)
    unit.step(0.0, 0.25)
    with pytest.raises(FMICallException) as caught:
        unit.step(0.25, 0.25)
    assert caught.value.status == status


@pytest.mark.parametrize(("name", "wrong"), [("gives_nan", math.isnan), ("gives_infinity", math.isinf)])
def test_a_wrong_value_is_given(started: Started, name: str, wrong: Callable[[float], bool]) -> None:
    unit = started(name, 3)
    unit.step(0.0, 0.25)
    assert unit["y"] == 0.25
    unit.step(0.25, 0.25)
    assert wrong(unit["y"])


def test_a_fixed_step_is_kept_to(started: Started) -> None:
    unit = started("fixed_step", 3)
    unit.step(0.0, 0.1)
    with pytest.raises(FMICallException):
        unit.step(0.1, 0.05)


def simulated(folder: Path, name: str, *statements: str) -> "subprocess.CompletedProcess[str]":
    """Drive a unit of FMI 3 in a process of its own, without states of this one's."""
    fmpy.extract(str(native_fmu(name, 3)), str(folder))
    making = f"FMU3Slave(guid={name!r}, modelIdentifier={name!r}, unzipDirectory={str(folder)!r})"
    program = (
        "from fmpy.fmi3 import FMU3Slave",
        f"made = [{making} for _ in range(5)]",
        *statements,
    )
    command: Sequence[str] = [sys.executable, "-c", "\n".join(program)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def test_the_fifth_instance_crashes(tmp_path: Path) -> None:
    done = simulated(tmp_path / "u", "crashes_on_fifth", "for unit in made: unit.instantiate(); print('made')")
    assert done.returncode < 0
    assert done.stdout.count("made") <= 4
    shutil.rmtree(tmp_path / "u")


@pytest.mark.parametrize(("name", "ends"), [("crashes", -11), ("exits", 0), ("stateless", 7)])
def test_a_process_ends_in_a_step(tmp_path: Path, name: str, ends: int) -> None:
    starting = "u.instantiate(); u.enterInitializationMode(); u.exitInitializationMode()"
    stepping = "u.doStep(0.0, 0.2); u.doStep(0.2, 0.2); raise SystemExit(7)"
    assert simulated(tmp_path / "u", name, "u = made[0]", starting, stepping).returncode == ends


def test_bytes_and_arrays_pass(started: Started) -> None:
    array, data = started("array_passer", 3), started("binary_passer", 3)
    array.set(array.references("u"), [1.0, 2.0, 3.0])
    assert list(array.get(array.references("y"), nValues=3)) == [1.0, 2.0, 3.0]
    data.fmu.setBinary(data.references("u"), [b"\0seven\0"])
    assert [bytes(b) for b in data.fmu.getBinary(data.references("y"))] == [b"\0seven\0"]
    assert declarations()["binary_passer"].variables[0].type == BINARY
