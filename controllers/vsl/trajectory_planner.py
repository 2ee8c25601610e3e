"""Point-to-point trajectories of an arm with three joints. [Gandarias2020] sec. III-C, algorithms 1 and 2."""

import bisect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path as FilePath
from typing import ClassVar

import numpy as np

from handover.controllers.vsl.kinematics import ArmParameters, Elbow, VslKinematics, format_point
from handover.controllers.vsl.paths import Departure, Path, Segment, segments_of
from handover.controllers.vsl.waypoints import InvalidWaypoints, read_waypoints
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, output, parameter, port
from handover.cosim.blocks.schedule import InvalidSchedule, Schedule
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, MetrePerSecond, Pascal, Radian, RadianPerSecond, Second

__all__ = ["Elbow", "Inputs", "InvalidPath", "Outputs", "Params", "Path", "TrajectoryPlanner"]

_MARGIN = 0.001
"""How near to a singularity a path may come, m (assumed): there a joint turns about seven times faster than usual."""

MAX_PRESSURE = 3e5
"""Highest pressure that is commanded, Pa: what the arm takes (assumed)."""

_PERIOD = Fraction(1, 50)  # s
_SAME_TIME = 1e-9  # s; rounding of sums of intervals


class InvalidPath(InvalidParameters):
    """A path that the arm cannot follow; `faults` names the first bad point of each segment."""

    block = "TrajectoryPlanner"


@dataclass(frozen=True, kw_only=True)
class Params(ArmParameters):
    """Path and speed. [Gandarias2020] states neither the arm's lengths nor speeds: they are assumed."""

    path: Path = parameter(
        Path.CURVE,
        "path of the tip: of the paper, or (CUSTOM) a straight line from x_0 to x_g, or by waypoints",
        origin=stated("sec. V-B: the path of experiment 2; sec. V-A has linear, curve and square"),
    )
    waypoints: str = parameter(
        "",
        "CSV file of a CUSTOM path's waypoints in the world, m: columns x, y, z, and via_x, via_y, via_z for arcs; "
        "empty: x_0 and x_g",
        origin=assumed("the paper's paths are given in sec. V-A; this is for one's own"),
    )
    x_0: Vector3[Metre] = parameter(
        np.array([0.3, 0.0, 0.05]),
        "first point of a CUSTOM path in the world, z at least 0",
        origin=assumed("start of a path of one's own; the paper's curve starts there"),
    )
    x_g: Vector3[Metre] = parameter(
        np.array([0.3, 0.0, 0.35]),
        "last point of a CUSTOM path in the world, z at least 0",
        origin=assumed("end of a path of one's own"),
    )
    N: int = parameter(
        100,
        "points of each segment of the path, N",
        minimum=1,
        maximum=10000,
        origin=assumed("N of algorithms 1 and 2 is not given; steps of 1 to 3 mm"),
    )
    V: MetrePerSecond = parameter(
        0.05,
        "speed of the tip along the path, V",
        minimum=1e-4,
        maximum=2.0,
        origin=assumed("V of algorithms 1 and 2 is not given"),
    )
    pressure: Vector2[Pascal] = parameter(
        np.array([5e4, 5e4]), "pressure of links 2 and 3 above the air's", minimum=0.0, maximum=MAX_PRESSURE
    )
    pressure_steps: str = parameter(
        "",
        "pressures, Pa, and from when on, s, in place of pressure: `8:1e5 12:5e4,2e5`, of both links or each; "
        "empty: none",
        origin=assumed("the paper's pressures hold throughout a path"),
    )
    settle: Second = parameter(
        3.0,
        "time at the first point before the path begins, to get there and calm down",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("time for getting to the first point, algorithms 1 and 2: Move(q_k, dq_0)"),
    )
    qd_0: Vector3[RadianPerSecond] = parameter(
        np.array([0.8, 0.8, 0.8]),
        "joint speeds off the path; 0 is the servo's own limit",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("initial joint velocities of algorithms 1 and 2, not given"),
    )


@dataclass(kw_only=True)
class Inputs:
    """When to go."""

    go: bool = port(True, "the path begins, once settled, when this is true; ignored afterwards")


@dataclass(kw_only=True)
class Outputs:
    """Where to go."""

    p_WG_goal: Vector3[Metre] = output("point of the path to move to, in the world")
    q_ref: Vector3[Radian] = output("joint angles that put the tip of a rigid arm there, [Gandarias2020] eqs. (2)-(4)")
    qd_ref: Vector3[RadianPerSecond] = output(
        "joint velocities on the way there, by the inverse Jacobian, [Gandarias2020] eq. (8)"
    )
    p_cmd: Vector2[Pascal] = output("pressure commands of links 2 and 3")
    segment: int = output("segment of the path, from 1; 0 before it begins")
    moving: bool = output("the tip is on its way along the path")
    done: bool = output("the path has ended")


class TrajectoryPlanner:
    """Follows lines and arcs point by point at constant speed. [Gandarias2020] algorithms 1 and 2, corrected.

    The first point x_0 is held for the settling time, then until `go`. Each segment has N steps of equal length and
    time T = length / (N V). During the k-th, the goal is x_{k+1} with q_{k+1} from the inverse kinematics. The joint
    velocities are q'_k = J(q_k)^-1 x'_k, so that the joints come to the goal as the step ends. Between points the goal
    stays. The last point is held. Where T is shorter than the period, points are left out. Joint 1 goes on past half a
    turn instead of all the way back. Pressures are held, too, or change at the times of `pressure_steps`.

    Raises:
        InvalidPath: by the constructor, for values out of range, points out of reach or singular, no length, a file
            that is not a list of waypoints.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("p_WG_goal", "q_ref", "qd_ref", "segment", "moving", "done"), ("go",)
    )
    period: ClassVar[Fraction | None] = _PERIOD

    def __init__(self, params: Params) -> None:
        self._params = p = params
        self._kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
        try:
            segments = segments_by(p.path, p.x_0, p.x_g, p.waypoints)
        except InvalidWaypoints as e:
            raise InvalidPath([f"waypoints: {e}"]) from e
        faults = parameter_faults(p) or _faults(segments, p, self._kinematics)
        try:
            self._pressures = pressures_of(p.pressure_steps)
        except InvalidSchedule as e:
            faults = [*faults, f"pressure_steps: {e.fault}"]
        if faults:
            raise InvalidPath(faults)
        self._points: list[Floats] = []
        self._q: list[Floats] = []
        self._qd: list[Floats] = []
        self._ends: list[float] = []
        """When each step ends, s after the path began; of as many entries as those above."""
        self._x_0, self._q_0 = segments[0].x_0, self._kinematics.inverse(segments[0].x_0)
        for segment in segments:
            self._add(segment)
        self._departure = Departure((p.settle - _SAME_TIME) / float(_PERIOD))

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return the command that a step from here would begin with."""
        return self._command(t, self._departure.periods(go=u.go))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that holds until t + dt."""
        y = self.outputs(t, u)
        self._departure.pass_period(go=u.go)
        return y

    def get_state(self) -> bytes:
        """Return the periods waited, and those since the path began."""
        return pack_state(self._departure.state)

    def set_state(self, state: bytes) -> None:
        """Restore a state of this planner or of one with equal parameters."""
        self._departure.state = unpack_state(state)

    def _command(self, t: float, periods: int | None) -> Outputs:
        p = self._params
        last = len(self._ends) - 1
        k = -1 if periods is None else bisect.bisect_right(self._ends, periods * float(_PERIOD) + _SAME_TIME)
        moving = 0 <= k <= last
        i = min(k, last)
        return Outputs(
            p_WG_goal=np.array(self._x_0 if k < 0 else self._points[i]),
            q_ref=np.array(self._q_0 if k < 0 else self._q[i]),
            qd_ref=np.array(self._qd[i] if moving else p.qd_0),
            p_cmd=self._pressure(t),
            segment=0 if k < 0 else i // p.N + 1,
            moving=moving,
            done=k > last,
        )

    def _pressure(self, t: float) -> Floats:
        scheduled = self._pressures.at(t)
        return np.array(self._params.pressure) if scheduled is None else np.resize(scheduled, 2)

    def _add(self, segment: Segment) -> None:
        p = self._params
        points, velocities = segment.sampled(p.N, p.V)
        before = self._q[-1] if self._q else self._q_0
        q, qd = self._kinematics.joint_path(points, velocities, float(before[0]))
        began = self._ends[-1] if self._ends else 0.0
        self._points += list(points[1:])
        self._q += q[1:]
        self._qd += qd
        self._ends += [began + (k + 1) * segment.length / (p.N * p.V) for k in range(p.N)]


def pressures_of(text: str) -> Schedule:
    """Return the pressures of links 2 and 3, or of both, of the parameter pressure_steps.

    Raises:
        InvalidSchedule: it has another form, or a pressure is out of range.
    """
    return Schedule.parse(text, (1, 2), 0.0, MAX_PRESSURE)


def segments_by(path: Path, x_0: Floats, x_g: Floats, waypoints: str) -> Sequence[Segment]:
    """Return the segments of a path: of a CUSTOM one by the file of waypoints, if one is named, else as `segments_of`.

    Raises:
        InvalidWaypoints: there is no such file, or it is not a list of waypoints.
    """
    return read_waypoints(FilePath(waypoints)) if path is Path.CUSTOM and waypoints else segments_of(path, x_0, x_g)


def _faults(segments: Sequence[Segment], p: Params, kinematics: VslKinematics) -> list[str]:
    faults: list[str] = []
    by_file = p.path is Path.CUSTOM and p.waypoints
    for i, segment in enumerate(segments):
        if segment.length < 1e-6:
            faults.append("x_0 and x_g are the same point: a path has a length")
            continue
        fault = _fault_at_points(segment, p, kinematics) or _fault_between(segment, p, kinematics)
        if fault is not None:
            faults.append(
                f"{f'from waypoint {i + 1} to {i + 2}' if by_file else f'segment {i + 1} of {len(segments)}'}, "
                f"{fault}; a path stays {_MARGIN * 1000:.0f} mm or more off "
                f"joint 1's axis and off both limits of reach: |L_2 - L_3| = {kinematics.reach[0]:.4g} m and "
                f"L_2 + L_3 = {kinematics.reach[1]:.4g} m from the shoulder (0, 0, {p.L_1:.4g}) m"
            )
    return faults


def _fault_at_points(segment: Segment, p: Params, kinematics: VslKinematics) -> str | None:
    """Return which of a segment's points is the first bad one, and why; None if all are good."""
    bad = [(k, x, f) for k, x in enumerate(segment.sampled(p.N, p.V)[0]) if (f := kinematics.fault(x, _MARGIN))]
    if not bad:
        return None
    k, x, fault = bad[0]
    others = f" (and {len(bad) - 1} more of this segment)" if len(bad) > 1 else ""
    return f"point {k} of {p.N}, {format_point(x)}{others}: {fault}"


def _fault_between(segment: Segment, p: Params, kinematics: VslKinematics) -> str | None:
    """Return where a segment whose points are good runs through a singularity between them, and which; or None."""
    longest = (
        2.0 * math.pi * kinematics.reach[1]
    )  # within reach there is no longer arc: one through nearly a line has km
    for x in segment.sampled(math.ceil(min(segment.length, longest) / _MARGIN), p.V)[0]:
        if fault := kinematics.fault(x, _MARGIN):
            return f"between its points, at {format_point(x)}: {fault}"
    return None
