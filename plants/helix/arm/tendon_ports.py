"""Ports of the tendon-driven arm, and what its two models share: apart from both, so that neither loads the other's."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats, Polyline25, Vector3, Vector4, Vector9, output, port
from handover.cosim.blocks.units import Metre, Newton, Number

R_WB = np.diag([1.0, -1.0, -1.0])
"""Orientation of the arm's base frame B, whose z points down, in the world W."""

_POINTS = 25


class StepSizeError(ValueError):
    """A step is no multiple of the internal time step; nothing has changed."""

    is_refusal = True

    def __init__(self, dt: float, internal_step: float, block: str = "TendonArm") -> None:
        steps = max(int(dt / internal_step), 1)
        super().__init__(
            f"{block}: a step of {dt:.6g} s is no multiple of the internal step {internal_step:g} s; "
            f"{steps * internal_step:.6g} s or {(steps + 1) * internal_step:.6g} s would fit"
        )
        self.dt, self.internal_step = dt, internal_step


@dataclass(kw_only=True)
class Inputs:
    """Commands to motors and gripper, and what pulls at the gripper."""

    dl_t: Vector9[Metre] = port(
        np.zeros(9),
        "tendon length changes from calibration, three of each segment, positive longer; the motors have end stops",
    )
    f_G: Vector3[Newton] = port(np.zeros(3), "external force on the gripper, in the world")
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


def centre_line(p: Floats, tangent: Floats) -> Floats:
    """Return points evenly spaced along the cubic Hermite curve through p with unit tangents, both (n + 1, 3)."""
    chord = np.linalg.norm(np.diff(p, axis=0), axis=1)
    ends = np.append(0.0, np.cumsum(chord))
    s = np.linspace(0.0, float(ends[-1]), _POINTS)
    e = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(chord) - 1)
    x = ((s - ends[e]) / chord[e])[:, None]
    rise = chord[e, None] * (x * (1.0 - x) ** 2 * tangent[e] - x**2 * (1.0 - x) * tangent[e + 1])
    return p[e] + x**2 * (3.0 - 2.0 * x) * (p[e + 1] - p[e]) + rise
