"""CPU time of a picture pair, of finding ball and wrist in it, and the errors made.

Run with `pytest tests/benchmarks/test_vision_speed.py --benchmark-enable -s`.
"""

import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.spatial.transform import Rotation

from handover.controllers.helix.handover_vision import HandoverVision, Outputs, Params
from handover.controllers.helix.handover_vision import Inputs as Pictures
from handover.cosim.blocks.geometry import quaternion_of
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.stereo_camera import Inputs, StereoCamera
from handover.plants.helix.stereo_camera import Params as CameraParams

R_WB = np.diag([1.0, -1.0, -1.0])
NAMES = ("ball", "wrist", "gripper")


def pose(rng: np.random.Generator) -> Inputs:
    """An arm leaning by up to 40 degrees, and a ball offered at one of the four places."""
    r, a, b = rng.uniform(0.0, 0.15), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi)
    p_WR = np.array([r * np.cos(a), r * np.sin(a), rng.uniform(-0.62, -0.5)])
    tilt = rng.uniform(0.0, 0.7) * np.array([np.sin(b), -np.cos(b), 0.0])
    R_WR = Rotation.from_rotvec(tilt).as_matrix() @ R_WB
    angle = np.radians(rng.choice([0.0, 45.0, 90.0, 135.0])) + rng.uniform(-0.2, 0.2)
    reach = rng.uniform(0.14, 0.22)
    p_WO = np.array([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-0.7, -0.55)])
    q, p_WG = quaternion_of(R_WR), p_WR + 0.1 * R_WR[:, 2]
    s, down, length = np.linspace(0.0, 1.0, 25)[:, None], np.array([0.0, 0.0, -1.0]), 1.1 * float(np.linalg.norm(p_WR))
    bends = length * ((s**3 - 2 * s**2 + s) * down + (s**3 - s**2) * R_WR[:, 2])
    backbone = bends + (3 * s**2 - 2 * s**3) * p_WR
    palm = p_WO + np.array([0.0, 0.0, -0.04])
    return Inputs(
        backbone=backbone, p_WR=p_WR, q_WR=q, p_WG=p_WG, q_WG=q, grip=rng.uniform(), p_WO=p_WO, p_WH=palm
    )  # fmt: skip


def timed(times: list[float], vision: HandoverVision, pictures: Pictures) -> Outputs:
    begin = time.process_time()
    y = vision.step(0.0, 1 / 30, pictures)
    times.append(1e3 * (time.process_time() - begin))
    return y


def test_picture_pair(benchmark: BenchmarkFixture):
    camera, rng = StereoCamera(CameraParams()), np.random.default_rng(5)
    scenes = [pose(rng) for _ in range(20)]

    def pairs() -> None:
        for u in scenes:
            camera.step(0.0, 1 / 30, u)

    times: list[float] = []

    def timed_pairs() -> None:
        begin = time.process_time()
        pairs()
        times.append(1e3 * (time.process_time() - begin) / len(scenes))

    benchmark.pedantic(timed_pairs, rounds=5, warmup_rounds=1)
    print(f"\npicture pair: median {np.median(times):.1f} ms, least {min(times):.1f} ms of CPU")
    benchmark.extra_info.update(median_ms=float(np.median(times)))


@pytest.mark.slow
@pytest.mark.parametrize("eyes", ["both", "left"])
def test_detection(benchmark: BenchmarkFixture, eyes: str):
    params = CameraParams(cover_right_until=0.0 if eyes == "both" else 1e9)
    camera, rng = StereoCamera(params), np.random.default_rng(5)
    tracking: list[float] = []
    searching: list[float] = []
    errors: list[list[Floats]] = [[], [], []]
    squares: list[list[float]] = [[], [], []]

    def poses() -> None:
        for _ in range(100):
            u, vision = pose(rng), HandoverVision(Params())
            y = camera.step(0.0, 1 / 30, u)
            pictures = Pictures(left=y.left, right=y.right)
            timed(searching, vision, pictures)
            x = timed(tracking, vision, pictures)
            found = [
                (x.seen_O, x.p_WO_meas - u.p_WO, x.cov_O),
                (x.seen_R, x.p_WR_meas - u.p_WR, x.cov_R),
                (x.seen_R, x.p_WG_meas - u.p_WG, x.cov_G),
            ]
            for i, (seen, e, cov) in enumerate(found):
                if seen:
                    errors[i].append(e)
                    squares[i].append(float(e @ np.linalg.solve(cov, e)))

    benchmark.pedantic(poses, rounds=1)
    print(f"\n{eyes}: tracking {np.median(tracking):.1f} ms, search {np.median(searching):.1f} ms of CPU (medians)")
    print(f"{'':8} {'seen':>5} {'RMS':>6} {'median':>6} {'95 %':>6} {'most':>6} mm  e^T C^-1 e")
    for name, e, square in zip(NAMES, errors, squares, strict=True):
        d = np.asarray(1e3 * np.linalg.norm(np.array(e), axis=1), dtype=np.float64)
        rms, shares = np.sqrt(np.mean(d * d)), np.percentile(d, [50, 95, 100])
        print(f"{name:8} {len(e):5} {rms:6.2f} {' '.join(f'{x:6.2f}' for x in shares)}     {np.mean(square):6.1f}")
        benchmark.extra_info[f"{name}_rms_mm"] = float(rms)
        assert len(e) > 80
