import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import Inputs

FAR = np.array([-15.75, 4.84, -19.09, 1.25, 14.375, 14.375, -2.5, -28.75, -28.75]) * 1e-3


@pytest.mark.parametrize("internal_step", [0.005, 0.01])
def test_simulated_seconds_per_cpu_second(benchmark: BenchmarkFixture, internal_step: float):
    TendonArmFast(Params())  # loads or makes the machine code
    ratios: list[float] = []

    def run() -> None:
        """Bend the arm far forward within a second and sway it there, as in the benchmark of TendonArm."""
        arm = TendonArmFast(Params(internal_step=internal_step))
        start = time.process_time()
        for i in range(200):
            t = i * 0.02
            arm.step(t, 0.02, Inputs(dl_t=FAR * min(1.0, t) * (1.0 + 0.2 * np.sin(3.0 * t))))
        ratios.append(4.0 / (time.process_time() - start))

    benchmark.pedantic(run, rounds=3, iterations=1)
    benchmark.extra_info["simulated_s_per_cpu_s"] = max(ratios)
    print(f"\nTendonArmFast, internal step {internal_step:g} s: {max(ratios):.1f} simulated s per CPU s")
