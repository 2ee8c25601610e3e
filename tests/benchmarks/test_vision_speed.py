"""CPU time of finding ball and wrist in a pair of pictures, and the errors made.

Run with `pytest tests/benchmarks/test_vision_speed.py --benchmark-enable -s -m "slow or not slow"`.
"""

import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.controllers.vision_scenes import anywhere

from handover.controllers.helix.vision.handover_vision import Detector, HandoverVision, Outputs, Params
from handover.controllers.helix.vision.handover_vision import Inputs as Pictures
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.stereo_camera import Inputs, StereoCamera
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams

NAMES = ("ball", "wrist", "gripper")


def timed(times: list[float], vision: HandoverVision, pictures: Pictures) -> Outputs:
    begin = time.process_time()
    y = vision.step(0.0, 1 / 30, pictures)
    times.append(1e3 * (time.process_time() - begin))
    return y


@pytest.mark.parametrize("eyes", ["both", "left"])
@pytest.mark.parametrize("detector", Detector, ids=lambda d: d.name.lower())
def test_detection(benchmark: BenchmarkFixture, detector: Detector, eyes: str):
    """Poses in the workspace, each seen twice: the first time, everything is searched for."""
    covered = 0.0 if eyes == "both" else 1e9
    camera, rng = StereoCamera(CameraParams(cover_right_until=covered)), np.random.default_rng(5)
    tracking: list[float] = []
    searching: list[float] = []
    found = Found()

    def poses() -> None:
        for _ in range(100):
            u, vision = anywhere(rng), HandoverVision(Params(detector=detector))
            y = camera.step(0.0, 1 / 30, u)
            pictures = Pictures(left=y.left, right=y.right)
            timed(searching, vision, pictures)
            found.add(timed(tracking, vision, pictures), u)

    benchmark.pedantic(poses, rounds=1)
    print(f"\n{detector.name.lower()}, {eyes}: median CPU {np.median(tracking):.1f} ms of a pair whose predecessor was "
          f"seen, {np.median(searching):.1f} ms of a first one")  # fmt: skip
    benchmark.extra_info.update(found.reported())
    assert len(found.errors["wrist"]) > 80
    assert len(found.errors["ball"]) > 80 or (detector, eyes) == (Detector.PUBLISHED, "left")


class Found:
    """Errors of what was seen, and how large they are by the covariances."""

    def __init__(self) -> None:
        self.errors: dict[str, list[Floats]] = {name: [] for name in NAMES}
        self.squares: dict[str, list[float]] = {name: [] for name in NAMES}
        self.looks = 0

    def add(self, x: Outputs, u: Inputs) -> None:
        self.looks += 1
        seen = {
            "ball": (x.seen_O, x.p_WO_meas - u.p_WO, x.cov_O),
            "wrist": (x.seen_R, x.p_WR_meas - u.p_WR, x.cov_R),
            "gripper": (x.seen_R, x.p_WG_meas - u.p_WG, x.cov_G),
        }
        for name, (is_seen, e, cov) in seen.items():
            if is_seen:
                self.errors[name].append(e)
                self.squares[name].append(float(e @ np.linalg.solve(cov, e)))

    def reported(self) -> dict[str, float]:
        """Print a table; return the RMS errors in mm."""
        print(f"{'':8} {'seen':>9} {'RMS':>7} {'median':>7} {'95 %':>7} {'most':>7} mm  e^T C^-1 e")
        rms: dict[str, float] = {}
        for name, e in self.errors.items():
            if not e:
                print(f"{name:8} {0:4}/{self.looks:4}")
                continue
            d = np.asarray(1e3 * np.linalg.norm(np.array(e), axis=1), dtype=np.float64)
            rms[f"{name}_rms_mm"] = float(np.sqrt(np.mean(d * d)))
            shares = " ".join(f"{x:7.2f}" for x in (rms[f"{name}_rms_mm"], *np.percentile(d, [50, 95, 100])))
            print(f"{name:8} {len(e):4}/{self.looks:4} {shares}     {np.mean(self.squares[name]):6.1f}")
        return rms
