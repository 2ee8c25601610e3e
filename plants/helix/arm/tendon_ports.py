"""Ports of the tendon-driven arm, and what its two models share: apart from both, so that neither loads the other's."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats, Polyline25, Vector3, Vector4, Vector9, output, port
from handover.cosim.blocks.terminals import TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Newton, Number

R_WB = np.diag([1.0, -1.0, -1.0])
"""Orientation of the arm's base frame B, whose z points down, in the world W."""

_POINTS = 25


class StepSizeError(ValueError):
    """A step is not a multiple of the internal time step; nothing has changed."""

    is_refusal = True

    def __init__(self, dt: float, internal_step: float, block: str) -> None:
        steps = max(int(dt / internal_step), 1)
        super().__init__(
            f"{block}: a step of {dt:.6g} s is not a multiple of the internal step {internal_step:g} s; "
            f"{steps * internal_step:.6g} s or {(steps + 1) * internal_step:.6g} s would fit"
        )
        self.dt, self.internal_step = dt, internal_step


class SolverFailure(RuntimeError):
    """There is no solution; `time` is when, in s."""

    def __init__(self, block: str, time: float, reason: str) -> None:
        super().__init__(f"{block}: no solution at t = {time:.6g} s ({reason})")
        self.time = time


@dataclass(kw_only=True)
class Inputs:
    """Commands to motors and gripper, and what pulls at the gripper."""

    dl_t: Vector9[Metre] = port(
        np.zeros(9),
        "tendon length changes from calibration, three of each segment, positive longer; the motors have end stops",
    )
    f_G: Vector3[Newton] = port(np.zeros(3), "external force on the gripper, in the world")
    f_P: Vector3[Newton] = port(np.zeros(3), "force of a person's push on the gripper, in the world, besides f_G")
    closure: Number = port(0.0, "commanded closure of the gripper: 0 open, 1 closed", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    """Where the arm is, in the world, and what its tendons carry."""

    p_WR: Vector3[Metre] = output("position of the wrist's marker ring")
    q_WR: Vector4[Number] = output("orientation of the marker ring: z along the arm")
    p_WG: Vector3[Metre] = output("position of the gripper")
    q_WG: Vector4[Number] = output("orientation of the gripper: z along the arm")
    backbone: Polyline25[Metre] = output("points on the centre line, evenly spaced from the mount to the ring")
    tension: Vector9[Newton] = output("tensions of the tendons: three of each segment")
    grip: Number = output("closure that the gripper has reached: 0 open, 1 closed", minimum=0.0, maximum=1.0)


def _centre_line(p: Floats, tangent: Floats) -> Floats:
    """Return points evenly spaced along the cubic Hermite curve through p with unit tangents, both (n + 1, 3)."""
    chord = np.linalg.norm(np.diff(p, axis=0), axis=1)
    ends = np.append(0.0, np.cumsum(chord))
    s = np.linspace(0.0, float(ends[-1]), _POINTS)
    e = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(chord) - 1)
    x = ((s - ends[e]) / chord[e])[:, None]
    rise = chord[e, None] * (x * (1.0 - x) ** 2 * tangent[e] - x**2 * (1.0 - x) * tangent[e + 1])
    return p[e] + x**2 * (3.0 - 2.0 * x) * (p[e + 1] - p[e]) + rise


def internal_steps(dt: float, internal_step: float, block: str) -> int:
    """Return how many internal steps a step dt takes, both in s.

    Raises:
        StepSizeError: it is not a multiple of them.
    """
    steps = round(dt / internal_step)
    if steps < 1 or abs(steps * internal_step - dt) > 1e-6 * internal_step:
        raise StepSizeError(dt, internal_step, block)
    return steps


def closed_towards(grip: float, closure: float, travel: float) -> float:
    """Return the closure of a gripper that moved from `grip` towards `closure`, by `travel` at most."""
    return min(max(grip + min(max(closure - grip, -travel), travel), 0.0), 1.0)


def outputs_of(p_B: Floats, z_B: Floats, q_WR: Floats, d_gripper: float, tension: Floats, grip: float) -> Outputs:
    """Return an arm's outputs.

    Args:
        p_B: nodes from the mount to the ring, in B, (n + 1, 3), m.
        z_B: directions of their axes, in B, (n + 1, 3).
        q_WR: orientation of the ring.
        d_gripper: distance of ring and gripper, m.
        tension: forces in the tendons, (9,), N; negative in a slack one.
        grip: closure of the gripper.
    """
    return Outputs(
        p_WR=R_WB @ p_B[-1],
        q_WR=q_WR,
        p_WG=R_WB @ (p_B[-1] + d_gripper * z_B[-1]),
        q_WG=np.array(q_WR),
        backbone=_centre_line(p_B, z_B) @ R_WB,
        tension=np.maximum(tension, 0.0),
        grip=grip,
    )


TERMINALS = (
    terminal("wrist", TerminalKind.POSE, "p_WR", "q_WR"),
    terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),
    terminal("actuators", TerminalKind.COMMAND, "dl_t", "closure"),
)
"""What of an arm's ports is connected together."""
