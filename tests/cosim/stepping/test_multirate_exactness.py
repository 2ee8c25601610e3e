"""Millions of steps at awkward periods: instants are where they should be, to the last bit."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import pytest
from native_units import native_fmu

from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.stepping.stepper import GridStepper
from handover.cosim.system.schedule import Schedule, Slot
from handover.cosim.system.system import System

THIRD, SEVENTH = Fraction(1, 3000), Fraction(1, 7000)


class Counting:
    """A coupling that counts how often each unit steps, and from when at last."""

    def __init__(self) -> None:
        self.steps: dict[str, int] = {}
        self.begins: dict[str, float] = {}
        self.count = IterationCount()

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None: ...

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        for slot in (*sampled, *continuous):
            self.steps[slot.unit] = self.steps.get(slot.unit, 0) + 1
            self.begins[slot.unit] = t

    def get_state(self) -> Mapping[str, Any]:
        return {}

    def set_state(self, state: Mapping[str, Any]) -> None: ...


def thirds_and_sevenths() -> Schedule:
    s = System()
    for name, period in (("third", THIRD), ("seventh", SEVENTH)):
        s.add(name, native_fmu("integrator"), period=period)
    return Schedule(s)


@pytest.mark.parametrize("first", [0, 10**7 - 21_000, 10**15])
def test_instants_are_exact_however_late(first: int):
    """Times are those, rounded once, of every tick that 7 (a third of 1 ms) or 3 (a seventh) divides."""
    schedule, last = thirds_and_sevenths(), first + 21_000
    assert schedule.tick == Fraction(1, 21_000)
    stepper = GridStepper(schedule, Counting())
    due = {"third": -(-first // 7) * 7, "seventh": -(-first // 3) * 3}
    stepper.set_state({"tick": first, "due": due, "acted": {}, "coupling": {}})
    times: list[float] = []
    while not stepper.arrive(last):
        times.append(stepper.time)
        stepper.depart()
    assert times == [float(Fraction(tick, 21_000)) for tick in range(first, last) if tick % 3 == 0 or tick % 7 == 0]


@pytest.mark.slow
def test_ten_million_ticks_counted_one_by_one():
    schedule, counting, last = thirds_and_sevenths(), Counting(), 10**7
    stepper = GridStepper(schedule, counting)
    while not stepper.arrive(last):
        stepper.depart()
    assert counting.steps == {"third": last // 7 + 1, "seventh": last // 3 + 1}
    assert counting.begins == {"third": float(last // 7 * THIRD), "seventh": float(last // 3 * SEVENTH)}
