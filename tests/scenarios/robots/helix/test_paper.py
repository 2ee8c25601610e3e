"""The code has the values that `paper.toml` gives, and units agree with each other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli

import handover.scenarios.robots.helix
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.vision.handover_vision import Params as VisionParams
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.robots.helix.calibrate_detector import calibrated_detector
from handover.scenarios.robots.helix.cameras import CameraPlaces, camera_parameters
from handover.scenarios.robots.helix.disturbances import Disturbances
from handover.scenarios.robots.helix.helix_reach import ReachParameters
from handover.scenarios.robots.helix.parameters import HandPlace, Parameters, Task, Tuning

Paper = dict[str, dict[str, dict[str, Any]]]

_OPTICS = (
    *(f"{what}_{side}" for what in ("p_WC", "q_WC", "intrinsics", "distortion") for side in CameraPlaces.THREE.sides),
    *("apothem", "marker", "rings", "ball_radius", "has_third", "decimation"),
)
_DISTURBANCES = {
    "tremor": "tremor_rms",
    "drift": "drift_rms",
    "hand_force_max": "force_max",
    "guidance": "guide_stiffness",
    **{name: name for name in ("ball_mass", "finger_friction", "help_speed")},
}
_REACH = ("radius", "height", "alpha", "azimuth", "patience")
SAME: tuple[tuple[type[Any], type[Any], dict[str, str]], ...] = (
    (VisionParams, CameraParams, {name: name for name in _OPTICS}),
    (VisionParams, ServoParams, {"d_gripper": "d_gripper"}),
    (VisionParams, Task, {"detector": "detector"}),
    (CameraParams, HandParams, {name: name for name in ("p_WD", "bowl_radius", "bowl_depth")}),
    (Task, ServoParams, {name: name for name in ("alpha", "control_period", "threshold")}),
    (Task, CameraParams, {name: name for name in ("marker", "rings")}),
    (Disturbances, HandParams, _DISTURBANCES),
    (
        Disturbances,
        CameraParams,
        {name: name for name in ("light", "lost_pictures", "covered_markers")} | {"sensor_noise": "noise"},
    ),
    (Disturbances, ServoParams, {"jitter": "jitter"}),
    (ReachParameters, Task, {name: name for name in _REACH}),
)
"""Classes of parameters, and by the first one's names the other's, with the same defaults."""

STATUS = {"stated", "derived", "assumed", "read off figure"}

FILES = sorted((Path(handover.scenarios.robots.helix.__file__).parent.parent).glob("*/paper.toml"))


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.robots.helix.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def test_every_value_has_its_unit_origin_and_status():
    assert {file.parent.name for file in FILES} == {e.__module__.split(".")[3] for e in SCENARIOS.values()}
    for file in FILES:
        for group in tomli.loads(file.read_text(encoding="utf-8")).values():
            for name, entry in group.items():
                assert set(entry) == {"value", "unit", "where", "status"}, name
                assert all((entry["unit"], entry["where"], entry["status"] in STATUS)), name


@pytest.mark.parametrize(("one", "other", "names"), SAME)
def test_what_several_have_is_the_same(one: type[Any], other: type[Any], names: dict[str, str]):
    for name, theirs in names.items():
        assert np.array_equal(getattr(one(), name), getattr(other(), theirs)), name


def test_cameras_are_where_the_units_have_them():
    camera, poses = CameraParams(), camera_parameters(places=CameraPlaces.THREE)
    for name, value in poses.items():
        np.testing.assert_array_equal(value, True if name == "has_third" else getattr(camera, name), name)


def test_settings_of_experiments_are_the_defaults(paper: Paper):
    servo, task = ServoParams(), Task()
    assert servo.control_period == paper["experiment"]["control_period"]["value"]
    assert servo.threshold_drop == paper["delivery"]["threshold_drop"]["value"][Tuning.OWN]
    assert (task.radius, task.height) == tuple(paper["experiment"][n]["value"] for n in ("radius", "height"))
    assert Disturbances().box_height == paper["calibration"]["box_height"]["value"]


def test_what_stands_elsewhere_in_the_code_is_the_published(paper: Paper):
    assert [e.name.lower().replace("_", "-") for e in HandPlace] == paper["experiment"]["places"]["value"]
    tremor = HandParams().tremor_rms
    assert ServoParams().ball_motion == pytest.approx(tremor / np.sqrt(3.0), abs=5e-5)


def test_a_tuning_stands_for_its_settings(paper: Paper):
    thesis = Parameters(tuning=Tuning.THESIS).settings
    assert thesis == {name: entry["value"] for name, entry in paper["thesis"].items()}
    assert set(thesis) == set(Parameters().settings)


def test_the_detector_s_shifts_are_those_that_pictures_tell():
    found = calibrated_detector(CameraParams(), pairs=10, seed=1)
    assert VisionParams().corner_shift == pytest.approx(found.corner_shift.value, abs=0.03)
    assert VisionParams().edge_shift == pytest.approx(found.edge_shift.value, abs=0.03)
