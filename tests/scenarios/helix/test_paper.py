"""The code's defaults are the values whose origins `paper.toml` gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli

import handover.scenarios.helix
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.vision.handover_vision import Params as VisionParams
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.hand.partner_parameters import Params as HandParams
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.helix.calibrate_detector import calibrated_detector
from handover.scenarios.helix.cameras import CameraPlaces, camera_parameters
from handover.scenarios.helix.parameters import HandPlace, Parameters, Tuning

STATUS = {"stated", "derived", "assumed", "read off figure"}

FILES = sorted((Path(handover.scenarios.helix.__file__).parent.parent).glob("*/paper.toml"))


@pytest.fixture(scope="module")
def paper() -> dict[str, dict[str, dict[str, Any]]]:
    file = Path(handover.scenarios.helix.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.parent.name)
def test_every_value_has_its_unit_origin_and_status(file: Path):
    for group in tomli.loads(file.read_text(encoding="utf-8")).values():
        for name, entry in group.items():
            assert set(entry) == {"value", "unit", "where", "status"}, name
            assert entry["unit"], name
            assert entry["where"], name
            assert entry["status"] in STATUS, name


def test_every_robot_has_its_paper_file():
    experiments = {e.__module__.split(".")[2] for e in SCENARIOS.values()}
    assert {file.parent.name for file in FILES} == experiments


def test_the_scenarios_defaults_have_an_origin(paper: dict[str, dict[str, dict[str, Any]]]):
    p, experiment = Parameters(), paper["experiment"]
    assert p.radius == experiment["radius"]["value"]
    assert p.height == experiment["height"]["value"]
    assert p.control_period == experiment["control_period"]["value"]
    assert p.alpha == experiment["default_alpha"]["value"]
    assert p.detector.name.lower() == experiment["default_detector"]["value"]
    assert p.marker == paper["camera"]["marker"]["value"]
    assert p.rings == paper["camera"]["rings"]["value"]
    assert [e.name.lower().replace("_", "-") for e in HandPlace] == experiment["places"]["value"]


def test_the_controllers_defaults_have_an_origin(paper: dict[str, dict[str, dict[str, Any]]]):
    servo, scenario = ServoParams(), Parameters()
    for name, entry in (paper["servo"] | paper["own"]).items():
        assert np.array_equal(getattr(servo, name), entry["value"]), name
        if hasattr(scenario, name):
            assert getattr(scenario, name) == entry["value"], name


@pytest.mark.parametrize(("group", "plant"), [("arm", ArmParams()), ("hand", HandParams())])
def test_the_plants_defaults_have_an_origin(
    paper: dict[str, dict[str, dict[str, Any]]], group: str, plant: ArmParams | HandParams
):
    for name, entry in paper[group].items():
        assert np.array_equal(getattr(plant, name), entry["value"]), name


def test_the_cameras_are_where_the_paper_file_says(paper: dict[str, dict[str, dict[str, Any]]]):
    c, sides = camera_parameters(places=CameraPlaces.THREE), CameraPlaces.THREE.sides
    assert [c["p_WC_left"].tolist(), c["p_WC_right"].tolist()] == paper["camera"]["p_WC"]["value"]
    assert c["p_WC_third"].tolist() == paper["camera"]["p_WC_top"]["value"]
    assert [c[f"intrinsics_{side}"].tolist() for side in sides] == paper["camera"]["intrinsics"]["value"]
    camera = CameraParams()
    for side in sides:
        for what in ("p_WC", "q_WC", "intrinsics", "distortion"):
            np.testing.assert_allclose(getattr(camera, f"{what}_{side}"), c[f"{what}_{side}"], atol=1e-12)
    for name in ("marker", "rings", "apothem", "ball_radius"):
        assert getattr(camera, name) == paper["camera"][name]["value"], name


def test_a_tuning_stands_for_its_settings(paper: dict[str, dict[str, dict[str, Any]]]):
    thesis = Parameters(tuning=Tuning.THESIS).settings
    assert thesis == {name: entry["value"] for name, entry in paper["thesis"].items()}
    assert set(thesis) == set(Parameters().settings)


def test_the_detector_s_shifts_are_those_that_pictures_tell():
    found = calibrated_detector(CameraParams(), pairs=10, seed=1)
    assert VisionParams().corner_shift == pytest.approx(found.corner_shift.value, abs=0.03)
    assert VisionParams().edge_shift == pytest.approx(found.edge_shift.value, abs=0.03)
