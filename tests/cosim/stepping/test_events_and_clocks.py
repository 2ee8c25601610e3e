"""Events and clocks: a ball's impacts and ticks are communication points of all units, at which they iterate."""

import itertools
import math
from fractions import Fraction

import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import grid, observed_rows

from handover.cosim.exceptions import InitializationError
from handover.cosim.fmu.failures import UnsettledEvents
from handover.cosim.master.master import Master
from handover.cosim.stepping.event_iteration import MAX_ITERATIONS
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


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_another_unit_is_brought_to_the_impact(algorithm: Algorithm):
    """The integral of the speed, held over each step, is that of the recorded points: it knows each impact's time."""
    s = System()
    ball = s.add("ball", native_fmu("ball"), period=TENTH)
    integral = s.add("integral", native_fmu("integrator"), period=TENTH)
    s.connect(ball.y.v, integral.u.u)
    rows = observed_rows(s, Fraction(1), "ball.v", "integral.x", options=MasterOptions(algorithm=algorithm))
    times = list(rows)
    impact = impact_times(1)[0]
    at = min(range(len(times)), key=lambda i: abs(times[i] - impact))
    assert times[at] == pytest.approx(impact, abs=1e-12)
    held = rows[times[at]][0]
    assert held == pytest.approx(E * math.sqrt(2 * G), abs=1e-10)
    after = rows[times[at + 1]][1] - rows[times[at]][1]
    lead = 0 if algorithm is Algorithm.JACOBI else 1  # Gauss-Seidel: the ball goes first
    speed = rows[times[at + lead]][0]
    assert after == pytest.approx(speed * (times[at + 1] - times[at]), abs=1e-12)
    assert integral_of(rows, lead, at) == pytest.approx(rows[times[at]][1], abs=1e-12)


def integral_of(rows: dict[float, tuple[float, ...]], lead: int, end: int) -> float:
    """The sum over the steps up to the impact; in the last one Gauss-Seidel knows the speed before the impact."""
    times = list(rows)
    before = [rows[t][0] for t in times]
    before[end] = -math.sqrt(2 * G)
    return sum(before[i + lead] * (times[i + 1] - times[i]) for i in range(end))


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


def test_a_unit_that_varies_its_step_waits_for_an_impact_that_is_known():
    """It need not be able to go back."""
    s = System()
    ball = s.add("ball", native_fmu("ball"), period=TENTH, announces=True)
    integral = s.add("integral", native_fmu("integrator", canGetAndSetFMUState=False, canSerializeFMUState=False))
    s.connect(ball.y.v, integral.u.u)
    rows = observed_rows(s, Fraction(1), "ball.v", "integral.x", options=MasterOptions(algorithm=Algorithm.JACOBI))
    times = list(rows)
    steps = itertools.pairwise(times)
    expected = [0.0]
    for begin, end in steps:
        expected.append(expected[-1] + rows[begin][0] * (end - begin))
    assert len(times) == 12
    assert [x for _, x in rows.values()] == pytest.approx(expected, abs=1e-12)


def test_each_unit_keeps_its_rate():
    """A slow unit that is ahead when the ball bounces is rolled back to the impact, then finishes its step."""
    s = System()
    ball = s.add("ball", native_fmu("ball"), period=Fraction(1, 20))
    slow = s.add("slow", native_fmu("integrator"), period=Fraction(1, 2))
    s.connect(ball.y.v, slow.u.u)
    rows = observed_rows(s, Fraction(1), "ball.v", "slow.x", options=MasterOptions(algorithm=Algorithm.JACOBI))
    (impact,) = (t for t in rows if t not in grid(20))
    assert impact == pytest.approx(impact_times(1)[0], abs=1e-12)
    assert [t for t in rows if t < impact and rows[t][1] != 0.0] == []
    assert rows[0.5][1] == pytest.approx(rows[impact][0] * (0.5 - impact), abs=1e-12)
    assert rows[1.0][1] == pytest.approx(rows[0.5][1] + rows[0.5][0] * 0.5, abs=1e-12)


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


def followers(most: int) -> System:
    """Two units in a ring, each of which gives one more than it gets, up to a limit."""
    s = System()
    a, b = s.add("a", native_fmu("follower"), most=most), s.add("b", native_fmu("follower"), most=most)
    s.connect(a.y.count, b.u.count_in)
    s.connect(b.y.count, a.u.count_in)
    return s


@pytest.mark.parametrize("most", [1, 7, 50])
def test_an_iteration_between_two_units_settles_at_one_instant(most: int):
    rows = observed_rows(followers(most), Fraction(1, 2), "a.count", "b.count")
    assert list(rows) == grid(10)[:6]
    assert set(rows.values()) == {(most, most)}


def test_units_that_never_settle_are_named():
    with pytest.raises(UnsettledEvents) as failure:
        observed_rows(followers(10**6), Fraction(1), "a.count")
    assert set(failure.value.units) <= {"a", "b"}
    assert failure.value.t == 0.0
    assert f"no end of events after {MAX_ITERATIONS} iterations; these do not settle: a, b" in str(failure.value)


def test_a_unit_that_wants_ever_more_iterations_is_named():
    s = System()
    s.add("quiet", native_fmu("watch"))
    s.add("asker", native_fmu("asker"))
    with pytest.raises(
        UnsettledEvents, match=r"asker: fmi3UpdateDiscreteStates at t = 0.1 s answered no end"
    ) as failure:
        observed_rows(s, Fraction(1), "asker.count")
    assert failure.value.units == ("asker",)


@pytest.mark.parametrize(("stalls", "points"), [(0, 6), (3, 6)])
def test_a_unit_may_return_at_once_some_times(stalls: int, points: int):
    s = System()
    s.add("staller", native_fmu("staller"), most=stalls)
    s.add("other", native_fmu("integrator"), u=1.0)
    rows = observed_rows(s, Fraction(1, 2), "staller.count", "other.x")
    assert list(rows) == grid(10)[:points]
    assert rows[0.5] == (stalls, pytest.approx(0.5))


def test_a_unit_that_does_not_get_on_is_named():
    s = System()
    s.add("staller", native_fmu("staller"), most=10**6)
    with pytest.raises(UnsettledEvents, match=r"staller: fmi3DoStep at t = 0.2 s answered no end of events after"):
        observed_rows(s, Fraction(1, 2), "staller.count")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_may_end_the_simulation(fmi: int):
    s = System()
    s.add("quitter", native_fmu("quitter", fmi))
    times: list[float] = []
    with Master(s) as master:
        master.run(Fraction(1), [lambda t, _: times.append(t)])
        assert master.ended is not None
        told = str(master.ended)
    assert told == f"quitter: fmi{fmi}DoStep at t = 0.2 s asked to end the simulation"
    assert times == [0.0, 0.1, 0.2, pytest.approx(0.3)]
