import pytest

from handover.plants.vsl.actuators import VslServo


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


def test_continues_from_a_state():
    one, other = servo(), servo()
    one.move(1.0, 0.5, 0.3)
    one.slide(0.3505)
    other.restore(one.snapshot())
    assert (other.angle, other.current(0.1)) == (one.angle, one.current(0.1))
    one.slide(0.35)
    other.slide(0.35)
    assert other.current(0.1) == one.current(0.1)
