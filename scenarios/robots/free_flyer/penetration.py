"""Bodies that nothing keeps apart: a robot's cube and arm against hands, objects and the other robot.

The units simulate what touches grippers and objects. A hand in the cube of a robot is felt by neither: a start there is
refused, and so is one where the robot would come to it; a run in which it happens has not succeeded.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.plain_rotation import inverse_rotate, rotation_matrix, subtract, vector
from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.starts import LEAST_DEPTH, array_of, penetration_fault
from handover.scenarios.robots.free_flyer.parameters import ROBOTS

_ARM_WIDTH = 0.04
"""Sides of the arm across, as it is drawn, m."""


@dataclass(frozen=True)
class Solid:
    """A box about p in W, m, whose axes are the columns of R, and half its sides; `name` is what messages call it."""

    name: str
    p: Floats
    R: Floats
    half: Floats

    def depth_of_ball(self, p: Floats, radius: float) -> tuple[float, Floats]:
        """Return how deep a ball about p is in it, m, negative if it is not, and the way out, of length 1, in W."""
        seen = vector(np.transpose(self.R) @ (p - self.p))
        box = Box(vector(self.half))
        return radius - box.distance(seen), self.R @ np.array(box.normal(seen))

    def depth_of(self, other: "Solid") -> tuple[float, Floats]:
        """Return how deep another box is in it at least, m, negative if it is not, and the way out for that one.

        By the separating axes of both: their faces' normals, and the products of their edges.
        """
        edges = np.array([np.cross(a, b) for a in np.transpose(self.R) for b in np.transpose(other.R)])
        lengths = np.linalg.norm(edges, axis=1)
        skewed = lengths > 1e-9  # edges that are parallel have no product
        axes = np.vstack([np.transpose(self.R), np.transpose(other.R), edges[skewed] / lengths[skewed, np.newaxis]])
        across = axes @ (other.p - self.p)
        reach = sum(np.abs(axes @ s.R) @ s.half for s in (self, other))
        depths = reach - np.abs(across)
        least = int(np.argmin(depths))
        return float(depths[least]), math.copysign(1.0, across[least]) * axes[least]


def robot_solids(name: str, p_WB: Floats, q_WB: Floats, p_BG: Floats) -> list[Solid]:
    """Return cube and arm of a robot whose centre of mass is at p_WB, and whose gripper at p_BG in its frame, m."""
    R = rotation_of(q_WB)
    edge, palm = _edge(), PersonParams().palm_depth
    near, far = -edge / 2.0, float(p_BG[0]) + palm
    solids = [Solid(f"{name}'s cube", p_WB, R, np.full(3, edge / 2.0))]
    if far < near:
        middle = np.array([(near + far) / 2.0, p_BG[1] / 2.0, p_BG[2] / 2.0])
        half = np.array([(near - far) / 2.0, _ARM_WIDTH / 2.0, _ARM_WIDTH / 2.0])
        solids.append(Solid(f"{name}'s arm", p_WB + R @ middle, R, half))
    return solids


def start_faults(units: Mapping[str, PlacedUnit]) -> list[str]:
    """Return what would start in each other, and hands that rest where a robot will wait, with depth and the way out.

    The units of a handover have the values that they will have; what others in their places do not have is not checked.
    """
    starts: dict[str, list[Solid]] = {}
    waiting: list[Solid] = []
    grippers: dict[str, Floats] = {}
    for robot, p_WG in _waits(units).items():
        unit = units.get(robot)
        if unit is None or not {"p_WB_0", "q_WB_0", "p_BG"} <= unit.description.parameters.keys():
            continue
        p_WB, q_WB, p_BG = (array_of(unit, name) for name in ("p_WB_0", "q_WB_0", "p_BG"))
        starts[robot] = robot_solids(robot, p_WB, q_WB, p_BG)
        waiting += robot_solids(robot, p_WG - p_BG, np.array([1.0, 0.0, 0.0, 0.0]), p_BG)
        grippers[robot] = p_WB + starts[robot][0].R @ p_BG
    faults = [
        penetration_fault(f"{b}.p_WB_0", f"{one.name} would start", other.name, *other.depth_of(one))
        for a, b in combinations(starts, 2)
        for one in starts[b]
        for other in starts[a]
    ]
    person = units.get("person")
    if person is not None:
        at_start = [solid for solids in starts.values() for solid in solids]
        faults += _faults_of_hands(person, at_start, waiting, grippers) + _faults_of_object(person, at_start)
    return [fault for fault in faults if fault]


def _waits(units: Mapping[str, PlacedUnit]) -> dict[str, Floats]:
    """Return where the gripper of each robot waits for the person, in W, m, by the robot's name."""
    decision = units.get("decision")
    if decision is None or "p_WG_handover" not in decision.description.parameters:
        return {}
    p_WG = array_of(decision, "p_WG_handover")
    if "grip_spacing" not in decision.description.parameters:
        return {"robot": p_WG}
    aside = np.array([0.0, 0.5 * float(array_of(decision, "grip_spacing")[0]), 0.0])
    return {f"robot_{r}": p_WG + side * aside for r, side in zip(ROBOTS, (1.0, -1.0), strict=True)}


def _faults_of_hands(
    person: PlacedUnit, starts: Sequence[Solid], waiting: Sequence[Solid], grippers: Mapping[str, Floats]
) -> list[str]:
    has = person.description.parameters
    if not {"p_WH_0", "q_WH_0", "fist_radius", "palm_width"} <= has.keys():
        return []
    middle, radius = array_of(person, "p_WH_0"), float(array_of(person, "fist_radius")[0])
    hands = [middle]
    if "hand_spacing" in has and int(array_of(person, "hands")[0]) > 1:
        aside = rotation_of(array_of(person, "q_WH_0"))[:, 1] * float(array_of(person, "hand_spacing")[0]) / 2.0
        hands = [middle + aside, middle - aside]
    name = f"{person.name}.p_WH_0"
    faults: list[str] = []
    for p in hands:
        inside = [penetration_fault(name, "a hand would start", s.name, *s.depth_of_ball(p, radius)) for s in starts]
        if not any(inside):
            inside = [
                penetration_fault(
                    name, "a hand would rest", f"{s.name} at its handover place", *s.depth_of_ball(p, radius)
                )
                for s in waiting
            ]
        faults += inside
        for robot, p_WG in grippers.items():
            apart = p - p_WG
            length = float(np.linalg.norm(apart))
            depth = radius + float(array_of(person, "palm_width")[0]) - length
            out = apart / length if length > 0.0 else np.array([-1.0, 0.0, 0.0])
            faults.append(penetration_fault(name, "a hand would start", f"{robot}'s gripper", depth, out))
    return faults


def _faults_of_object(person: PlacedUnit, starts: Sequence[Solid]) -> list[str]:
    """Return faults of an object that floats freely at the start."""
    has = person.description.parameters
    if not {"p_WO_0", "q_WO_0", "object_size"} <= has.keys() or not _is_free(person):
        return []
    half = array_of(person, "object_size") / 2.0
    thing = Solid("the object", array_of(person, "p_WO_0"), rotation_of(array_of(person, "q_WO_0")), half)
    return [
        penetration_fault(f"{person.name}.p_WO_0", "the object would start", s.name, *s.depth_of(thing)) for s in starts
    ]


def _is_free(person: PlacedUnit) -> bool:
    return str(person.start.get("object_with", "free")).lower() in ("free", "0")


@dataclass
class HandInCube:
    """How deep the middle of a hand has been in the cube of a robot, and since when, s; None: never.

    A hand that only grazes the cube would be felt, and pass.

    Attributes:
        depth: at most, m.
        since: when it came into one first, s.
    """

    depth: float = 0.0
    since: float | None = None

    def follow(self, t: float, signals: Signals, robot: str, hand: str) -> None:
        """Take in where a hand, an output, is from a robot's cube; a unit without the outputs is left out."""
        names = (f"{robot}.p_WB", f"{robot}.q_WB", hand)
        if not all(name in signals for name in names):
            return
        (x, y, z), q, (h_x, h_y, h_z) = (signals.plain(name) for name in names)
        half = 0.5 * _edge()
        if math.dist((x, y, z), (h_x, h_y, h_z)) > 1.8 * half:
            return
        seen = inverse_rotate(rotation_matrix((q[0], q[1], q[2], q[3])), subtract((h_x, h_y, h_z), (x, y, z)))
        depth = -Box((half, half, half)).distance(seen)
        if depth > max(self.depth, LEAST_DEPTH):
            self.depth, self.since = depth, t if self.since is None else self.since

    @property
    def note(self) -> str:
        """What a verdict adds if a hand was in a cube, which nothing kept out of it; "" if none was."""
        if self.since is None:
            return ""
        deep = f"up to {1e3 * self.depth:.0f} mm inside a robot's cube, from {self.since:.1f} s on"
        return f"; a hand's middle was {deep}, which nothing simulates"

    def metrics(self) -> dict[str, Metric]:
        """Return the depth."""
        text = "middle of a hand inside a robot's cube at most, which nothing simulates"
        return {"hand_in_cube": Metric(self.depth, "m", text)}


@cache
def _edge() -> float:
    return float(paper_values("free_flyer", "scene")["edge"])
