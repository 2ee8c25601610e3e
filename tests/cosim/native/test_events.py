"""The native test units with events and clocks, as FMPy sees them."""

import math

import pytest
from driven_unit import Started


def test_a_ball_returns_early_and_bounces(started: Started) -> None:
    unit = started("ball", 3, event_mode=True)
    impact = math.sqrt(2 / 9.81)
    unit.fmu.updateDiscreteStates()
    unit.fmu.enterStepMode()
    event, terminate, early, last = unit.step(0.0, 1.0)
    assert (event, terminate, early) == (True, False, True)
    assert last == pytest.approx(impact)
    unit.fmu.enterEventMode()
    unit.fmu.updateDiscreteStates()
    assert unit["v"] == pytest.approx(0.7 * 9.81 * impact)


def test_a_ball_announces_its_impact(started: Started) -> None:
    unit = started("ball", 3, event_mode=True)
    assert not unit.fmu.updateDiscreteStates()[4]
    unit.fmu.reset()
    unit.fmu.setBoolean(unit.references("announces"), [True])
    unit.fmu.enterInitializationMode()
    unit.fmu.exitInitializationMode()
    *_, defined, when = unit.fmu.updateDiscreteStates()
    assert (defined, when) == (True, pytest.approx(math.sqrt(2 / 9.81)))


def test_a_ball_without_event_mode_bounces_within_its_step(started: Started) -> None:
    unit = started("ball", 2)
    unit.step(0.0, 0.6)
    assert unit.fmu.getInteger(unit.references("bounces")) == [1]
    assert unit["v"] > 0


def test_a_counter_counts_and_carries(started: Started) -> None:
    unit = started("counter_tenths", 3, event_mode=True)
    counts: list[tuple[int, bool]] = []
    for _ in range(3):
        unit.fmu.setClock(unit.references("tick"), [True])
        counts.append((unit.fmu.getInt32(unit.references("count"))[0], unit.fmu.getClock(unit.references("carry"))[0]))
        unit.fmu.updateDiscreteStates()
    assert counts == [(1, False), (2, True), (3, False)]
    assert unit.fmu.getClock(unit.references("tick")) == [False]
