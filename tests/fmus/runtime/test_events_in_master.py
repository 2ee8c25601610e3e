"""Units with events of their own, and clocked ones, in this project's master."""

import math
from fractions import Fraction

import pytest
from support.fmus.workshop import Workshop

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

G, E, RELEASE = 9.81, 0.7, 0.25
ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]


def impact_times(n: int) -> list[float]:
    """A fall of sqrt(2 h / g) from the release on, then flights of 2 e^k v / g; h = 1 m."""
    fall = math.sqrt(2 / G)
    times = [RELEASE + fall]
    for k in range(1, n):
        times.append(times[-1] + 2 * E**k * fall)
    return times


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_ball_is_released_and_bounces_at_its_times(workshop: Workshop, algorithm: Algorithm):
    s = System()
    s.add("ball", workshop.fmu("bouncing_ball:BouncingBall", 3), period=Fraction(1, 10))
    rows: dict[float, tuple[float, float]] = {}

    def observe(t: float, y: Signals) -> None:
        rows[t] = float(y["ball.h"]), float(y["ball.impacts"])

    with Master(s, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(2), [observe])
    off_grid = [t for t in rows if t not in {k / 10 for k in range(21)}]
    assert off_grid == pytest.approx([RELEASE, *impact_times(3)], abs=1e-9)
    for t, (h, impacts) in rows.items():
        assert impacts == sum(t >= known - 1e-9 for known in impact_times(3))
        if RELEASE < t < impact_times(1)[0]:
            assert h == pytest.approx(1.0 - G * (t - RELEASE) ** 2 / 2, abs=1e-9)
    assert all(rows[t][0] == pytest.approx(0.0, abs=1e-9) for t in off_grid[1:])


def test_a_sampled_unit_gives_the_same_by_its_clock_as_by_itself(workshop: Workshop):
    """It ticks by itself where it is placed as sampled, and by the master's hand where it is not."""
    rows: dict[bool, list[tuple[float, ...]]] = {True: [], False: []}
    for sampled, seen in rows.items():
        s = System()
        fmu = workshop.fmu("sampled:Sampled", 3)
        source, unit = (s.add(n, fmu, period=Fraction(1, 30), sampled=sampled) for n in ("source", "unit"))
        s.connect(source.y.y, unit.u.u)

        def observe(t: float, y: Signals, seen: list[tuple[float, ...]] = seen) -> None:
            seen.append((t, *(float(y[f"unit.{name}"]) for name in ("y", "ticks", "t_seen"))))

        with Master(s) as master:
            master.run(Fraction(2), [observe])
    assert rows[True] == rows[False]
    assert rows[True][-1][2] == 61
