"""Clocks tick at their times: on exact fractions, when another ticks, when a unit says."""

from fractions import Fraction

import pytest
from native_units import native_fmu
from observed_rows import observed_rows

from handover.cosim.exceptions import InitializationError
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]
TENTH = Fraction(1, 10)


@pytest.mark.parametrize("start", [Fraction(0), Fraction(1, 3)])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_counters_at_three_rates_count_exactly_from_the_start_on(algorithm: Algorithm, start: Fraction):
    rates = {"tenths": 10, "quarters": 4, "thirds": 3}
    s = System()
    for name in rates:
        s.add(name, native_fmu(f"counter_{name}"), period=Fraction(1))
    s.start = start
    names = [f"{name}.count" for name in rates]
    rows = observed_rows(s, start + 20, *names, options=MasterOptions(algorithm=algorithm))
    ticks = {rate: [float(start + Fraction(k, rate)) for k in range(20 * rate + 1)] for rate in rates.values()}
    assert list(rows) == sorted({t for times in ticks.values() for t in times})
    for i, rate in enumerate(rates.values()):
        assert [rows[t][i] for t in ticks[rate]] == [k + 1 for k in range(20 * rate + 1)]


def test_a_clocked_value_goes_from_tick_to_tick():
    """A counter counts by the count of another one, of the same tick where both tick, else of its last one."""
    s = System()
    tenths, quarters = s.add("tenths", native_fmu("counter_tenths")), s.add("quarters", native_fmu("counter_quarters"))
    s.connect(tenths.y.count, quarters.u.increment)
    rows = observed_rows(s, Fraction(1), "tenths.count", "quarters.count")
    total = 0
    for k, tenths_then in zip(range(5), (1, 3, 6, 8, 11), strict=True):
        total += tenths_then
        assert rows[k / 4] == (tenths_then, total)


def test_an_output_clock_lets_another_tick():
    s = System()
    fast, slow = s.add("fast", native_fmu("counter_tenths"), every=3), s.add("slow", native_fmu("counter_triggered"))
    s.connect(fast.y.carry, slow.u.tick)
    rows = observed_rows(s, Fraction(2), "fast.count", "slow.count")
    assert all(slow_count == fast_count // 3 for fast_count, slow_count in rows.values())
    assert rows[2.0] == (21, 7)


def test_an_output_is_reached_while_its_output_clock_ticks():
    s = System()
    s.add("fast", native_fmu("counter_tenths"), every=3)
    rows = observed_rows(s, Fraction(2), "fast.count", "fast.carried")
    assert all(carried == count // 3 for count, carried in rows.values())


def test_ticks_go_through_a_chain_at_one_instant():
    s = System()
    a, b, c = (
        s.add("a", native_fmu("counter_tenths"), every=2),
        s.add("b", native_fmu("counter_triggered"), every=2),
        s.add("c", native_fmu("counter_triggered")),
    )
    s.connect(b.y.carry, c.u.tick)
    s.connect(a.y.carry, b.u.tick)
    rows = observed_rows(s, Fraction(1), "a.count", "b.count", "c.count")
    assert all(row == (row[0], row[0] // 2, row[0] // 4) for row in rows.values())
    assert rows[1.0] == (11, 5, 2)


@pytest.mark.parametrize("box", ["letter_box", "letter_box_tenths"])
@pytest.mark.parametrize("options", [MasterOptions(), MasterOptions(isolated=("all",))], ids=["here", "isolated"])
def test_a_message_arrives_at_each_tick_also_where_it_is_the_same_again(box: str, options: MasterOptions):
    s = System()
    sender, receiver = s.add("sender", native_fmu("sender")), s.add("box", native_fmu(box))
    s.connect(sender.y.letter, receiver.u.letter)
    if box == "letter_box":
        s.connect(sender.y.sent, receiver.u.tick)
    rows = observed_rows(s, Fraction(1), "box.received", options=options)
    assert {t: row[0] for t, row in rows.items()} == {k / 10: k + 1 for k in range(11)}


def test_a_clock_of_parameters_has_its_interval():
    s = System()
    s.add("metronome", native_fmu("metronome"), period=Fraction(1), beat=0.3)
    rows = observed_rows(s, Fraction(3), "metronome.count")
    ticks = {3 * k / 10: k + 1 for k in range(11)}
    assert {t: row[0] for t, row in rows.items() if t not in (1.0, 2.0)} == ticks


def test_a_clock_that_cannot_tick_is_refused():
    s = System()
    s.add("metronome", native_fmu("metronome"), beat=0.0)
    with pytest.raises(InitializationError, match=r"metronome does not start: its clock 'tick' ticks every 0 s"):
        observed_rows(s, Fraction(1))


def test_a_changing_clock_gives_its_next_interval_at_each_tick():
    s = System()
    s.add("pulses", native_fmu("pulses"), period=Fraction(1))
    rows = observed_rows(s, Fraction(3), "pulses.count")
    ticks = [k * (k + 1) / 20 for k in range(1, 8)]
    off_grid = [t for t in rows if t not in (0.0, 2.0, 3.0)]
    assert off_grid == pytest.approx(ticks, abs=1e-15)
    assert all(row[0] == sum(tick <= t + 1e-12 for tick in ticks) for t, row in rows.items())


def test_a_countdown_begins_when_something_happens():
    """The alarm rings 0.15 s after its discrete input has changed."""
    s = System()
    ball, alarm = s.add("ball", native_fmu("ball"), period=TENTH), s.add("alarm", native_fmu("alarm"), delay=0.15)
    s.connect(ball.y.bounces, alarm.u.wish)
    rows = observed_rows(s, Fraction(1), "ball.bounces", "alarm.rings")
    impact = next(t for t, (bounces, _) in rows.items() if bounces == 1)
    rang = next(t for t, (_, rings) in rows.items() if rings == 1)
    assert rang == pytest.approx(impact + 0.15, abs=1e-15)
    assert all(rings == (t >= rang) for t, (_, rings) in rows.items() if t < impact + 0.6)
