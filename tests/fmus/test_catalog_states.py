"""Every catalogued unit goes on from a restored state as if it had never stopped, bit for bit."""

import dataclasses
import importlib
from typing import Any

import numpy as np
import pytest

from cosim.block import Description, Kind, Variable, describe
from fmus.catalog import UNITS

STEPS = 12
"""Steps before the state is taken, and after."""


def varied(v: Variable, rng: np.random.Generator) -> Any:
    """Return an input near its start value: a unit must take it, and its state must depend on it."""
    if v.kind is Kind.REAL:
        span = 0.02 if v.maximum is None or v.minimum is None else 0.02 * (v.maximum - v.minimum)
        moved = np.asarray(v.start) + rng.normal(0.0, span, v.shape)
        moved = np.clip(moved, v.minimum, v.maximum) if v.minimum is not None or v.maximum is not None else moved
        if v.name.startswith("q_") and v.shape == (4,):
            moved = moved / np.linalg.norm(moved)
        return moved if v.shape else float(moved)
    if v.kind is Kind.BOOLEAN:
        return bool(rng.integers(4) > 0)
    return v.start


def run(block: Any, d: Description, seed: int, first: int) -> list[dict[str, bytes]]:
    rng, step, seen = np.random.default_rng(seed), UNITS[d.name].step, list[dict[str, bytes]]()
    for k in range(first, first + STEPS):
        u = d.inputs_type(**{v.name: varied(v, rng) for v in d.inputs if v.kind is not Kind.BINARY})
        y = block.step(float(k * step), float(step), u)
        seen.append({f.name: np.asarray(getattr(y, f.name)).tobytes() for f in dataclasses.fields(y)})
    return seen


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_goes_on_from_a_restored_state_bit_for_bit(name: str):
    module, _, attribute = UNITS[name].block.partition(":")
    cls = getattr(importlib.import_module(module), attribute)
    d = describe(cls)
    one = cls(d.params_type())
    one.outputs(0.0, d.inputs_type())
    run(one, d, seed=1, first=0)
    state = one.get_state()
    after = run(one, d, seed=2, first=STEPS)
    one.set_state(state)
    assert run(one, d, seed=2, first=STEPS) == after
    other = cls(d.params_type())
    other.set_state(state)
    assert run(other, d, seed=2, first=STEPS) == after
