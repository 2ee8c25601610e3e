"""The defaults of the grasp's code are the values whose origins its `paper.toml` gives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli
from support.scenarios.parameter_origins import assert_every_default_has_its_origin

import handover.scenarios.ir_grasp
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.plants.ir_grasp.objects import SOLIDS
from handover.plants.ir_grasp.parameters import Params as SceneParams
from handover.scenarios.ir_grasp.ir_sensor import SensorParameters
from handover.scenarios.ir_grasp.parameters import Parameters

Paper = dict[str, dict[str, dict[str, Any]]]

CODE = {"scene": SceneParams, "reflex": ReflexParams, "scenario": Parameters, "sensor_scenario": SensorParameters}


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.ir_grasp.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("group", CODE)
def test_every_default_has_its_origin(paper: Paper, group: str):
    assert_every_default_has_its_origin(paper[group], CODE[group])


def test_the_published_totals_are_the_sums_over_the_things(paper: Paper):
    published = paper["published"]
    rows = [published[thing.name.lower()]["value"] for thing in SOLIDS]
    assert np.sum(rows, axis=0).tolist() == published["total"]["value"]
