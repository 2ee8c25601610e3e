"""A block whose state is restored goes on as it would have, bit for bit, and asking it for outputs changes nothing."""

import copy
from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats


def flat(y: object) -> Floats:
    """Return all entries of outputs, one after the other."""
    return np.concatenate([np.ravel(np.asarray(value)) for value in vars(y).values()])


def assert_continues(
    make: Callable[[], Any], inputs: Callable[[int], Any], at: Sequence[int], steps: int, dt: float = 0.016
) -> None:
    """Assert that units go on from the states before some steps, a new one and one that was elsewhere in turn.

    Args:
        make: gives a unit as it starts.
        inputs: of a step, by its number.
        at: numbers of the steps before which states are kept.
        steps: for how many steps each is followed.
        dt: step size, s.
    """
    runner, states, path = make(), dict[int, bytes](), list[Floats]()
    runner.outputs(0.0, copy.deepcopy(inputs(0)))
    for n in range(max(at) + steps):
        if n in at:
            states[n] = runner.get_state()
        path.append(flat(runner.step(n * dt, dt, inputs(n))))
    for unit, (begin, state) in zip(cycle((make(), runner)), states.items(), strict=False):
        unit.set_state(state)
        rest = [flat(unit.step(n * dt, dt, inputs(n))) for n in range(begin, begin + steps)]
        np.testing.assert_array_equal(rest, path[begin : begin + steps])


def assert_passed_on(make: Callable[[], Any], inputs: Sequence[Any], every: int, dt: float) -> None:
    """Assert that a unit which hands its state to a new one after every so many steps is the same as one that stays."""
    stays, passed_on = make(), make()
    for n, u in enumerate(inputs):
        if n % every == 0:
            state, passed_on = passed_on.get_state(), make()
            passed_on.set_state(state)
        assert np.array_equal(flat(passed_on.step(n * dt, dt, u)), flat(stays.step(n * dt, dt, u)), equal_nan=True)
        assert passed_on.get_state() == stays.get_state()


def assert_outputs_change_nothing(make: Callable[[], Any], u: Any, dt: float = 0.016, *, same: bool = False) -> None:
    """Assert that outputs may be asked for at the start; with `same` they are those of the first step."""
    asked, other = make(), make()
    before = asked.get_state()
    y = flat(asked.outputs(0.0, u))
    np.testing.assert_array_equal(flat(asked.outputs(0.0, u)), y)
    first = flat(asked.step(0.0, dt, u))
    np.testing.assert_array_equal(flat(other.step(0.0, dt, u)), first)
    if same:
        np.testing.assert_array_equal(y, first)
        other.set_state(before)
        np.testing.assert_array_equal(flat(other.step(0.0, dt, u)), first)
