import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.plants.helix.arm.tendon_arm import Inputs, TendonArm
from handover.plants.helix.arm.tendon_parameters import Params

FAR = np.array([-15.75, 4.84, -19.09, 1.25, 14.375, 14.375, -2.5, -28.75, -28.75]) * 1e-3


def swept(arm: TendonArm, seconds: float) -> None:
    """Bend the arm far forward within a second and sway it there, in steps of 20 ms."""
    for i in range(round(seconds / 0.02)):
        t = i * 0.02
        arm.step(t, 0.02, Inputs(dl_t=FAR * min(1.0, t) * (1.0 + 0.2 * np.sin(3.0 * t))))


@pytest.mark.parametrize("discs", [(2, 4, 4), (3, 6, 6), (4, 8, 8), (8, 16, 16)])
def test_simulated_seconds_per_cpu_second(benchmark: BenchmarkFixture, discs: tuple[int, int, int]):
    ratios: list[float] = []

    def run() -> None:
        arm = TendonArm(Params(discs_1=discs[0], discs_2=discs[1], discs_3=discs[2]))
        start = time.process_time()
        swept(arm, 4.0)
        ratios.append(4.0 / (time.process_time() - start))

    benchmark.pedantic(run, rounds=3, iterations=1)
    benchmark.extra_info["simulated_s_per_cpu_s"] = max(ratios)
    print(f"\nTendonArm {discs}: {max(ratios):.2f} simulated s per CPU s")


def test_construction(benchmark: BenchmarkFixture):
    cpu: list[float] = []

    def run() -> None:
        start = time.process_time()
        TendonArm(Params())
        cpu.append(time.process_time() - start)

    benchmark.pedantic(run, rounds=20, iterations=1)
    benchmark.extra_info["cpu_s"] = min(cpu)
    print(f"\nTendonArm: built in {min(cpu) * 1e3:.1f} ms of CPU")
