"""The bowl: what comes in through its rim, how a ball rolls to rest in it, and what cameras see of it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.partner_runs import take

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.stereo_camera import Inputs as Seen
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.cameras.stereo_camera import StereoCamera
from handover.plants.helix.hand.bowl import Bowl
from handover.plants.helix.hand.handover_partner import HandoverPartner
from handover.plants.helix.hand.partner_parameters import Holder, Inputs, Outputs, Params

P_WD = np.array([0.0, -0.16, -0.74])
BOWL = Bowl(P_WD, radius=0.08, depth=0.06, ball_radius=0.025)
DOWN = np.array([0.0, 1.0, 0.0, 0.0])


def dropped(beside: float, v: float = 0.0, dt: float = 0.02, **changes: Any) -> list[Outputs]:
    """Return what a ball does that a gripper, moving at v, takes 0.1 m over the rim and lets go."""
    p_WG = P_WD + np.array([beside, 0.0, 0.1])
    at_rest: Any = {"p_WO_0": p_WG, "p_WD": P_WD, "bowl_radius": 0.08, "tremor_rms": 0.0, "drift_rms": 0.0}
    partner = HandoverPartner(replace(Params(), **(at_rest | changes)))
    step = v * dt * np.array([1.0, 0.0, 0.0])
    take(partner, p_WG, dt=dt)
    carried = round(0.5 / dt)
    for i in range(-carried, 1):
        partner.step(4.0 + i * dt, dt, Inputs(p_WG=p_WG + i * step, q_WG=DOWN, grip=1.0))
    return [partner.step(4.0 + i * dt, dt, Inputs(p_WG=p_WG + i * step, q_WG=DOWN, grip=0.0)) for i in range(1, 150)]


@pytest.mark.parametrize("beside", [0.0, -0.075])
def test_a_ball_over_the_bowl_comes_to_rest_on_its_lowest_point(beside: float):
    ys = dropped(beside)
    assert ys[-1].holder is Holder.FREE
    lowest = P_WD - np.array([0.0, 0.0, BOWL.depth - BOWL.ball_radius])
    np.testing.assert_allclose(ys[-1].p_WO, lowest, atol=0.003)
    inside = [y.p_WO for y in ys if y.p_WO[2] < P_WD[2]]
    assert len(inside) > 20
    assert np.linalg.norm(inside - BOWL.p_WS, axis=1).max() <= BOWL.sphere_radius - BOWL.ball_radius + 1e-12


@pytest.mark.parametrize(("beside", "v", "radius"), [(0.085, 0.0, 0.08), (0.05, 0.4, 0.08), (0.0, 0.0, 0.0)])
def test_a_ball_past_the_rim_or_without_a_bowl_falls_to_the_floor(beside: float, v: float, radius: float):
    assert dropped(beside, v, bowl_radius=radius)[-1].p_WO[2] == Params().floor


def test_nothing_comes_in_from_below_or_past_the_rim():
    over, under = P_WD + np.array([0.0, 0.0, 0.01]), P_WD - np.array([0.0, 0.0, 0.01])
    assert BOWL.catches(over, under)
    assert not BOWL.catches(under, over)
    aside: Floats = np.array([0.081, 0.0, 0.0])
    assert not BOWL.catches(over + aside, under + aside)


def test_a_fall_crosses_the_rim_s_plane_on_the_line_between_two_places():
    before, after = P_WD + np.array([0.1, 0.0, 0.01]), P_WD + np.array([0.14, 0.0, -0.03])
    crossing = BOWL.crossing(before, after)
    assert crossing is not None
    np.testing.assert_allclose(crossing, P_WD + np.array([0.11, 0.0, 0.0]), atol=1e-15)
    assert BOWL.crossing(after, before) is None
    assert BOWL.crossing(after, after - 0.1) is None


def test_the_rim_lies_on_the_inner_surface():
    profile = BOWL.profile(9)
    np.testing.assert_allclose(profile[[0, -1]], [[0.0, P_WD[2] - BOWL.depth], [BOWL.radius, P_WD[2]]], atol=1e-12)


@pytest.mark.slow
def test_the_cameras_see_the_bowl_and_what_lies_in_it_behind_its_wall():
    def picture(bowl_radius: float, p_WO: Floats) -> Any:
        camera = StereoCamera(CameraParams(p_WD=P_WD, bowl_radius=bowl_radius, noise=0.0))
        return np.asarray(camera.outputs(0.0, Seen(p_WO=p_WO)).left).reshape(720, 1280, 3).astype(np.int64)

    def green(pixels: Any) -> int:
        blue, middle, red = (pixels[..., k] for k in range(3))
        return int(np.sum((middle > blue + 40) & (middle > red + 40)))

    inside, aside = P_WD - np.array([0.0, 0.0, 0.035]), np.array([0.18, 0.0, -0.62])
    assert np.any(picture(0.0, aside) != picture(0.08, aside))
    assert green(picture(0.08, inside)) < 0.4 * green(picture(0.0, inside))
