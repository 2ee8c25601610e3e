"""Takes pictures of ring and ball and prints how far the detector's corners and edges are off.

Run with `python -m handover.scenarios.robots.helix.calibrate_detector`. What it prints are the defaults of
`corner_shift` and `edge_shift` of `HandoverVision`; lenses with another blur have others.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from handover.controllers.helix.vision.detector_calibration import DetectorCalibration, calibrate_detector
from handover.controllers.helix.vision.markers import MarkerRing
from handover.controllers.helix.vision.stereo import Pixels
from handover.cosim.blocks.geometry import quaternion_of, rotation_by
from handover.plants.helix.cameras.stereo_camera import Inputs, Params, StereoCamera
from handover.scenarios.robots.helix.cameras import pinholes

_HANGING = np.diag([1.0, -1.0, -1.0])  # R_WR


def calibrated_detector(camera: Params, pairs: int, seed: int) -> DetectorCalibration:
    """Return the shifts that the detector finds in pictures of a camera; it does not learn the poses.

    Args:
        camera: parameters of the camera, with the scenario's poses and lenses.
        pairs: of pictures.
        seed: draws the poses.
    """
    cameras = list(pinholes().values())
    ring = MarkerRing(camera.apothem, camera.marker, camera.rings)
    return calibrate_detector(_taken(StereoCamera(camera), pairs, seed), cameras, ring, camera.ball_radius)


def _taken(camera: StereoCamera, pairs: int, seed: int) -> Iterator[tuple[Pixels, Pixels]]:
    """Yield pictures of the ring, tilted by up to 20 degrees, before the cameras, and of a ball beside it."""
    rng = np.random.default_rng(seed)
    for _ in range(pairs):
        p_WR = rng.uniform([-0.1, -0.1, -0.62], [0.1, 0.1, -0.5])
        R_WR = _HANGING @ rotation_by(rng.uniform(-0.35, 0.35, 3))
        p_WG, q = p_WR + 0.1 * R_WR[:, 2], quaternion_of(R_WR)
        p_WO = np.array([rng.uniform(-0.1, 0.1), rng.choice([-0.2, 0.2]), rng.uniform(-0.7, -0.55)])
        arm = np.linspace([0.0, 0.0, 0.0], p_WR, 25)
        y = camera.step(
            0.0, 1 / 30, Inputs(backbone=arm, p_WR=p_WR, q_WR=q, p_WG=p_WG, q_WG=q, p_WO=p_WO, p_WH=p_WO - [0, 0, 0.04])
        )
        yield y.left, y.right


def main() -> None:
    """Print both shifts."""
    parser = argparse.ArgumentParser(description="How far the detector's corners and edges are off, from pictures.")
    parser.add_argument("--blur", type=float, default=Params().blur, help="standard deviation of the lenses' blur, px")
    parser.add_argument("--marker", type=float, default=Params().marker, help="side of a marker, m")
    parser.add_argument("--pairs", type=int, default=30, help="pairs of pictures")
    parser.add_argument("--seed", type=int, default=0, help="draws the poses")
    given = parser.parse_args()
    print(calibrated_detector(Params(blur=given.blur, marker=given.marker), given.pairs, given.seed))


if __name__ == "__main__":
    main()
