from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import build_block
from handover.plants.free_flyer.robot.push import Axis, Inputs, Params, Push

PULSE = Params(axis=Axis.Z, force=5.0, torque=-3.0, start=0.105, duration=0.05)


@pytest.mark.parametrize("dt", [0.001, 0.016, 0.03, 0.2])
def test_impulse_is_exact_wherever_the_edges_lie(dt: float):
    push = Push(PULSE)
    ys = [push.step(i * dt, dt, Inputs()) for i in range(round(0.4 / dt) + 1)]
    np.testing.assert_allclose(dt * np.sum([y.f_G for y in ys], axis=0), [0.0, 0.0, 0.25], rtol=1e-12)
    np.testing.assert_allclose(dt * np.sum([y.tau_G for y in ys], axis=0), [0.0, 0.0, -0.15], rtol=1e-12)


def test_is_the_share_of_the_step_that_it_covers():
    push = Push(PULSE)
    shares = [push.step(0.016 * i, 0.016, Inputs()).f_G[2] / 5.0 for i in range(11)]
    np.testing.assert_allclose(shares, [0, 0, 0, 0, 0, 0, 7 / 16, 1, 1, 11 / 16, 0], atol=1e-12)


@pytest.mark.parametrize("axis", Axis)
def test_acts_along_its_axis_alone(axis: Axis):
    y = Push(Params(axis=axis, force=2.0, torque=1.0, start=0.0)).step(0.0, 0.016, Inputs())
    np.testing.assert_array_equal(y.f_G, 2.0 * np.eye(3)[axis])
    np.testing.assert_array_equal(y.tau_G, np.eye(3)[axis])


def test_nothing_has_acted_at_the_start():
    y = Push(Params(start=0.0)).outputs(0.0, Inputs())
    np.testing.assert_array_equal(y.f_G, np.zeros(3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("push")


def built(folder: Path, path: str, fmi: int) -> Path:
    return build_block(path, fmi, folder, step=Fraction(2, 125))


def speeds_under(folder: Path, algorithm: Algorithm, push_first: bool) -> list[float]:
    """Return the robot's speed at each communication point."""
    system = System()
    files = {
        "push": built(folder, "handover.plants.free_flyer.robot.push:Push", 3),
        "robot": built(folder, "handover.plants.free_flyer.robot.free_flyer:FreeFlyer", 3),
    }
    starts: dict[str, dict[str, Any]] = {"push": {"start": 0.0, "duration": 0.05}, "robot": {}}
    names = ["push", "robot"] if push_first else ["robot", "push"]
    units = {name: system.add(name, files[name], **starts[name]) for name in names}
    system.connect(units["push"].y.f_G, units["robot"].u.f_G)
    speeds: list[float] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        speeds.append(float(signals["robot.v_WB"][0]))

    with Master(system, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(16, 125), [observe])
    return speeds


@pytest.mark.parametrize(
    ("algorithm", "push_first", "at_once"),
    [
        (Algorithm.JACOBI, True, False),
        (Algorithm.JACOBI, False, False),
        (Algorithm.GAUSS_SEIDEL, True, True),
        (Algorithm.GAUSS_SEIDEL, False, False),
        (Algorithm.FIXED_POINT, False, True),
        (Algorithm.NEWTON, False, True),
    ],
)
def test_a_robot_gets_the_whole_impulse_and_in_the_first_step_if_the_algorithm_says_so(
    folder: Path, algorithm: Algorithm, push_first: bool, at_once: bool
):
    speeds = speeds_under(folder, algorithm, push_first)
    assert (speeds[1] > 0.0) is at_once
    assert speeds[-1] == pytest.approx(5.0 * 0.05 / 9.584, rel=1e-12)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_without_inputs_is_valid_and_runs_elsewhere(folder: Path, fmi: int):
    file = built(folder, "handover.plants.free_flyer.robot.push:Push", fmi)
    assert validate_fmu(str(file)) == []
    result = fmpy.simulate_fmu(str(file), stop_time=1.6, output_interval=0.016, start_values={"start": 0.805})
    f = result["f_G[1]"] if fmi == 2 else result["f_G"][:, 0]
    assert 0.016 * np.sum(f) == pytest.approx(2.5, rel=1e-9)
