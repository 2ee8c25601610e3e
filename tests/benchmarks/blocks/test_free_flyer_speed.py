"""CPU time of a step of 16 ms of the free-flyer's plants.

Run with `pytest tests/benchmarks/blocks/test_free_flyer_speed.py --benchmark-enable -s`.
"""

import itertools
import time
from collections.abc import Callable

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.plants.free_flyer.hand.hand_and_object import HandAndObject, Holder, Motion, StartHolder
from handover.plants.free_flyer.hand.hand_and_object import Inputs as HandInputs
from handover.plants.free_flyer.hand.hand_and_object import Params as HandParams
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer
from handover.plants.free_flyer.robot.free_flyer import Inputs as FlyerInputs
from handover.plants.free_flyer.robot.free_flyer import Params as FlyerParams
from handover.plants.free_flyer.robot.navigation import Inputs as NavigationInputs
from handover.plants.free_flyer.robot.navigation import Navigation
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.plants.free_flyer.robot.push import Inputs as PushInputs
from handover.plants.free_flyer.robot.push import Params as PushParams
from handover.plants.free_flyer.robot.push import Push
from handover.plants.free_flyer.robot.thrusters import Inputs as ThrusterInputs
from handover.plants.free_flyer.robot.thrusters import Params as ThrusterParams
from handover.plants.free_flyer.robot.thrusters import Thrusters

DT = 0.016
GRIPPED = HandParams(motion=Motion.NONE, p_WO_0=np.zeros(3))
TAKEN = HandParams(motion=Motion.TAKE, p_WO_0=np.zeros(3), pull_distance=0.005, patience=1e4)


def flyer() -> Callable[[], object]:
    robot, small = FreeFlyer(FlyerParams()), np.full(3, 1e-3)
    u = FlyerInputs(f_B=small, tau_B=0.01 * small, f_G=small, tau_G=0.01 * small)
    return lambda: robot.step(0.0, DT, u)


def thrusters(delay: float) -> Callable[[], object]:
    unit, u = Thrusters(ThrusterParams(delay=delay)), ThrusterInputs(f_pose=np.ones(3))
    return lambda: unit.step(0.0, DT, u)


def navigation(params: NavigationParams) -> Callable[[], object]:
    unit, u = Navigation(params), NavigationInputs()
    steps = itertools.count()
    return lambda: unit.step(DT * next(steps), DT, u)


def push() -> Callable[[], object]:
    unit, u = Push(PushParams()), PushInputs()
    return lambda: unit.step(0.0, DT, u)


def hand(params: HandParams, holder: Holder) -> Callable[[], object]:
    unit = HandAndObject(params)
    closure = 1.0 if holder in (Holder.GRIPPER, Holder.BOTH) else 0.0
    for i in range(400):
        y = unit.step(DT * i, DT, HandInputs(closure=closure, light=i > 100))
        if i == 399:
            assert y.holder is holder
    u = HandInputs(closure=closure)
    return lambda: unit.step(0.0, DT, u)


CASES: dict[str, Callable[[], Callable[[], object]]] = {
    "FreeFlyer": flyer,
    "Navigation": lambda: navigation(NavigationParams()),
    "Navigation, delayed": lambda: navigation(NavigationParams(delay=0.025)),
    "Thrusters": lambda: thrusters(0.0),
    "Thrusters, delayed": lambda: thrusters(0.025),
    "Push": push,
    "HandAndObject, free": lambda: hand(HandParams(motion=Motion.NONE), Holder.FREE),
    "HandAndObject, gripper": lambda: hand(GRIPPED, Holder.GRIPPER),
    "HandAndObject, hand": lambda: hand(HandParams(motion=Motion.NONE, object_with=StartHolder.HAND), Holder.HAND),
    "HandAndObject, both": lambda: hand(TAKEN, Holder.BOTH),
}


@pytest.mark.parametrize("name", CASES)
def test_step(benchmark: BenchmarkFixture, name: str):
    step, times = CASES[name](), list[float]()

    def hundred() -> None:
        begin = time.process_time()
        for _ in range(100):
            step()
        times.append(1e4 * (time.process_time() - begin))

    benchmark.pedantic(hundred, rounds=60, warmup_rounds=2)
    median, least = float(np.median(times)), float(np.min(times))
    print(f"\n{name}: median {median:.1f} us, least {least:.1f} us of CPU a step")
    benchmark.extra_info.update(median_us=median, least_us=least)
