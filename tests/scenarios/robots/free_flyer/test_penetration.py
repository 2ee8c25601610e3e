"""Starts in which hands, objects and robots are in each other are refused, with depth and the way out."""

import math
import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.robots.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.robots.free_flyer.penetration import Solid, robot_solids, start_faults
from handover.scenarios.robots.free_flyer.two_robots.two_robots import TwoRobots
from handover.scenarios.runs.execution.unit_values import built_system


@cache
def wired(scenario: type[Experiment[Any]]) -> System:
    fmus = {name: cached(unit, 3) for name, unit in scenario.units.items()}
    return built_system(scenario(), scenario.parameters_type(), 0, fmus, {})  # which refuses a start that is not free


def faults(scenario: type[Experiment[Any]], name: str, place: Floats) -> tuple[str, ...]:
    """Return what a scenario says to a place that a unit's parameter, `unit.name`, gives."""
    units = wired(scenario).units
    unit, _, parameter = name.partition(".")
    return tuple(start_faults({**units, unit: replace(units[unit], start={**units[unit].start, parameter: place})}))


@pytest.mark.parametrize(
    ("scenario", "name", "place", "where"),
    [
        (RobotToHuman, "person.p_WH_0", (0.35, -0.07, 0.08), "robot's cube at its handover place"),
        (RobotToHuman, "person.p_WH_0", (0.45, -0.64, 0.05), "robot's cube"),
        (RobotToHuman, "person.p_WH_0", (0.15, -0.64, 0.06), "robot's gripper"),
        (RobotToHuman, "person.p_WO_0", (0.45, -0.57, 0.0), "robot's cube"),
        (RobotToHuman, "person.p_WO_0", (0.25, -0.64, 0.0), "robot's arm"),
        (TwoRobots, "person.p_WH_0", (0.98, -0.25, 0.0), "robot_1's cube"),
        (TwoRobots, "person.p_WO_0", (0.8, -0.5, 0.0), "robot_1's cube"),
        (TwoRobots, "robot_2.p_WB_0", (0.98, -0.7, 0.1), "robot_1's cube"),
    ],
)
def test_a_start_in_another_body_is_refused_with_the_way_out(
    scenario: type[Experiment[Any]], name: str, place: tuple[float, ...], where: str
):
    p, found = np.array(place), ()
    for _ in range(4):  # out of one body may be into the next
        found = faults(scenario, name, p)
        if not found:
            break
        assert all(fault.startswith(f"{name}: ") for fault in found)
        assert p.tolist() != list(place) or any(f"inside {where}" in fault for fault in found)
        way = re.search(r"move it by \((.*)\) m", found[0])
        assert way is not None
        p = p + np.array([float(x) for x in way[1].split(",")])
    assert not found


def test_an_arm_reaches_from_the_face_of_its_cube_to_the_palm():
    cube, arm = robot_solids("robot", np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array([-0.6, 0.0, 0.0]))
    assert arm.p[0] + arm.half[0] == pytest.approx(-cube.half[0])
    assert arm.p[0] - arm.half[0] == pytest.approx(-0.6 + PersonParams().palm_depth)


def test_the_depth_of_boxes_is_that_by_which_one_must_move():
    R = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    cube = Solid("cube", np.zeros(3), np.eye(3), np.full(3, 0.5))
    turned = Solid("other", np.array([1.1, 0.1, 0.2]), R, np.full(3, 0.5))
    depth, way = cube.depth_of(turned)
    assert depth == pytest.approx(0.5 + math.sqrt(0.5) - 1.1)
    np.testing.assert_allclose(way, [1.0, 0.0, 0.0], atol=1e-12)
    moved = Solid("other", turned.p + 1.001 * depth * way, R, turned.half)
    assert cube.depth_of(moved)[0] < 0.0
