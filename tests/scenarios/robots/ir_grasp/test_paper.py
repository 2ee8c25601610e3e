"""What the grasp's `paper.toml` gives agrees with itself."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli

import handover.scenarios.robots.ir_grasp
from handover.plants.ir_grasp.objects import SOLIDS

Paper = dict[str, dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def paper() -> Paper:
    file = Path(handover.scenarios.robots.ir_grasp.__file__).parent / "paper.toml"
    return tomli.loads(file.read_text(encoding="utf-8"))


def test_the_published_totals_are_the_sums_over_the_things(paper: Paper):
    published = paper["published"]
    rows = [published[thing.name.lower()]["value"] for thing in SOLIDS]
    assert np.sum(rows, axis=0).tolist() == published["total"]["value"]
