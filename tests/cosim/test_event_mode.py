"""A ball bounces: its impacts are communication points."""

import math
from fractions import Fraction

import pytest
from native_units import native_fmu

from cosim.master import Master
from cosim.master_options import Algorithm, MasterOptions
from cosim.signals import Signals
from cosim.system import System

G, E = 9.81, 0.7


def impact_times(n: int, h_0: float = 1.0) -> list[float]:
    """The first after sqrt(2 h_0 / g); then 2 v_k / g between them, with v_k = e^k sqrt(2 g h_0)."""
    times, v = [math.sqrt(2 * h_0 / G)], math.sqrt(2 * G * h_0)
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


def observed(system: System, stop: Fraction, algorithm: Algorithm, *names: str) -> dict[float, tuple[float, ...]]:
    seen: dict[float, tuple[float, ...]] = {}

    def observe(t: float, y: Signals) -> None:
        assert t not in seen
        seen[t] = tuple(float(y[n]) for n in names)

    with Master(system, MasterOptions(algorithm=algorithm)) as master:
        master.run(stop, [observe])
    assert list(seen) == sorted(seen)
    return seen


@pytest.mark.parametrize("announces", [False, True])
@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_impacts_are_communication_points(algorithm: Algorithm, announces: bool):
    s = System()
    s.add("ball", native_fmu("ball"), period=Fraction(1, 10), announces=announces)
    seen = observed(s, Fraction(2), algorithm, "ball.h", "ball.bounces")
    off_grid = [t for t in seen if t not in {k / 10 for k in range(21)}]
    assert off_grid == pytest.approx(impact_times(5)[: len(off_grid)], abs=1e-12)
    assert len(off_grid) == 4
    assert set(seen) >= {k / 10 for k in range(21)}
    for t, (h, bounces) in seen.items():
        assert h == pytest.approx(height(t), abs=1e-11), t
        assert bounces == sum(t >= known - 1e-12 for known in impact_times(5)), t
