"""The grasp scene with all that moves and disturbs, in FMPy's host: the same as the block itself."""

from typing import Any

import fmpy
import numpy as np
import pytest

from handover.fmus.build import cached
from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.parameters import Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs

HOST: Any = fmpy
STEP, STEPS = 0.015, 40
OUTPUTS = ("p_WO[1]", "p_WO[2]", "p_WX[1]", "p_WX[2]", "p_ground[2]", "ticks[1]", "ticks[3]", "p_WH_meas[1]", "yaw_O")


def test_fmpy_runs_a_disturbed_scene_as_it_is():
    p = Params(
        thing=Thing.POLYGON,
        p_WH_0=np.array([-0.2, 0.0]),
        carry_velocity=np.array([0.0, 0.03]),
        other_radius=0.02,
        p_WX_0=np.array([0.0, 0.062]),
        sensor_tolerance=0.1,
        active=2,
        fingers_seen=True,
        wrist_noise=1e-3,
        seed=3,
    )
    scene = GraspScene(p)
    ys = [scene.outputs(0.0, Inputs())]
    u = Inputs(p_WH_cmd=np.array([-0.14, 0.0]), sigma_cmd=0.2)
    ys += [scene.step(k * STEP, STEP, u) for k in range(STEPS)]
    result = HOST.simulate_fmu(
        str(cached("GraspScene", 3, scalar=True)),
        stop_time=STEPS * STEP,
        output_interval=STEP,
        start_values={
            "thing": 7,
            "p_WH_0[1]": -0.2,
            "p_WH_0[2]": 0.0,
            "carry_velocity[2]": 0.03,
            "other_radius": 0.02,
            "p_WX_0[1]": 0.0,
            "p_WX_0[2]": 0.062,
            "sensor_tolerance": 0.1,
            "active": 2,
            "fingers_seen": True,
            "wrist_noise": 1e-3,
            "seed": 3,
            "p_WH_cmd[1]": -0.14,
            "p_WH_cmd[2]": 0.0,
            "sigma_cmd": 0.2,
        },
        output=list(OUTPUTS),
    )
    assert np.ptp(result["p_WX[2]"]) > 1e-3
    for name in OUTPUTS:
        field, _, index = name.rstrip("]").partition("[")
        wanted = [np.ravel(getattr(y, field))[int(index or 1) - 1] for y in ys]
        assert result[name] == pytest.approx(wanted, abs=1e-12), name
