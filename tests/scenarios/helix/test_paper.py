"""The code's defaults are the values whose origins `paper.toml` gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.scenarios.parameter_origins import assert_every_default_has_its_origin

import handover.scenarios.helix
from handover.controllers.helix.reflex.grasp_reflex import Params as ReflexParams
from handover.controllers.helix.servo.jacobian_control import STIFFENING
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.vision.handover_vision import Params as VisionParams
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.finger_infrared import Params as InfraredParams
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.helix.calibrate_detector import calibrated_detector
from handover.scenarios.helix.cameras import CameraPlaces, camera_parameters
from handover.scenarios.helix.disturbances import Disturbances
from handover.scenarios.helix.helix_reach import ReachParameters
from handover.scenarios.helix.parameters import HandPlace, Parameters, Task, Tuning
from handover.scenarios.helix.reflex_grasp_parameters import ReflexGraspParameters

Paper = dict[str, dict[str, dict[str, Any]]]

CODE: dict[str, tuple[type[Any], tuple[str, ...]]] = {
    "servo": (ServoParams, ("servo", "own")),
    "arm": (ArmParams, ("arm",)),
    "hand": (HandParams, ("hand",)),
    "camera": (CameraParams, ("pictures",)),
    "vision": (VisionParams, ("vision",)),
    "task": (Task, ("task",)),
    "disturbances": (Disturbances, ("disturbances",)),
    "reach": (ReachParameters, ()),
    "infrared": (InfraredParams, ("infrared",)),
    "reflex": (ReflexParams, ("reflex",)),
    "reflex_grasp": (ReflexGraspParameters, ("reflex_grasp",)),
}
"""Classes, and groups that have a class's parameters alone."""


_OPTICS: dict[str, tuple[Any, ...]] = {
    "p_WC_left": ("camera", "p_WC", 0),
    "p_WC_right": ("camera", "p_WC", 1),
    "p_WC_third": ("camera", "p_WC_top"),
    **{
        f"{lens}_{side}": ("camera", lens, k)
        for lens in ("intrinsics", "distortion")
        for k, side in enumerate(CameraPlaces.THREE.sides)
    },
    **{name: ("camera", name) for name in ("apothem", "marker", "rings", "ball_radius")},
}
_PLACE: dict[str, tuple[Any, ...]] = {
    "radius": ("experiment", "radius"),
    "height": ("experiment", "height"),
}

SHARED: dict[str, dict[str, tuple[Any, ...]]] = {
    "servo": {
        "alpha": ("task", "alpha"),
        "control_period": ("experiment", "control_period"),
        "carry_after": ("delivery", "carry_after"),
        "threshold_drop": ("delivery", "threshold_drop", Tuning.OWN),
    },
    "hand": {"bowl_depth": ("bowl", "bowl_depth")},
    "camera": _OPTICS
    | {"p_WD": ("hand", "p_WD"), "bowl_radius": ("hand", "bowl_radius"), "bowl_depth": ("bowl", "bowl_depth")},
    "vision": _OPTICS
    | {
        "has_third": ("pictures", "has_third"),
        "decimation": ("pictures", "decimation"),
        "detector": ("task", "detector"),
        "d_gripper": ("servo", "d_gripper"),
    },
    "task": _PLACE
    | {
        "control_period": ("experiment", "control_period"),
        "threshold": ("servo", "threshold"),
        "marker": ("camera", "marker"),
        "rings": ("camera", "rings"),
    },
    "disturbances": {
        "tremor": ("hand", "tremor_rms"),
        "drift": ("hand", "drift_rms"),
        "ball_mass": ("hand", "ball_mass"),
        "finger_friction": ("hand", "finger_friction"),
        "hand_force_max": ("hand", "force_max"),
        "help_speed": ("hand", "help_speed"),
        "guidance": ("hand", "guide_stiffness"),
        "box_height": ("calibration", "box_height"),
        "light": ("pictures", "light"),
        "sensor_noise": ("pictures", "noise"),
        "lost_pictures": ("pictures", "lost_pictures"),
        "covered_markers": ("pictures", "covered_markers"),
        "jitter": ("servo", "jitter"),
    },
    "reach": _PLACE | {name: ("task", name) for name in ("alpha", "azimuth", "patience")},
}
"""Parameters whose origin is that of another one: its group, its name there, and where it is a list, which element."""

STATUS = {"stated", "derived", "assumed", "read off figure"}

FILES = sorted((Path(handover.scenarios.helix.__file__).parent.parent).glob("*/paper.toml"))


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.helix.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def test_every_value_has_its_unit_origin_and_status():
    assert {file.parent.name for file in FILES} == {e.__module__.split(".")[2] for e in SCENARIOS.values()}
    for file in FILES:
        for group in tomli.loads(file.read_text(encoding="utf-8")).values():
            for name, entry in group.items():
                assert set(entry) == {"value", "unit", "where", "status"}, name
                assert all((entry["unit"], entry["where"], entry["status"] in STATUS)), name


def origins_of(paper: Paper, name: str) -> dict[str, Any]:
    """Return the origins of a unit's or a scenario's parameters: groups of its own, and what it shares with others."""
    origins = {parameter: entry for group in CODE[name][1] for parameter, entry in paper[group].items()}
    for parameter, (group, key, *index) in SHARED.get(name, {}).items():
        entry = paper[group][key]
        origins[parameter] = entry | {"value": entry["value"][index[0]]} if index else entry
    return origins


@pytest.mark.parametrize("name", CODE)
def test_every_default_has_its_origin(paper: Paper, name: str):
    origins = origins_of(paper, name)
    if name in ("camera", "vision"):  # turned to what all cameras look at
        poses = camera_parameters(places=CameraPlaces.THREE)
        for side in CameraPlaces.THREE.sides:
            origins[f"q_WC_{side}"] = paper["camera"]["looked_at"] | {"value": poses[f"q_WC_{side}"], "unit": "1"}
    assert_every_default_has_its_origin(origins, CODE[name][0])


def test_what_stands_elsewhere_in_the_code_is_the_published(paper: Paper):
    assert [e.name.lower().replace("_", "-") for e in HandPlace] == paper["experiment"]["places"]["value"]
    assert paper["jacobian_control"]["stiffening"]["value"] == STIFFENING
    tremor = paper["hand"]["tremor_rms"]["value"]
    assert paper["servo"]["ball_motion"]["value"] == pytest.approx(tremor / np.sqrt(3.0), abs=5e-5)
    c = camera_parameters(places=CameraPlaces.THREE)
    assert [c["p_WC_left"].tolist(), c["p_WC_right"].tolist()] == paper["camera"]["p_WC"]["value"]
    assert c["p_WC_third"].tolist() == paper["camera"]["p_WC_top"]["value"]


def test_a_tuning_stands_for_its_settings(paper: Paper):
    thesis = Parameters(tuning=Tuning.THESIS).settings
    assert thesis == {name: entry["value"] for name, entry in paper["thesis"].items()}
    assert set(thesis) == set(Parameters().settings)


def test_the_detector_s_shifts_are_those_that_pictures_tell():
    found = calibrated_detector(CameraParams(), pairs=10, seed=1)
    assert VisionParams().corner_shift == pytest.approx(found.corner_shift.value, abs=0.03)
    assert VisionParams().edge_shift == pytest.approx(found.edge_shift.value, abs=0.03)
