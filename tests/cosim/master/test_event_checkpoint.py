"""A run with events resumes from a checkpoint as if it had not stopped."""

import json
from collections.abc import Callable
from fractions import Fraction

import pytest
from native_units import native_fmu

from handover.cosim.master.checkpoint import Checkpoint, take_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

ALGORITHMS = [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL]
Row = tuple[float, ...]


def bouncing() -> tuple[System, tuple[str, ...]]:
    """At most times the slow unit is ahead; at an impact it is rolled back."""
    s = System()
    ball, slow = s.add("ball", native_fmu("ball")), s.add("slow", native_fmu("integrator"), period=Fraction(1, 2))
    alarm, watch = s.add("alarm", native_fmu("alarm"), delay=0.15), s.add("watch", native_fmu("watch"))
    s.connect(ball.y.v, slow.u.u)
    s.connect(ball.y.bounces, alarm.u.wish)
    s.connect(alarm.y.rings, watch.u.count_in)
    return s, ("ball.h", "slow.x", "alarm.rings", "watch.changes")


def counting() -> tuple[System, tuple[str, ...]]:
    s = System()
    fast, slow = s.add("fast", native_fmu("counter_tenths")), s.add("slow", native_fmu("counter_triggered"))
    thirds = s.add("thirds", native_fmu("counter_thirds"))
    s.connect(fast.y.carry, slow.u.tick)
    s.connect(slow.y.count, thirds.u.increment)
    return s, ("fast.count", "slow.count", "thirds.count")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("build", [bouncing, counting])
@pytest.mark.parametrize("at", [0.0, 0.3, 0.45, 0.62])
def test_a_run_goes_on_from_a_checkpoint(
    build: Callable[[], tuple[System, tuple[str, ...]]], at: float, algorithm: Algorithm
):
    options = MasterOptions(algorithm=algorithm)
    whole, taken = run(build, options, at)
    (checkpoint,) = taken[:1]
    system, names = build()
    rows: dict[float, Row] = {}
    with Master(system, options) as master:
        checkpoint.restore(master)
        master.run(Fraction(2), [lambda t, y: rows.update({t: row(y, names)})])
    assert rows == {t: values for t, values in whole.items() if t >= checkpoint.time}


def run(
    build: Callable[[], tuple[System, tuple[str, ...]]], options: MasterOptions, at: float
) -> tuple[dict[float, Row], list[Checkpoint]]:
    system, names = build()
    rows: dict[float, Row] = {}
    taken: list[Checkpoint] = []
    with Master(system, options) as master:

        def observe(t: float, y: Signals) -> None:
            rows[t] = row(y, names)
            if t >= at and not taken:
                taken.append(take_checkpoint(master, len(rows)))
                json.dumps(taken[0].stepper)

        master.run(Fraction(2), [observe])
    return rows, taken


def row(y: Signals, names: tuple[str, ...]) -> Row:
    return tuple(float(y[n]) for n in names)
