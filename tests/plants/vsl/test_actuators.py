"""Servos of the arm, and the lines that fill its links with air."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.plants.vsl.actuators import PressureLine, VslServo


def servo() -> VslServo:
    return VslServo(0.2, 4.0, 1.78, 0.06, 0.002)


@pytest.mark.parametrize(("speed", "travel"), [(0.0, 0.08), (1.0, 0.02), (-1.0, 0.02), (9.0, 0.08)])
def test_goes_to_its_command_at_the_given_speed_and_no_faster_than_it_can_and_stops_there(speed: float, travel: float):
    for way in (1.0, -1.0):
        motor = servo()
        motor.move(0.2 + way, speed, 0.02)
        assert motor.angle == pytest.approx(0.2 + way * travel)
        motor.move(0.2 + way, speed, 10.0)
        assert motor.angle == 0.2 + way


def test_current_is_torque_over_kt_within_friction_that_depends_on_the_way():
    motor = servo()
    assert motor.current(0.89) == pytest.approx(0.5)
    motor.slide(0.5)
    assert motor.current(0.89) == pytest.approx(0.95 / 1.78)
    motor.slide(0.4)
    assert motor.current(0.89) == pytest.approx(0.83 / 1.78)


def test_friction_sticks_until_the_gear_slides():
    motor = servo()
    motor.slide(0.5)
    motor.slide(0.5)
    assert motor.current(0.0) == pytest.approx(0.06 / 1.78)
    motor.slide(0.499)
    assert motor.current(0.0) == pytest.approx(0.0, abs=1e-12)
    motor.slide(0.4985)
    assert motor.current(0.0) == pytest.approx(-0.03 / 1.78)
    motor.rest(0.1)
    assert motor.current(0.0) == 0.0


def test_a_servo_continues_from_a_state():
    one, other = servo(), servo()
    one.move(1.0, 0.5, 0.3)
    one.slide(0.3505)
    other.restore(one.snapshot())
    assert (other.angle, other.current(0.1)) == (one.angle, one.current(0.1))
    one.slide(0.35)
    other.slide(0.35)
    assert other.current(0.1) == one.current(0.1)


def line(p: float, leak_time: float = 600.0) -> PressureLine:
    return PressureLine(p, 0.25, leak_time, 500.0, 2000.0)


def test_the_regulator_nears_the_command_exponentially():
    air = line(0.0)
    air.advance(0.1, 2e5)
    assert air.open
    assert air.p == pytest.approx(2e5 * (1.0 - math.exp(-0.1 / 0.25)))


@pytest.mark.parametrize("p", [0.5e5, 2.5e5])
def test_the_valve_closes_when_the_pressure_is_reached_from_either_side(p: float):
    air = line(p, leak_time=1e9)
    until = 0.25 * math.log(abs(p - 1.5e5) / 500.0)
    air.advance(until - 1e-6, 1.5e5)
    assert air.open
    air.advance(2e-6, 1.5e5)
    assert not air.open
    assert abs(air.p - 1.5e5) == pytest.approx(500.0, rel=1e-4)


def test_a_closed_line_leaks_slowly_and_is_filled_up_again():
    air = line(1e5)
    air.advance(5.0, 1e5)
    assert air.p == pytest.approx(1e5 * math.exp(-5.0 / 600.0))
    assert not air.open
    air.advance(600.0 * math.log(1e5 / 0.98e5) - 5.0 + 1e-3, 1e5)
    assert air.open
    air.advance(1.0, 1e5)
    assert 0.99e5 < air.p < 1e5


def test_a_closed_line_exactly_at_the_edge_of_its_band_opens_at_once():
    edge, before = line(0.98e5), line(0.98e5 + 1e-6)
    for air in (edge, before):
        air.advance(0.1, 1e5)
        assert air.open
    assert edge.p == pytest.approx(before.p, abs=1e-3)


def test_small_changes_of_the_command_do_not_move_the_valve():
    air = line(1e5, leak_time=1e9)
    air.advance(1.0, 1.015e5)
    assert air.p == pytest.approx(1e5, rel=1e-6)
    air.advance(2.0, 1.025e5)
    assert abs(air.p - 1.025e5) <= 500.1


@given(
    start=st.floats(0.0, 3e5),
    commands=st.lists(st.floats(0.0, 3e5), min_size=1, max_size=4),
    times=st.lists(st.floats(0.01, 200.0), min_size=4, max_size=4),
)
def test_the_course_does_not_depend_on_the_steps(start: float, commands: list[float], times: list[float]):
    coarse, fine = line(start), line(start)
    for command, time in zip(commands, times, strict=False):
        coarse.advance(time, command)
        for _ in range(7):
            fine.advance(time / 7.0, command)
        assert 0.0 <= coarse.p <= 3e5 + 500.0
        assert fine.p == pytest.approx(coarse.p, abs=1e-3)
    coarse.advance(60.0, commands[0])
    assert abs(coarse.p - commands[0]) <= 2000.0 * (1.0 + 1e-9)


def test_a_line_continues_from_a_state():
    for seconds in (0.05, 3.0):
        one, other = line(0.0), line(1e5)
        one.advance(seconds, 2e5)
        other.restore(one.snapshot())
        for air in (one, other):
            air.advance(20.0, 1.7e5)
        assert one.snapshot() == other.snapshot()
