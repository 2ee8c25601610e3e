"""How a free-flyer's gripper yields. [Fernandes2020] sec. 4.1.2."""

import enum


class Behaviour(enum.IntEnum):
    """Gains of the impedance control, and with them the velocities that tell of a person: table 4.1 or one's own."""

    RIGID = 0
    COMPLIANT = 1
    CUSTOM = 2
