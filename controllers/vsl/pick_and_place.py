"""Picks an object up and puts it down elsewhere: soft near contacts, stiff while carrying. After [Gandarias2020]."""

import bisect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.controllers.vsl.kinematics import ArmParameters, VslKinematics, format_point
from handover.controllers.vsl.paths import Departure, Line
from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, MetrePerSecond, Pascal, Radian, RadianPerSecond, Second

_PERIOD = Fraction(1, 50)  # s
_MARGIN = 0.001
"""How near to a singularity a path may come, m (assumed)."""


class InvalidTask(InvalidParameters):
    """Places that the arm cannot reach, or values out of range; `faults` lists all of them."""

    block = "PickAndPlace"


class TaskPhase:
    """Parts of the task, in their order; their numbers are the output `phase`."""

    SETTLE, DESCEND, GRASP, LIFT, CARRY, SOFTEN, LOWER, RELEASE, LEAVE, DONE = range(10)


PHASES = ("settle", "descend", "grasp", "lift", "carry", "soften", "lower", "release", "leave", "done")
"""Their names."""


@dataclass(frozen=True, kw_only=True)
class Params(ArmParameters):
    """The task, speeds and pressures. [Gandarias2020] has no such experiment: all are assumed."""

    p_WP: Vector3[Metre] = parameter(
        np.array([0.30, 0.0, 0.06]),
        "where the tip picks the object up, at its top, in the world",
        minimum=-10.0,
        maximum=10.0,
        origin=assumed(
            "where the curve of sec. V-A begins, on an object of some centimetres; no such experiment is published"
        ),
    )
    p_WQ: Vector3[Metre] = parameter(
        np.array([0.36, 0.0, 0.06]),
        "where the tip puts it down, in the world; as high as it stood",
        minimum=-10.0,
        maximum=10.0,
        origin=assumed("farther out, where the arm sags more"),
    )
    hover: Metre = parameter(
        0.08,
        "how far above both it travels",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("clear of the object by more than what the arm sags, and swings, as it turns soft"),
    )
    press: Metre = parameter(
        0.008,
        "how far below both it is commanded, to touch for certain",
        minimum=0.0,
        maximum=0.1,
        origin=assumed("more than the error of the corrected tip, so that it touches for certain"),
    )
    V: MetrePerSecond = parameter(
        0.1,
        "speed of the tip while it lifts and carries",
        minimum=1e-3,
        maximum=2.0,
        origin=assumed("twice that of the paths"),
    )
    V_contact: MetrePerSecond = parameter(
        0.03,
        "speed of the tip while it comes down",
        minimum=1e-3,
        maximum=2.0,
        origin=assumed("slow; speeds are not given"),
    )
    p_contact: Pascal = parameter(
        5e4,
        "pressure of both links near contacts: 5e4 Pa is 0.5 bar",
        minimum=0.0,
        maximum=3e5,
        origin=assumed("0.5 bar, the softest of sec. V-C"),
    )
    p_carry: Pascal = parameter(
        2e5,
        "pressure of both links while it lifts and carries",
        minimum=0.0,
        maximum=3e5,
        origin=assumed("2 bar, the stiffest of sec. V-C"),
    )
    settle: Second = parameter(
        4.0,
        "time above the object before it comes down",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("as for the paths, a second less: the arm starts nearby"),
    )
    wait: Second = parameter(
        1.5,
        "time for pressures and the cup to follow",
        minimum=0.0,
        maximum=600.0,
        origin=assumed("six times the regulator's time constant"),
    )
    qd_0: Vector3[RadianPerSecond] = parameter(
        np.full(3, 0.8),
        "joint speeds off the path",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("initial joint velocities of algorithms 1 and 2, not given"),
    )


@dataclass(kw_only=True)
class Inputs:
    """When to go."""

    go: bool = port(True, "the arm comes down, once settled, when this is true; ignored afterwards")


@dataclass(kw_only=True)
class Outputs:
    """Where to go, how stiff, and whether to suck."""

    p_WG_goal: Vector3[Metre] = output("point to move to, in the world")
    q_ref: Vector3[Radian] = output("joint angles that put the tip of a rigid arm there, [Gandarias2020] eqs. (2)-(4)")
    qd_ref: Vector3[RadianPerSecond] = output("joint velocities on the way there, by the inverse Jacobian, eq. (8)")
    p_cmd: Vector2[Pascal] = output("pressure commands of links 2 and 3")
    vacuum: bool = output("the cup is to suck")
    phase: int = output(
        "part of the task, from 0: settle, descend, grasp, lift, carry, soften, lower, release, leave, done"
    )
    done: bool = output("the task has ended")


@dataclass(frozen=True)
class _Part:
    """A line from p_0 to p_1, both (3,), m, at a speed, m/s, or a rest of some seconds at p_1; pressure, Pa; vacuum.

    A rest takes a period at least.
    """

    p_0: Floats
    p_1: Floats
    speed: float
    pressure: float
    vacuum: bool
    rest: float | None = None


class PickAndPlace:
    """Comes down on an object, lifts it, carries it, lets it down, and leaves; straight lines at constant speed.

    Settled above the object with the pressure for contacts, it comes down at V_contact to `press` below the object's
    top, sucks and waits there. With the pressure for carrying it lifts, and carries at V to above the other place.
    There it waits until the links are soft again, comes down like before, stops sucking, waits, and leaves. A line has
    as many points as periods: joints arrive at each as the period ends.

    Raises:
        InvalidTask: by the constructor, for values out of range, and places out of reach or nearly so.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("p_WG_goal", "q_ref", "qd_ref", "p_cmd", "vacuum", "phase", "done"), ("go",)
    )
    period: ClassVar[Fraction | None] = _PERIOD

    def __init__(self, params: Params) -> None:
        if faults := parameter_faults(params):
            raise InvalidTask(faults)
        self._params = p = params
        self._kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
        self._parts = _parts(p)
        if faults := _faults(self._parts, self._kinematics):
            raise InvalidTask(faults)
        self._points: list[Floats] = []
        self._q: list[Floats] = []
        self._qd: list[Floats] = []
        self._ends: list[int] = []
        """In which period each part but the first ends, counted from when the arm begins to come down."""
        for part in self._parts:
            self._add(part)
        self._departure = Departure(round(p.settle / float(_PERIOD)))

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that a step from here would begin with."""
        return self._command(self._departure.periods(go=u.go))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command that holds until t + dt."""
        y = self.outputs(t, u)
        self._departure.pass_period(go=u.go)
        return y

    def get_state(self) -> bytes:
        """Return the periods waited, and those of the task."""
        return pack_state(self._departure.state)

    def set_state(self, state: bytes) -> None:
        """Restore a state of this unit or of one with equal parameters."""
        self._departure.state = unpack_state(state)

    def _command(self, periods: int | None) -> Outputs:
        p, last = self._params, len(self._points) - 1
        if periods is None:
            start = self._parts[0].p_0
            q = self._kinematics.inverse(start)
            return self._output(start, q, p.qd_0, p.p_contact, vacuum=False, phase=TaskPhase.SETTLE)
        phase = 1 + bisect.bisect_right(self._ends, periods)
        k, part = min(periods, last), self._parts[min(phase, len(self._parts)) - 1]
        qd = self._qd[k] if phase < TaskPhase.DONE else p.qd_0
        return self._output(self._points[k], self._q[k], qd, part.pressure, part.vacuum, phase)

    def _output(self, goal: Floats, q: Floats, qd: Floats, pressure: float, vacuum: bool, phase: int) -> Outputs:
        return Outputs(
            p_WG_goal=np.array(goal),
            q_ref=np.array(q),
            qd_ref=np.array(qd),
            p_cmd=np.array([pressure, pressure]),
            vacuum=vacuum,
            phase=phase,
            done=phase == TaskPhase.DONE,
        )

    def _add(self, part: _Part) -> None:
        """Add a part's points, one a period, with the joint velocities towards each."""
        T = float(_PERIOD)
        if part.rest is not None:
            n = max(1, round(part.rest / T))
            q = self._q[-1]
            self._points += [part.p_1] * n
            self._q += [q] * n
            self._qd += [np.array(self._params.qd_0)] * n
        else:
            line = Line(part.p_0, part.p_1)
            n = max(1, round(line.length / part.speed / T))
            points, velocities = line.sampled(n, part.speed)
            before = self._q[-1] if self._q else self._kinematics.inverse(points[0])
            q, qd = self._kinematics.joint_path(points, velocities, float(before[0]))
            self._points += list(points[1:])
            self._q += q[1:]
            self._qd += qd
        self._ends.append(len(self._points))


def _parts(p: Params) -> Sequence[_Part]:
    """Return the parts of the task after the first settling, in the order of `PHASES`."""
    above, below = np.array([0.0, 0.0, p.hover]), np.array([0.0, 0.0, p.press])
    over_P, at_P, over_Q, at_Q = p.p_WP + above, p.p_WP - below, p.p_WQ + above, p.p_WQ - below
    return (
        _Part(over_P, at_P, p.V_contact, p.p_contact, vacuum=False),
        _Part(at_P, at_P, 0.0, p.p_contact, vacuum=True, rest=p.wait),
        _Part(at_P, over_P, p.V, p.p_carry, vacuum=True),
        _Part(over_P, over_Q, p.V, p.p_carry, vacuum=True),
        _Part(over_Q, over_Q, 0.0, p.p_contact, vacuum=True, rest=p.wait),
        _Part(over_Q, at_Q, p.V_contact, p.p_contact, vacuum=True),
        _Part(at_Q, at_Q, 0.0, p.p_contact, vacuum=False, rest=p.wait),
        _Part(at_Q, over_Q, p.V, p.p_contact, vacuum=False),
    )


def _faults(parts: Sequence[_Part], kinematics: VslKinematics) -> list[str]:
    """Return what is wrong with where the tip is to go, each place once."""
    faults: dict[str, None] = {}
    for name, part in zip(PHASES[1:], parts, strict=False):
        if part.rest is not None:
            continue
        line = Line(part.p_0, part.p_1)
        if line.length < 1e-6:
            faults[f"{name}: it has no length; p_WP and p_WQ differ, and hover and press are not both 0"] = None
            continue
        found = _first_fault((part.p_0, part.p_1), kinematics)
        if found is None:
            found = _first_fault(line.sampled(max(2, round(line.length / _MARGIN)), 1.0)[0], kinematics)
        if found is not None:
            faults[f"{name}: {found}"] = None
    return list(faults)


def _first_fault(points: Iterable[Floats], kinematics: VslKinematics) -> str | None:
    found = ((x, kinematics.fault(x, _MARGIN)) for x in points)
    return next((f"{format_point(x)}: {fault}" for x, fault in found if fault), None)
