"""Impedance control of a free-flyer's gripper, as a spring and a damper. [Fernandes2020] sec. 3.3.3 and 4.1.2."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.free_flyer.body import InvalidControllerParameters, stability_faults
from handover.controllers.free_flyer.flyer_controller import GainParams, GripperController, RobotParams
from handover.controllers.free_flyer.gains import ImpedanceGains, published_gains
from handover.controllers.free_flyer.ports import (
    Behaviour,
    Inputs,
    Outputs,
    unit_quaternion,
)
from handover.controllers.free_flyer.sampled_loop import SampledLoop
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    add,
    cross,
    inverse_rotate,
    multiply,
    norm,
    relative_quaternion,
    rotate,
    rotation_matrix,
    rotation_vector,
    row_major,
    subtract,
    vector,
)

__all__ = ["Behaviour", "ImpedanceController", "Inputs", "InvalidControllerParameters", "Outputs", "Params"]

_NAME = "ImpedanceController"


@dataclass(frozen=True, kw_only=True)
class Params(RobotParams, GainParams):
    """Gains of table 4.1 or custom ones, and what the robot knows of itself: public values of Astrobee, arm assumed."""

    def gains(self) -> ImpedanceGains:
        """Return the gains of the behaviour."""
        if self.behaviour is not Behaviour.CUSTOM:
            return published_gains(self.behaviour, self.body())
        return self.custom_gains()


class ImpedanceController(GripperController[Inputs, Outputs]):
    """u = J^T (-k_B x' + k_D x~), eq. (3.25), with x~ = x_d - x and x_d' = 0: no force sensor is needed.

    x is the gripper's pose. Its error is p_WG_goal - p_WG and, in place of differences of Euler angles, the rotation
    vector of R_GD, of at most half a turn. D is the goal's frame, and x' is the gripper's velocity and angular
    velocity. All of them and the gains are in the goal's axes. So spring and damper are fixed to the goal, and the
    linearised loop is the same for any goal. With fixed joints J is eq. (3.11) of the base alone: with f the force in
    the brackets and tau its torque, the command is, in B, F = f and M = tau + p_BG x f. Eq. (4.3) turns generalised
    forces of Euler angles into these; with twists it is a rotation into B.

    At construction the loop near the goal (12 states, 18 with a lag) is closed at the period with python-control, with
    the expected delay and lag but without saturation. With the rigid gains it is stable up to a delay of 16 ms with the
    default lag, and of 26 ms without lag.

    Raises:
        InvalidControllerParameters: by the constructor, for an impossible body, gains that are not positive definite,
            or a loop that is not stable.
        InvalidOrientation: a quaternion is zero or not finite.
    """

    def __init__(self, params: Params) -> None:
        body, gains, period = params.body(), params.gains(), float(self.period)
        faults = body.faults() + (gains.faults() if params.behaviour is Behaviour.CUSTOM else [])
        faults = faults or stability_faults(
            body, lambda factor, _: gains.scaled(factor).law(body), period, params.delay, params.lag
        )
        if faults:
            raise InvalidControllerParameters(_NAME, faults)
        self.loop = SampledLoop(body.linear_plant(params.lag), gains.law(body), period, params.delay)
        self._loop_figures = self.loop.figures
        self._p_BG = vector(params.p_BG)
        self._k, self._d = row_major(gains.stiffness_translation), row_major(gains.damping_translation)
        self._k_R, self._d_R = row_major(gains.stiffness_rotation), row_major(gains.damping_rotation)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command for the measurements of t, which holds until t + dt."""
        q_WD = unit_quaternion(u.q_WG_goal, _NAME, "q_WG_goal")
        q_WB = unit_quaternion(u.q_WB_meas, _NAME, "q_WB_meas")
        r = rotate(rotation_matrix(q_WB), self._p_BG)
        e = subtract(subtract(vector(u.p_WG_goal), vector(u.p_WB_meas)), r)
        q_DB = relative_quaternion(q_WD, q_WB)
        phi = rotation_vector(q_DB)
        f, tau = ZERO, ZERO
        if u.active:
            w = vector(u.w_WB_meas)
            R_WD, R_DB = rotation_matrix(q_WD), rotation_matrix(q_DB)
            e_D, w_D = inverse_rotate(R_WD, e), inverse_rotate(R_WD, w)
            v_D = inverse_rotate(R_WD, add(vector(u.v_WB_meas), cross(w, r)))
            f = inverse_rotate(R_DB, subtract(multiply(self._k, e_D), multiply(self._d, v_D)))
            resistance = inverse_rotate(R_DB, add(multiply(self._k_R, phi), multiply(self._d_R, w_D)))
            tau = subtract(cross(self._p_BG, f), resistance)
        return Outputs(
            f_cmd=np.array(f) if u.active else np.zeros(3),
            tau_cmd=np.array(tau) if u.active else np.zeros(3),
            error_p=norm(e),
            error_R=norm(phi),
            **self._loop_figures,
        )
