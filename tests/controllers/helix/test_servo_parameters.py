import math
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.controllers.helix.servo.servo_parameters import InvalidServoParameters, Params
from handover.controllers.helix.servo.visual_servo import VisualServo

UNUSABLE: list[dict[str, Any]] = [
    {"alpha": 0.0, "Q_ball": 0.0, "P_init": 0.0, "K_initialize": np.zeros(9), "threshold_drop": 0.0},
    {"alpha": 1.5, "R_wrist": -0.1, "closing_time": -1.0, "control_period": 0.0, "N_max_iter": 0},
    {"alpha": math.nan, "jitter": 0.95, "least_response": 1.2, "windup": -0.1},
    {"L_sys_LB": np.array([0, 0.08, 0, 0.27, 0, 0.16]), "l_calib": np.array([0.12, 0.3, 0.24])},
    {"L_sys_LB": np.array([0.1, 0.08, 0, 0.16, 0, 0.16])},
    {"l_calib": np.array([0.12, 0.3, 0.24]), "threshold_reopen": 0.002, "threshold_retreat": 0.1},
    {"threshold_retreat": 0.12, "judge_apart": False},
    {"l_calib": np.array([0.12, 0.24])},
]


def test_unusable_parameters_are_refused_by_name_all_at_once(wording: Wording):
    for values in UNUSABLE:
        with pytest.raises(InvalidServoParameters) as caught:
            VisualServo(Params(**values))
        wording.check("\n".join(caught.value.faults))
    Params(threshold_retreat=0.12).check()  # nearer to the ball, where the error is the gripper's alone
