"""Events and clocks: a ball's impacts and ticks are communication points of all units, at which they iterate."""

import math
from fractions import Fraction
from typing import Any

import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import grid, observed_rows
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.cosim.fmu.failures import UnsettledEvents
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]
G, E = 9.81, 0.7
TENTH = Fraction(1, 10)


def impact_times(n: int) -> list[float]:
    """The first after sqrt(2 h_0 / g); then 2 v_k / g between them, with v_k = e^k sqrt(2 g h_0); h_0 = 1 m."""
    times, v = [math.sqrt(2 / G)], math.sqrt(2 * G)
    for _ in range(n - 1):
        v *= E
        times.append(times[-1] + 2 * v / G)
    return times


def height(t: float) -> float:
    """The height in closed form, up to the fifth impact."""
    times, v = impact_times(5), math.sqrt(2 * G)
    k = sum(t >= known for known in times)
    if k == 0:
        return 1.0 - G * t * t / 2
    since = t - times[k - 1]
    return E**k * v * since - G * since * since / 2


@pytest.mark.parametrize("announces", [False, True])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_impacts_are_communication_points(algorithm: Algorithm, announces: bool):
    s = System()
    s.add("ball", native_fmu("ball"), period=TENTH, announces=announces)
    rows = observed_rows(s, Fraction(2), "ball.h", "ball.bounces", options=MasterOptions(algorithm=algorithm))
    off_grid = [t for t in rows if t not in grid(10, 2)]
    assert off_grid == pytest.approx(impact_times(4), abs=1e-12)
    assert set(rows) >= set(grid(10, 2))
    for t, (h, bounces) in rows.items():
        assert h == pytest.approx(height(t), abs=1e-11), t
        assert bounces == sum(t >= known - 1e-12 for known in impact_times(4)), t


@pytest.mark.parametrize(
    ("algorithm", "period", "announces", "states"),
    [
        pytest.param(Algorithm.JACOBI, TENTH, False, True, id="rolled back"),
        pytest.param(Algorithm.GAUSS_SEIDEL, TENTH, False, True, id="rolled back, gauss-seidel"),
        pytest.param(Algorithm.JACOBI, Fraction(1, 2), False, True, id="rolled back in a slow step"),
        pytest.param(Algorithm.JACOBI, TENTH, True, False, id="waits for what is announced"),
    ],
)
def test_another_unit_is_brought_to_the_impact_and_keeps_its_rate(
    algorithm: Algorithm, period: Fraction, announces: bool, states: bool
):
    """The integral of the speed, held over each step, is a sum over the integrator's points, the impact among them.

    With Gauss-Seidel the ball goes first, and what it has at a step's end is held; at the impact, what it had before.
    """
    s = System()
    ball = s.add("ball", native_fmu("ball"), period=TENTH, announces=announces)
    flags = {} if states else {"canGetAndSetFMUState": False, "canSerializeFMUState": False}
    integral = s.add("integral", native_fmu("integrator", **flags), period=period)
    s.connect(ball.y.v, integral.u.u)
    rows = observed_rows(s, Fraction(1), "ball.v", "integral.x", options=MasterOptions(algorithm=algorithm))
    (impact,) = (t for t in rows if t not in grid(10))
    assert impact == pytest.approx(impact_times(1)[0], abs=1e-12)
    assert rows[impact][0] == pytest.approx(E * math.sqrt(2 * G), abs=1e-10)
    begin, x = 0.0, 0.0
    for t, (v, found) in rows.items():
        if t in (impact, *(float(period * k) for k in range(1, 11))):
            newest = -math.sqrt(2 * G) if t == impact else v
            x += (rows[begin][0] if algorithm is Algorithm.JACOBI else newest) * (t - begin)
            begin = t
        assert found == pytest.approx(x, abs=1e-11), t


def test_a_unit_in_event_mode_sees_the_impact_at_its_time():
    s = System()
    ball, watch = s.add("ball", native_fmu("ball"), period=TENTH), s.add("watch", native_fmu("watch"), period=TENTH)
    s.connect(ball.y.bounces, watch.u.count_in)
    rows = observed_rows(s, Fraction(1), "watch.count", "watch.changed", "ball.bounces", "watch.changes")
    first, second = impact_times(2)[0], impact_times(2)[1]
    for t, (count, changed, bounces, changes) in rows.items():
        assert count == bounces == changes
        known = 0.0 if t < first - 1e-9 else first if t < second - 1e-9 else second
        assert changed == pytest.approx(known, abs=1e-12)


def test_a_unit_that_cannot_roll_back_stays_at_the_end_of_its_step(caplog: pytest.LogCaptureFixture):
    s = System()
    s.add("ball", native_fmu("ball"), period=TENTH)
    s.add("fixed", native_fmu("fixed_step"), period=TENTH)
    rows = observed_rows(s, Fraction(2), "ball.h", "fixed.y")
    assert len(rows) == 25
    output = [r.message for r in caplog.records if "fixed" in r.message]
    assert output == ["fixed cannot roll back to the event at t = 0.451523641 s: it stays at the end of its step"]
    assert rows[2.0][1] == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("algorithm", "start"), [(Algorithm.JACOBI, Fraction(1, 3)), (Algorithm.GAUSS_SEIDEL, Fraction(0))]
)
def test_counters_at_three_rates_count_exactly_from_the_start_on(algorithm: Algorithm, start: Fraction):
    rates = {"tenths": 10, "quarters": 4, "thirds": 3}
    s = System()
    for name in rates:
        s.add(name, native_fmu(f"counter_{name}"), period=Fraction(1))
    s.start = start
    names = [f"{name}.count" for name in rates]
    rows = observed_rows(s, start + 8, *names, options=MasterOptions(algorithm=algorithm))
    ticks = {rate: [float(start + Fraction(k, rate)) for k in range(8 * rate + 1)] for rate in rates.values()}
    assert list(rows) == sorted({t for times in ticks.values() for t in times})
    for i, rate in enumerate(rates.values()):
        assert [rows[t][i] for t in ticks[rate]] == [k + 1 for k in range(8 * rate + 1)]


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


def test_an_output_clock_lets_another_tick_and_an_output_be_reached():
    s = System()
    fast, slow = s.add("fast", native_fmu("counter_tenths"), every=3), s.add("slow", native_fmu("counter_triggered"))
    s.connect(fast.y.carry, slow.u.tick)
    rows = observed_rows(s, Fraction(2), "fast.count", "slow.count", "fast.carried")
    assert all(row == (row[0], row[0] // 3, row[0] // 3) for row in rows.values())
    assert rows[2.0] == (21, 7, 7)


def test_ticks_go_through_a_chain_at_one_instant():
    s = System()
    a = s.add("a", native_fmu("counter_tenths"), every=2)
    b, c = s.add("b", native_fmu("counter_triggered"), every=2), s.add("c", native_fmu("counter_triggered"))
    s.connect(b.y.carry, c.u.tick)
    s.connect(a.y.carry, b.u.tick)
    rows = observed_rows(s, Fraction(1), "a.count", "b.count", "c.count")
    assert all(row == (row[0], row[0] // 2, row[0] // 4) for row in rows.values())
    assert rows[1.0] == (11, 5, 2)


@pytest.mark.parametrize(("box", "isolated"), [("letter_box", ()), ("letter_box_tenths", ()), ("letter_box", ("all",))])
def test_a_message_arrives_at_each_tick_also_where_it_is_the_same_again(box: str, isolated: tuple[str, ...]):
    s = System()
    sender, receiver = s.add("sender", native_fmu("sender")), s.add("box", native_fmu(box))
    s.connect(sender.y.letter, receiver.u.letter)
    if box == "letter_box":
        s.connect(sender.y.sent, receiver.u.tick)
    rows = observed_rows(s, Fraction(1), "box.received", options=MasterOptions(isolated=isolated))
    assert {t: row[0] for t, row in rows.items()} == {k / 10: k + 1 for k in range(11)}


@pytest.mark.parametrize(
    ("unit", "start", "ticks"),
    [
        ("metronome", {"beat": 0.3}, [3 * k / 10 for k in range(11)]),
        ("pulses", {}, [k * (k + 1) / 20 for k in range(1, 8)]),
    ],
)
def test_a_clock_of_parameters_or_one_that_changes_has_its_intervals(
    unit: str, start: dict[str, Any], ticks: list[float]
):
    s = System()
    s.add("unit", native_fmu(unit), period=Fraction(1), **start)
    rows = observed_rows(s, Fraction(3), "unit.count")
    assert list(rows) == pytest.approx(sorted({*ticks, 0.0, 1.0, 2.0, 3.0}), abs=1e-15)
    assert all(count == sum(tick <= t + 1e-12 for tick in ticks) for t, (count,) in rows.items())


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


def followers(most: int) -> System:
    """Two units in a ring, each of which gives one more than it gets, up to a limit."""
    s = System()
    a, b = s.add("a", native_fmu("follower"), most=most), s.add("b", native_fmu("follower"), most=most)
    s.connect(a.y.count, b.u.count_in)
    s.connect(b.y.count, a.u.count_in)
    return s


@pytest.mark.parametrize("most", [7, 50])
def test_an_iteration_between_two_units_settles_at_one_instant(most: int):
    rows = observed_rows(followers(most), Fraction(1, 2), "a.count", "b.count")
    assert list(rows) == grid(10)[:6]
    assert set(rows.values()) == {(most, most)}


def alone(unit: str, **start: Any) -> System:
    s = System()
    s.add(unit, native_fmu(unit), **start)
    s.add("other", native_fmu("integrator"), u=1.0)
    return s


@pytest.mark.parametrize("stalls", [0, 3])
def test_a_unit_may_return_at_once_some_times(stalls: int):
    rows = observed_rows(alone("staller", most=stalls), Fraction(1, 2), "staller.count", "other.x")
    assert list(rows) == grid(10)[:6]
    assert rows[0.5] == (stalls, pytest.approx(0.5))


@pytest.mark.parametrize(
    ("system", "units", "t"),
    [
        pytest.param(followers(10**6), ("a", "b"), 0.0, id="never settle"),
        pytest.param(alone("asker"), ("asker",), 0.1, id="ever more iterations"),
        pytest.param(alone("staller", most=10**6), ("staller",), 0.2, id="does not get on"),
    ],
)
def test_events_without_an_end_name_their_units(system: System, units: tuple[str, ...], t: float, wording: Wording):
    with pytest.raises(UnsettledEvents) as failure:
        observed_rows(system, Fraction(1))
    assert (set(failure.value.units), failure.value.t) == ({*units}, t)
    wording.check(failure.value)


def test_a_clock_that_cannot_tick_is_refused(wording: Wording):
    with pytest.raises(InitializationError) as refused:
        observed_rows(alone("metronome", beat=0.0), Fraction(1))
    wording.check(refused.value)
