"""How the robot answers a push at its gripper. [Fernandes2020] table 4.1."""

import enum


class Behaviour(enum.IntEnum):
    """The two settings of the impedance controller."""

    RIGID = 0
    COMPLIANT = 1

    @property
    def item(self) -> str:
        """The item's name in the units' enumerations."""
        return self.name.lower()
