"""The free-flyer's decision and controllers at the rate that [Fernandes2020] sec. 4.1.2 prints, 67.5 Hz.

Astrobee's software runs at 62.5 Hz, as `PERIOD` has it. These take the units' places by their paths, all three at once:
`--unit impedance=handover.controllers.free_flyer.published_rate:ImpedanceController67`, or AdmittanceController67.
"""

from fractions import Fraction
from typing import ClassVar, Final

from handover.controllers.free_flyer.admittance_controller import AdmittanceController
from handover.controllers.free_flyer.handover_state_machine import HandoverStateMachine
from handover.controllers.free_flyer.impedance_controller import ImpedanceController
from handover.controllers.free_flyer.pose_controller import PoseController

PUBLISHED_PERIOD: Final = Fraction(2, 135)
"""Time between two samples, s."""


class HandoverStateMachine67(HandoverStateMachine):
    """Runs a handover through the states of figure 3.1, at 67.5 Hz."""

    period: ClassVar[Fraction] = PUBLISHED_PERIOD


class ImpedanceController67(ImpedanceController):
    """u = J^T (-k_B x' + k_D x~), eq. (3.25), at 67.5 Hz."""

    period: ClassVar[Fraction] = PUBLISHED_PERIOD


class AdmittanceController67(AdmittanceController):
    """Moves a virtual mass by the wrench on the gripper, at 67.5 Hz."""

    period: ClassVar[Fraction] = PUBLISHED_PERIOD


class PoseController67(PoseController):
    """Flies to a pose by Astrobee's PID control, at 67.5 Hz."""

    period: ClassVar[Fraction] = PUBLISHED_PERIOD
