"""The native test units that fail do so as they say."""

import math
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import fmpy
import fmpy.fmi2
import fmpy.fmi3
import pytest
from driven_unit import Started
from fmpy.fmi1 import FMICallException
from native_units import native_fmu


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_stateless_unit_refuses_to_save(started: Started, fmi: int) -> None:
    unit = started("stateless", fmi)
    with pytest.raises(FMICallException):
        unit.fmu.getFMUstate() if fmi == 2 else unit.fmu.getFMUState()


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


@pytest.mark.parametrize(("name", "ends"), [("crashes", -11), ("exits", 0), ("stateless", 7)])
def test_a_process_ends_in_a_step(tmp_path: Path, name: str, ends: int) -> None:
    starting = "u.instantiate(); u.enterInitializationMode(); u.exitInitializationMode()"
    stepping = "u.doStep(0.0, 0.2); u.doStep(0.2, 0.2); raise SystemExit(7)"
    assert simulated(tmp_path / "u", name, "u = made[0]", starting, stepping).returncode == ends
