"""Compares the defaults of declared parameters with the group of a `paper.toml` that gives their origins."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from handover.cosim.blocks.declarations import declared_variables
from handover.cosim.blocks.variable import Causality


def assert_every_default_has_its_origin(
    group: dict[str, dict[str, Any]], params: type[Any], apart: Iterable[str] = ("seed",)
) -> None:
    """The group has all parameters but those apart, with the code's values and units."""
    declared = {v.name: v for v in declared_variables(params, Causality.PARAMETER)}
    assert set(group) - set(apart) == set(declared) - set(apart)
    for name, entry in group.items():
        default: Any = getattr(params(), name)
        value = default.name.lower() if declared[name].items else default
        assert np.array_equal(value, entry["value"]), name
        assert entry["unit"] == declared[name].unit.symbol, name
