import pytest

from handover.cosim.blocks.schedule import InvalidSchedule, Schedule


def test_a_value_holds_from_its_time_on():
    schedule = Schedule.parse("1.5:0.05  3:0.1", (1,), 0.0, 1.0)
    assert [schedule.at(t) for t in (0.0, 1.499, 1.5, 2.99, 3.0, 1e6)] == [None, None, (0.05,), (0.05,), (0.1,), (0.1,)]


def test_a_time_is_met_by_the_sum_of_steps_that_comes_to_it():
    schedule = Schedule.parse("0.3:7", (1,), 0.0, 10.0)
    assert schedule.at(sum([0.1] * 3)) == schedule.at(0.3 - 1e-12) == (7.0,)


def test_values_may_be_several_numbers_and_a_text_empty():
    assert Schedule.parse("0:1 2:3,4", (1, 2), 0.0, 9.0).values == ((1.0,), (3.0, 4.0))
    assert Schedule.parse("  ", (1,), 0.0, 1.0).at(5.0) is None


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("1:0.1,0.2", r"'1:0\.1,0\.2' is not of the form TIME:VALUE, with a space between"),
        ("1:0.1;2:0.2", "is not of the form"),
        ("5", "'5' is not of the form"),
        ("a:1", "'a:1' is not of the form"),
        ("1:", "'1:' is not of the form"),
        ("2:0.1 1:0.2", "'1:0.2': times ascend from 0 s"),
        ("2:0.1 2:0.2", "'2:0.2': times ascend from 0 s, each later than the one before"),
        ("-1:0.1", "times ascend"),
        ("nan:0.1", "times ascend"),
        ("inf:0.1", "times ascend"),
        ("1:1.5", "'1:1.5': values are from 0 to 1"),
        ("1:nan", "values are from 0 to 1"),
    ],
)
def test_what_is_no_schedule_is_refused(text: str, fault: str):
    with pytest.raises(InvalidSchedule, match=fault):
        Schedule.parse(text, (1,), 0.0, 1.0)
