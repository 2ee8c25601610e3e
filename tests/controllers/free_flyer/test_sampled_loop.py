"""Against closed forms of a mass under sampled control."""

import math
from typing import Any

import control as untyped_control
import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from handover.controllers.free_flyer.sampled_loop import (
    LinearController,
    LinearPlant,
    SampledLoop,
    largest_stable,
    without_memory,
)
from handover.cosim.blocks.ports import Floats

T = 0.016
control: Any = untyped_control
ROLLER = LinearPlant(A=np.zeros((1, 1)), B=np.eye(1), E=np.eye(1), C=np.eye(1))  # x' = u + d


def spring(m: float = 2.0, k: float = 18.0, c: float = 3.0) -> tuple[LinearPlant, LinearController]:
    plant = LinearPlant(
        A=np.array([[0.0, 1.0], [0.0, 0.0]]), B=np.array([[0.0], [1 / m]]), E=np.array([[0.0], [1 / m]]), C=np.eye(2)
    )
    return plant, without_memory(np.array([[k, c]]))


@pytest.mark.parametrize("gain", [1.0, 30.0, 120.0, 130.0])
def test_integrator_has_the_pole_of_its_closed_form(gain: float):
    loop = SampledLoop(ROLLER, without_memory(np.array([[gain]])), T)
    assert loop.pole_radius == pytest.approx(abs(1.0 - gain * T))
    assert (loop.pole_radius < 1.0) == (gain < 2.0 / T)


@pytest.mark.parametrize("periods", [0.0, 0.3, 1.0, 2.0 - 1e-13, 3.25])
def test_poles_with_delay_solve_the_difference_equation(periods: float):
    """x[n+1] = x[n] - g ((T - p) x[n-k] + p x[n-k-1]) for a delay of k T + p."""
    g, k = 20.0, int(periods + 1e-9)
    p = (periods - k) * T
    polynomial = np.zeros(k + 3)
    polynomial[0], polynomial[1] = 1.0, -1.0
    polynomial[k + 1] += g * (T - p)
    polynomial[k + 2] += g * p
    loop = SampledLoop(ROLLER, without_memory(np.array([[g]])), T, periods * T)
    wanted = np.roots(polynomial)
    for z in wanted[np.abs(wanted) > 1e-6]:
        assert np.min(np.abs(loop.poles - z)) < 1e-6


def test_fast_sampling_gives_the_continuous_damping_ratio():
    m, k, c = 2.0, 18.0, 3.0
    ratio, frequency = SampledLoop(*spring(m, k, c), 1e-4).least_damped
    assert ratio == pytest.approx(c / (2.0 * math.sqrt(k * m)), rel=1e-3)
    assert frequency == pytest.approx(math.sqrt(k / m), rel=1e-3)


@pytest.mark.parametrize("past", [0.0, 0.3 * T])
def test_response_is_the_recursion_of_held_forces_of_the_commands_on_their_way(past: float):
    """Of a delay of one period and a part, in which the older command acts; it settles at force over stiffness."""
    m, k, c, f = 2.0, 18.0, 3.0, 0.5
    y = SampledLoop(*spring(m, k, c), T, T + past).response(np.full((800, 1), f))
    x, v, commands = 0.0, 0.0, [0.0, 0.0]
    for n in range(len(y)):
        np.testing.assert_allclose(y[n], [x, v], atol=1e-12)
        commands.append(-k * x - c * v)
        for h, command in ((past, commands[n]), (T - past, commands[n + 1])):
            a = (command + f) / m
            x, v = x + v * h + a * h * h / 2.0, v + a * h
    assert y[-1, 0] == pytest.approx(f / k, rel=1e-3)


def test_memory_of_the_controller_takes_the_offset_away():
    plant, law = spring()
    integral = LinearController(A=np.eye(1), B=np.array([[T, 0.0]]), C=np.array([[12.0]]), D=law.D)
    y: Floats = SampledLoop(plant, integral, T).response(np.full((4000, 1), 0.5))
    assert abs(y[-1, 0]) < 1e-6
    assert np.max(y[:, 0]) > 0.01


def test_bisection_finds_the_limit():
    assert largest_stable(lambda x: x / 0.7, 1.0) == pytest.approx(0.7, abs=1e-3)
    assert largest_stable(lambda _: 2.0, 1.0) == 0.0


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_loop_is_sampled_in_one_thread_of_blas_and_their_number_is_left(monkeypatch: pytest.MonkeyPatch):
    seen, sample = list[set[int]](), control.sample_system

    def noted(*given: Any, **more: Any) -> Any:
        seen.append(threads())
        return sample(*given, **more)

    monkeypatch.setattr(control, "sample_system", noted)
    with threadpool_limits(2, "blas"):
        assert SampledLoop(*spring(), T).pole_radius < 1.0
        seen.append(threads())
    assert seen[0] == {1}
    assert seen[-1] == {2}
