"""CPU time of a step of the free-flyer's controllers, with a robot that moves.

Run with `pytest tests/benchmarks/blocks/test_flyer_control_speed.py --benchmark-enable -s`.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.spatial.transform import Rotation

from handover.controllers.free_flyer import handover_state_machine, impedance_controller, pose_controller
from handover.controllers.free_flyer.handover_state_machine import HandoverStateMachine, HandoverTask
from handover.controllers.free_flyer.impedance_controller import ImpedanceController
from handover.controllers.free_flyer.pose_controller import PoseController

T, STEPS = 0.016, 2000


def motion() -> list[dict[str, Any]]:
    """Measured states of a robot that sways about the handover place."""
    rows: list[dict[str, Any]] = []
    for n in range(STEPS):
        phase = 0.5 * n * T
        rows.append(
            {
                "p_WB_meas": np.array([0.30, -0.07, 0.01 * np.sin(phase)]),
                "q_WB_meas": Rotation.from_rotvec([0.0, 0.02 * np.sin(phase), 0.01]).as_quat(scalar_first=True),
                "v_WB_meas": np.array([0.0, 0.0, 0.005 * np.cos(phase)]),
                "w_WB_meas": np.array([0.0, 0.01 * np.cos(phase), 0.0]),
            }
        )
    return rows


def goals(kind: Any, active: bool) -> list[Any]:
    return [kind(**row, p_WG_goal=np.array([0.4, 0.1, 0.0]), active=active) for row in motion()]


def machine() -> tuple[Any, list[Any]]:
    params = handover_state_machine.Params(task=HandoverTask.HUMAN_TO_ROBOT, patience=1e4)
    return HandoverStateMachine(params), [handover_state_machine.Inputs(**row, gripper_angle=1.2) for row in motion()]


CASES: dict[str, Callable[[], tuple[Any, list[Any]]]] = {
    "impedance control": lambda: (
        ImpedanceController(impedance_controller.Params()),
        goals(impedance_controller.Inputs, True),
    ),
    "impedance control, off": lambda: (
        ImpedanceController(impedance_controller.Params()),
        goals(impedance_controller.Inputs, False),
    ),
    "pose control": lambda: (PoseController(pose_controller.Params()), goals(pose_controller.Inputs, True)),
    "pose control, off": lambda: (PoseController(pose_controller.Params()), goals(pose_controller.Inputs, False)),
    "state machine": machine,
}


@pytest.mark.parametrize("case", list(CASES))
def test_control_step(benchmark: BenchmarkFixture, case: str):
    block, us = CASES[case]()
    costs: list[float] = []

    def run() -> None:
        begin = time.process_time()
        for n, u in enumerate(us):
            block.step(n * T, T, u)
        costs.append((time.process_time() - begin) / len(us))

    benchmark.pedantic(run, rounds=5, warmup_rounds=1)
    least = 1e6 * min(costs)
    print(f"\n{case}: {least:.1f} us of CPU a step")
    benchmark.extra_info.update(us=least)
