"""CPU time of a control cycle of the visual servo: filters, state optimisation, Jacobian control.

Run with `pytest tests/benchmarks/blocks/test_servo_speed.py --benchmark-enable -s`.
"""

import math
import time

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.visual_servo import Inputs, Params, Phase, VisualServo

W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def cycle_times(alpha: float) -> list[float]:
    """Seconds of CPU of each cycle on the way to four balls, with an arm that bends by 0.55 of the command."""
    times: list[float] = []
    for angle in np.radians([0.0, 45.0, 90.0, 135.0]):
        rng, servo = np.random.default_rng(0), VisualServo(Params(alpha=alpha))
        p_WO = np.array([0.18 * math.cos(angle), 0.18 * math.sin(angle), -0.6])
        q = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
        for n in range(100):
            X = rng.normal(W_FROM_B * forward_kinematics(q, 0.10), 0.002)
            u = Inputs(p_WO_meas=p_WO, p_WR_meas=X[:3], p_WG_meas=X[3:], seen_O=True, seen_R=True)
            begin = time.process_time()
            y = servo.step(0.5 * n, 0.5, u)
            times.append(time.process_time() - begin)
            if y.phase is Phase.GRASP:
                break
            q = q + 0.6 * (y.q_sys * np.tile([0.55, 0.55, 1.02], 3) - q)
        else:
            raise AssertionError(f"the ball at {angle:.2f} rad was not reached")
    return times


def test_control_cycle(benchmark: BenchmarkFixture):
    times: list[float] = []
    benchmark.pedantic(lambda: times.extend(cycle_times(0.4)), rounds=3, warmup_rounds=1)
    median, slowest = 1e3 * float(np.median(times)), 1e3 * float(np.max(times))
    print(f"\ncontrol cycle: median {median:.2f} ms, slowest {slowest:.2f} ms of CPU, {len(times)} cycles")
    benchmark.extra_info.update(median_ms=median, slowest_ms=slowest)
