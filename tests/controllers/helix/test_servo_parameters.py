import math
from typing import Any

import numpy as np
import pytest

from handover.controllers.helix.servo.servo_parameters import InvalidServoParameters, Params
from handover.controllers.helix.servo.visual_servo import VisualServo


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"alpha": 0.0}, "alpha = 0.0 must be positive"),
        ({"alpha": 1.5}, "alpha: 1.5 is out of range: from 0 to 1"),
        ({"alpha": math.nan}, "alpha: nan is not finite"),
        ({"Q_ball": 0.0}, "Q_ball = 0.0 must be positive"),
        ({"R_wrist": -0.1}, "R_wrist: -0.1 is out of range: at least 0 m2"),
        ({"P_init": 0.0}, "P_init = 0.0 must be positive"),
        ({"K_initialize": np.zeros(9)}, "K_initialize = .* must be positive"),
        ({"L_sys_LB": np.array([0, 0.08, 0, 0.27, 0, 0.16])}, "limits of l_2: lower 0.27 > upper 0.26"),
        ({"L_sys_LB": np.array([0.1, 0.08, 0, 0.16, 0, 0.16])}, "rotations d_i have the lower bound 0"),
        ({"l_calib": np.array([0.12, 0.3, 0.24])}, r"l_calib = \[0.12, 0.3, 0.24\] is outside the limits"),
        ({"threshold_retreat": 0.1}, r"must exceed threshold \+ d_grasp_offset = 0.1, .* over the gripper,"),
        (
            {"threshold_retreat": 0.12, "judge_apart": False},
            r"must exceed threshold \+ sqrt\(2\) d_grasp_offset = 0.1207, .* over wrist and gripper,",
        ),
        ({"closing_time": -1.0}, "closing_time: -1.0 is out of range: at least 0 s"),
        ({"control_period": 0.0}, "control_period: 0.0 is out of range: from 0.01 to 60 s"),
        ({"N_max_iter": 0}, "N_max_iter: 0 is out of range: at least 1"),
        ({"jitter": 0.95}, "jitter: 0.95 is out of range: from 0 to 0.9"),
        ({"least_response": 1.2}, "least_response: 1.2 is out of range: from 0.01 to 1"),
        ({"windup": -0.1}, "windup: -0.1 is out of range: at least 0 m"),
        ({"l_calib": np.array([0.12, 0.24])}, "l_calib: .* is not an array of shape"),
        ({"threshold_reopen": 0.002}, "threshold_reopen = 0.002 must exceed threshold_grasp = 0.003"),
    ],
)
def test_unusable_parameters_are_refused_by_name(values: dict[str, Any], message: str):
    with pytest.raises(InvalidServoParameters, match=message):
        VisualServo(Params(**values))


def test_the_arm_may_return_nearer_to_the_ball_where_the_error_is_the_gripper_s_alone():
    Params(threshold_retreat=0.12).check()


@pytest.mark.parametrize(
    "values",
    [
        {"alpha": 2.0, "Q_ball": -1.0, "closing_time": -1.0},
        {"alpha": 0.0, "l_calib": np.array([0.12, 0.3, 0.24]), "threshold_reopen": 0.002},
    ],
)
def test_all_faults_are_named_at_once(values: dict[str, Any]):
    with pytest.raises(InvalidServoParameters) as caught:
        VisualServo(Params(**values))
    assert len(caught.value.faults) == 3
