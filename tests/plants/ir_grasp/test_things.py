"""Objects that are given by parameters or drawn, on the table and in the hand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import (
    AREAL_DENSITY,
    SOLIDS,
    Thing,
    drawn_solid,
    is_held_out,
    placed,
    solid_of,
)
from handover.plants.ir_grasp.parameters import InvalidSceneParameters, Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs, Outputs
from handover.plants.ir_grasp.shapes import Disc, Polygon, Rectangle
from handover.plants.ir_grasp.world import GraspWorld, initial_snapshot

STEP = 0.015
AROUND = Params(p_WH_0=np.array([-0.13, 0.0]), sigma_0=0.1)
AWAY = replace(AROUND, p_WH_0=np.array([-0.45, 0.0]))
L_SHAPE: Floats = np.zeros((8, 2))
L_SHAPE[:6] = 1e-3 * np.array([[-30, -30], [30, -30], [30, -10], [-10, -10], [-10, 30], [-30, 30]])


def course(p: Params, u: Inputs, seconds: float) -> list[Outputs]:
    scene = GraspScene(p)
    return [scene.step(k * STEP, STEP, u) for k in range(round(seconds / STEP))]


def test_a_disc_like_the_cylinder_moves_like_it():
    own = SOLIDS[Thing.CYLINDER]
    disc = replace(AROUND, thing=Thing.DISC, mass_O=own.mass, reflectivity=own.reflectivity)
    u = Inputs(p_WH_cmd=np.array([-0.15, 0.01]), sigma_cmd=0.9)
    a, b = course(AROUND, u, 1.0)[-1], course(disc, u, 1.0)[-1]
    np.testing.assert_array_equal([*a.p_WO, *a.ticks], [*b.p_WO, *b.ticks])


def test_a_bar_like_the_box_moves_like_it_and_so_does_a_polygon_nearly():
    own, x, y = SOLIDS[Thing.PAPER_BOX_A], 0.0375, 0.025
    box = replace(AROUND, thing=Thing.PAPER_BOX_A, mass_O=own.mass, reflectivity=own.reflectivity)
    bar, corners = replace(box, thing=Thing.BAR, bar_size=np.array([2 * x, 2 * y])), np.zeros((8, 2))
    corners[:4] = [(-x, -y), (x, -y), (x, y), (-x, y)]
    polygon = replace(box, thing=Thing.POLYGON, corners=corners, corner_count=4)
    u = Inputs(p_WH_cmd=np.array([-0.15, 0.01]), sigma_cmd=0.9)
    ends = [course(p, u, 1.5)[-1] for p in (box, bar, polygon)]
    np.testing.assert_array_equal(ends[0].p_WO, ends[1].p_WO)
    assert ends[0].touching >= 2
    np.testing.assert_allclose(ends[0].p_WO, ends[2].p_WO, atol=1e-3)


def test_a_second_object_may_stand_in_a_dent():
    inside = replace(AWAY, thing=Thing.POLYGON, corners=L_SHAPE, corner_count=6, other_radius=0.015)
    GraspScene(replace(inside, p_WX_0=np.array([0.008, 0.008])))
    with pytest.raises(InvalidSceneParameters):
        GraspScene(replace(inside, p_WX_0=np.array([-0.02, 0.008])))


def pushed(p: Params, velocity: tuple[float, float]) -> tuple[GraspWorld, Floats]:
    """Let the object slide to rest with a velocity of its centre of mass; return how far that goes, too."""
    sigma, (palm, (x, y, yaw, *_), *rest), _ = initial_snapshot(p)
    world = GraspWorld(p, (sigma, (palm, (x, y, yaw, *velocity, 0.0), *rest), 0))
    for _ in range(400):
        world.advance((-0.45, 0.0, 0.0, 0.1))
    return world, np.array(world.snapshot[1][1][:2]) - (x, y)


def test_the_centre_of_mass_is_where_it_is_given_and_O_stays_where_it_is():
    p = replace(AWAY, thing=Thing.BAR, mass_offset=np.array([0.02, 0.004]), yaw_O_0=0.5, p_WO_0=np.array([0.03, 0.01]))
    world, way = pushed(p, (0.3, 0.4))
    np.testing.assert_allclose(way, 0.5 / (2.0 * 0.3 * 9.81) * np.array([0.3, 0.4]), atol=3e-4)
    assert world.thing[2] == pytest.approx(0.5, abs=1e-12)  # friction acts in the centre of mass: no turn
    np.testing.assert_allclose(world.thing[:2], np.array([0.03, 0.01]) + way, atol=1e-12)
    first = GraspScene(p).outputs(0.0, Inputs())
    np.testing.assert_allclose(first.p_WO, p.p_WO_0, atol=1e-15)


def test_a_push_beside_the_centre_of_mass_turns():
    p = replace(AWAY, thing=Thing.BAR, bar_size=np.array([0.03, 0.11]), other_radius=0.02, other_mass=2.0)
    p = replace(p, p_WX_0=np.array([-0.04, 0.0]))

    def turned(offset: float) -> float:
        q = replace(p, mass_offset=np.array([0.0, offset]))
        sigma, (palm, thing, (x, y, *_), *rest), _ = initial_snapshot(q)
        world = GraspWorld(q, (sigma, (palm, thing, (x, y, 0.0, 0.4, 0.0, 0.0), *rest), 0))
        for _ in range(200):
            world.advance((-0.45, 0.0, 0.0, 0.1))
        return world.thing[2]

    assert abs(turned(0.0)) < 1e-6
    assert turned(0.03) > 0.05
    assert turned(-0.03) < -0.05


def test_mass_follows_from_the_area_unless_given():
    assert solid_of(Thing.DISC, disc_radius=0.02).mass == pytest.approx(AREAL_DENSITY * math.pi * 4e-4)
    assert Params(thing=Thing.BAR).solid.mass == pytest.approx(AREAL_DENSITY * 0.11 * 0.03)
    assert Params(thing=Thing.BAR, mass_O=0.7).solid.mass == 0.7
    l_shaped = Params(thing=Thing.POLYGON, corners=L_SHAPE, corner_count=6)
    assert l_shaped.solid.mass == pytest.approx(AREAL_DENSITY * 0.002)


def test_the_family_is_in_its_ranges_and_half_of_it_is_held_out():
    solids = [drawn_solid(seed) for seed in range(200)]
    kinds = [type(s.parts[0]) for s in solids]
    assert all(kinds.count(kind) > 45 for kind in (Disc, Rectangle, Polygon))
    for s in solids:
        assert 0.05 <= s.mass <= 0.3
        assert 0.3 <= s.reflectivity <= 1.5
        assert all(0.7 <= factor <= 1.3 for factor in s.faces)
        assert s.reach < 0.061
        assert np.all(np.abs(s.mass_offset) <= 0.005)
    assert drawn_solid(7) == drawn_solid(7) != drawn_solid(8)
    assert [is_held_out(seed) for seed in range(4)] == [False, True, False, True]
    y = GraspScene(replace(AWAY, thing=Thing.DRAWN, thing_seed=5)).outputs(0.0, Inputs())
    assert y.yaw_O == pytest.approx(drawn_solid(5).yaw)
    (outline,) = placed(drawn_solid(5), y.p_WO, y.yaw_O)
    assert np.max(np.abs(outline)) < 0.06


REFUSED: dict[str, dict[str, Any]] = {
    "crossing edges": {"thing": Thing.POLYGON, "corners": L_SHAPE[[0, 2, 1, 3, 4, 5, 6, 7]], "corner_count": 6},
    "too many corners": {"thing": Thing.POLYGON, "corners": L_SHAPE, "corner_count": 7},
    "disc": {"thing": Thing.DISC, "disc_radius": 0.001},
    "thing": {"thing": 9},
    "negative thing": {"thing": -1},
    "mass outside": {"thing": Thing.BAR, "mass_offset": np.array([0.0, 0.02])},
    "beyond the table": {"p_WO_0": np.array([0.0, 0.43])},
    "second beyond": {"other_radius": 0.03, "p_WX_0": np.array([0.0, 0.44])},
    "second in the object": {"other_radius": 0.03, "p_WX_0": np.array([0.05, 0.0])},
    "second in the palm": {"other_radius": 0.03, "p_WX_0": np.array([-0.11, 0.0])},
    "carried beyond": {"carry_velocity": np.array([0.0, 0.03]), "carry_until": 20.0},
    "hand in the object": {"p_WH_0": np.array([-0.07, 0.0])},
}


@pytest.mark.parametrize("changes", REFUSED.values(), ids=list(REFUSED))
def test_a_scene_that_cannot_be_is_refused_with_the_reason(changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidSceneParameters) as refused:
        GraspScene(replace(AROUND, **changes))
    wording.check(refused.value)
