"""Signals as a gripper that hangs down over a ball would show them, for evaluators."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.helix.servo.visual_servo import Phase, Verdict
from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.plants.helix.hand.partner_parameters import Holder

PICTURE = np.zeros(720 * 1280 * 3, dtype=np.uint8)
P_WG = np.array([0.16, 0.0, -0.6])
CALIBRATED = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])
P_WR = P_WG + np.array([0.0, 0.0, 0.1])


Views = dict[str, dict[str, tuple[NDArray[Any], ...]]]
Ports = dict[str, dict[str, FmuPort]]


def views_and_ports(
    phase: Phase,
    holder: Holder = Holder.HAND,
    beside: float = 0.0,
    along: float = 0.0,
    sees_ball: bool = True,
    verdict: Verdict = Verdict.NONE,
    hand_force: float = 0.2,
    error: float = 0.01,
    touching: bool = True,
) -> tuple[Views, Ports]:
    """Return what a gripper that hangs down, and a ball at a place in its frame, would show."""
    f_G, f_H = (np.array([0.0, 0.0, f]) for f in (0.1 * touching, -hand_force))
    reals = {
        "arm": {"p_WG": P_WG, "q_WG": [0.0, 1.0, 0.0, 0.0]},
        "hand": {"p_WO": P_WG + np.array([beside, 0.0, -along]), "f_H": f_H, "f_G": f_G},
        "servo": {"error": [error], "p_WO_est": P_WG, "p_WR_est": P_WG, "p_WG_est": P_WG, "q_sys": CALIBRATED},
        "vision": {"p_WO_meas": P_WG, "p_WR_meas": P_WR, "p_WG_meas": P_WG},
    }
    units: Views = {
        unit: {name: (np.array(value),) for name, value in values.items()} for unit, values in reals.items()
    }
    ports: Ports = {
        unit: {name: port(name, Kind.REAL, shape=v[0].shape if v[0].size > 1 else ()) for name, v in values.items()}
        for unit, values in units.items()
    }
    for name, seen in (("seen_O", sees_ball), ("seen_R", True)):
        units["vision"][name] = (np.array([seen]),)
        ports["vision"][name] = port(name, Kind.BOOLEAN)
    for unit, name, item in (("servo", "phase", phase), ("hand", "holder", holder), ("servo", "verdict", verdict)):
        units[unit][name] = (np.array([int(item)]),)
        ports[unit][name] = port(name, Kind.ENUMERATION, items=tuple((i.name, int(i)) for i in type(item)))
    pixels = (np.array([PICTURE.ctypes.data]), np.array([PICTURE.size]))
    units["camera"] = dict.fromkeys(("left", "right"), pixels)
    ports["camera"] = {side: port(side, Kind.BINARY) for side in ("left", "right")}
    return units, ports


def port(name: str, kind: Kind, **more: Any) -> FmuPort:
    return FmuPort(name=name, kind=kind, causality=Causality.OUTPUT, fmi_type="", references=(), **more)
