"""A ball bounces: its impacts are communication points of all units."""

import itertools
import math
from fractions import Fraction

import pytest
from native_units import native_fmu
from observed_rows import grid, observed_rows

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
