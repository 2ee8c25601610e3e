"""What the cameras see of the Helix, for tests of its vision: poses of the arm's end, and a ball on a hand."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from handover.controllers.helix.vision.handover_vision import HandoverVision, Inputs, Outputs
from handover.cosim.blocks.geometry import quaternion_of
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.stereo_camera import Inputs as Scene
from handover.plants.helix.cameras.stereo_camera import StereoCamera

R_WB = np.diag([1.0, -1.0, -1.0])
PLACES = {"front": 0.0, "front-left": 45.0, "left": 90.0, "back-left": 135.0}  # deg from +x to +y
AWAY = np.array([0.3, 1.5, -1.2])


def scene(p_WR: Floats, tilt: float, azimuth: float, p_WO: Floats, grip: float = 0.0) -> Scene:
    """An arm whose end leans by tilt towards azimuth, and a ball on a hand."""
    turn = Rotation.from_rotvec(tilt * np.array([np.sin(azimuth), -np.cos(azimuth), 0.0]))
    R_WR = turn.as_matrix() @ R_WB
    z_R, length, s = R_WR[:, 2], 1.1 * float(np.linalg.norm(p_WR)), np.linspace(0.0, 1.0, 25)[:, None]
    mount, wrist = (s**3 - 2 * s**2 + s) * np.array([0.0, 0.0, -1.0]), (s**3 - s**2) * z_R  # Hermite
    backbone = length * (mount + wrist) + (3 * s**2 - 2 * s**3) * p_WR
    q = quaternion_of(R_WR)
    p_WH = p_WO + np.array([0.0, 0.0, -0.04])
    return Scene(
        backbone=backbone, p_WR=p_WR, q_WR=q, p_WG=p_WR + 0.1 * z_R, q_WG=q, grip=grip, p_WO=p_WO, p_WH=p_WH
    )  # fmt: skip


def hanging(place: str) -> Scene:
    angle = np.radians(PLACES[place])
    p_WO = np.array([0.18 * np.cos(angle), 0.18 * np.sin(angle), -0.6])
    return scene(np.array([0.0, 0.0, -0.6]), 0.0, 0.0, p_WO)


def reaching(place: str, grip: float) -> Scene:
    angle = np.radians(PLACES[place])
    p_WO = np.array([0.18 * np.cos(angle), 0.18 * np.sin(angle), -0.62])
    tilt = math.radians(25.0)
    z_R = np.array([np.sin(tilt) * np.cos(angle), np.sin(tilt) * np.sin(angle), -np.cos(tilt)])
    return scene(p_WO - 0.1 * z_R, tilt, angle, p_WO, grip)


def anywhere(rng: np.random.Generator) -> Scene:
    r, a, b = rng.uniform(0.0, 0.15), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi)
    p_WR = np.array([r * np.cos(a), r * np.sin(a), rng.uniform(-0.62, -0.5)])
    angle = np.radians(rng.choice(list(PLACES.values()))) + rng.uniform(-0.2, 0.2)
    reach = rng.uniform(0.14, 0.22)
    p_WO = np.array([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-0.7, -0.55)])
    return scene(p_WR, float(rng.uniform(0.0, 0.7)), b, p_WO, rng.uniform())


def over_ball(rng: np.random.Generator, within: float = 0.02) -> Scene:
    """The gripper around the ball, which its fingers hide in part: any closure, G within a distance of O, in m."""
    angle = np.radians(rng.choice(list(PLACES.values()))) + rng.uniform(-0.2, 0.2)
    reach, tilt, azimuth = rng.uniform(0.1, 0.22), rng.uniform(0.0, 0.7), angle + rng.uniform(-0.6, 0.6)
    p_WO = np.array([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-0.68, -0.56)])
    z_R = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), -np.cos(tilt)])
    off = rng.normal(size=3)
    p_WG = p_WO + rng.uniform(0.0, within) * off / np.linalg.norm(off)
    return scene(p_WG - 0.1 * z_R, tilt, float(azimuth), p_WO, rng.uniform())


def rising(rng: np.random.Generator, steps: int) -> Iterator[Scene]:
    """The arm's end on its way from where it hangs to a pose high up, tilted by 45 to 140 degrees."""
    azimuth, reach = rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 0.35)
    height, tilt = rng.uniform(-0.42, -0.25), rng.uniform(0.8, 2.4)
    for s in np.linspace(0.0, 1.0, steps):
        s = s * s * (3.0 - 2.0 * s)
        p_WR = np.array([s * reach * np.cos(azimuth), s * reach * np.sin(azimuth), -0.6 + s * (height + 0.6)])
        yield scene(p_WR, s * tilt, azimuth, np.array([0.2, 0.0, -0.7]))


def look(camera: StereoCamera, vision: HandoverVision, u: Scene, t: float = 0.0) -> Outputs:
    y = camera.step(t, 1 / 30, u)
    return vision.step(t, 1 / 30, Inputs(left=y.left, right=y.right, third=y.third))


def distances(y: Outputs, u: Scene) -> Floats:
    """Errors of ball, wrist and gripper, in m."""
    pairs = [(y.p_WO_meas, u.p_WO), (y.p_WR_meas, u.p_WR), (y.p_WG_meas, u.p_WG)]
    return np.array([float(np.linalg.norm(a - b)) for a, b in pairs])


def squared(y: Outputs, u: Scene) -> Floats:
    """Squares of the errors of ball, wrist and gripper, by their covariances."""
    pairs = [(y.p_WO_meas - u.p_WO, y.cov_O), (y.p_WR_meas - u.p_WR, y.cov_R), (y.p_WG_meas - u.p_WG, y.cov_G)]
    return np.array([float(e @ np.linalg.solve(cov, e)) for e, cov in pairs])
