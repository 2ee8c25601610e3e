"""Parameters of a push against the robot's gripper; origins of the defaults are in `paper.toml`."""

import enum
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.units import Newton, NewtonMetre, Second
from handover.scenarios.free_flyer.behaviour import Behaviour


class Axis(enum.IntEnum):
    """The axis of W along or about which the gripper is pushed."""

    X = 0
    Y = 1
    Z = 2


class Wrench(enum.IntEnum):
    """Whether the gripper is pushed along an axis or twisted about it."""

    FORCE = 0
    TORQUE = 1


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """One push."""

    behaviour: Behaviour = parameter(Behaviour.RIGID, "setting of the impedance controller, [Fernandes2020] table 4.1")
    kind: Wrench = parameter(Wrench.FORCE, "whether the gripper is pushed or twisted")
    axis: Axis = parameter(Axis.X, "axis of W of the push")
    force: Newton = parameter(5.0, "force of a push", minimum=-50.0, maximum=50.0)
    torque: NewtonMetre = parameter(3.0, "torque of a twist", minimum=-10.0, maximum=10.0)
    begin: Second = parameter(1.0, "when the push begins", minimum=0.0, maximum=60.0)
    duration: Second = parameter(0.5, "how long the push lasts", minimum=0.0, maximum=60.0)
    ideal: bool = parameter(True, "whether the thrusters have neither limits nor lag, as the published plots need")
    delay: Second = parameter(0.0, "delay between a command and its thrust", minimum=0.0, maximum=0.2)
    delay_known: bool = parameter(True, "whether the controller is told the delay, and refuses one it is unstable with")
    patience: Second = parameter(60.0, "time after the push by which the robot must rest", minimum=1.0, maximum=600.0)

    @property
    def end(self) -> float:
        """When the push ends, s."""
        return self.begin + self.duration

    @property
    def stop(self) -> Fraction:
        """When a run ends at the latest, in seconds."""
        return Fraction(round((self.end + self.patience) * 1000), 1000)
