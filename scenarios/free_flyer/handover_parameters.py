"""Parameters of a handover in microgravity; origins of the defaults are in `paper.toml`."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Vector3, parameter
from handover.cosim.blocks.units import Metre, Newton, Second
from handover.scenarios.free_flyer.behaviour import Behaviour


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One handover. Bounds of the place keep it within the person's and the robot's part of the cabin (assumed)."""

    behaviour: Behaviour = parameter(Behaviour.RIGID, "setting of the impedance controller, [Fernandes2020] table 4.1")
    p_WG_handover: Vector3[Metre] = parameter(
        np.array([0.0, -0.07, 0.0]), "where the gripper waits for the person, in W", minimum=-1.0, maximum=1.0
    )
    strength: Newton = parameter(4.0, "force with which the person pulls and pushes at most", minimum=0.1, maximum=20.0)
    ideal: bool = parameter(False, "whether the thrusters have neither limits nor lag")
    delay: Second = parameter(0.0, "delay between a command and its thrust", minimum=0.0, maximum=0.2)
    patience: Second = parameter(
        60.0, "time in any one phase after which the robot gives up", minimum=1.0, maximum=600.0
    )
