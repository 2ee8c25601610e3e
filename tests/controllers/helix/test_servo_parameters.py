import math
from typing import Any

import numpy as np
import pytest

from handover.controllers.helix.servo.servo_parameters import InvalidServoParameters, Params
from handover.controllers.helix.servo.visual_servo import VisualServo


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"alpha": 0.0}, r"alpha = 0.0 is outside \(0, 1\]"),
        ({"alpha": 1.5}, r"alpha = 1.5 is outside \(0, 1\]"),
        ({"alpha": math.nan}, "alpha = nan is not finite"),
        ({"Q_ball": 0.0}, "Q_ball = 0.0 must be positive"),
        ({"R_wrist": -0.1}, "R_wrist = -0.1 must be positive"),
        ({"P_init": 0.0}, "P_init = 0.0 must be positive"),
        ({"K_initialize": np.zeros(9)}, "K_initialize = .* must be positive"),
        ({"L_sys_LB": np.array([0, 0.08, 0, 0.27, 0, 0.16])}, "limits of l_2: lower 0.27 > upper 0.26"),
        ({"L_sys_LB": np.array([0.1, 0.08, 0, 0.16, 0, 0.16])}, "rotations d_i have the lower bound 0"),
        ({"l_calib": np.array([0.12, 0.3, 0.24])}, r"l_calib = \[0.12, 0.3, 0.24\] is outside the limits"),
        ({"threshold_retreat": 0.1}, "threshold_retreat = 0.1 must exceed"),
        ({"closing_time": -1.0}, "closing_time = -1.0 must not be negative"),
        ({"control_period": 0.0}, "control_period = 0.0 must be positive"),
        ({"N_max_iter": 0}, "N_max_iter = 0 must be positive"),
        ({"least_response": 1.2}, "least_response = 1.2 is a part, at most 1"),
        ({"least_response": 0.0}, "least_response = 0.0 must be positive"),
        ({"windup": -0.1}, "windup = -0.1 must not be negative"),
        ({"threshold_reopen": 0.002}, "threshold_reopen = 0.002 must exceed threshold_grasp = 0.003"),
    ],
)
def test_unusable_parameters_are_refused_by_name(values: dict[str, Any], message: str):
    with pytest.raises(InvalidServoParameters, match=message):
        VisualServo(Params(**values))


def test_all_faults_are_named_at_once():
    with pytest.raises(InvalidServoParameters) as caught:
        VisualServo(Params(alpha=2.0, Q_ball=-1.0, closing_time=-1.0))
    assert len(caught.value.faults) == 3
