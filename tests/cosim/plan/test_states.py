"""A run may change between the compiled plan and the general path at any communication point."""

from fractions import Fraction

import pytest
from fmu_of import FmuOf
from native_units import native_fmu

from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.stepper import GridStepper, Stepper
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import System


def build(fmu: FmuOf) -> System:
    s = System()
    camera = s.add("camera", fmu("Counter"), period=Fraction(1, 30), sampled=True)
    eye = s.add("eye", fmu("Echo"), period=Fraction(1, 20), sampled=True)
    mass = s.add("mass", native_fmu("mass", 2), period=Fraction(1, 50), k=2.0)
    s.connect(camera.y.picture, eye.u.picture)
    s.connect(eye.y.brightness, mass.u.f, LinearTransformation(0.5))
    return s


def go(stepper: Stepper, points: int, last: int) -> None:
    for _ in range(points):
        stepper.arrive(last)
        stepper.depart()


@pytest.mark.parametrize("order", ["plan first", "plan second"])
def test_each_goes_on_from_the_others_state(fmu: FmuOf, order: str):
    with Master(build(fmu)) as whole:
        whole.run(Fraction(2))
        expected = [whole.signals[name].tobytes() for name in ("mass.x", "mass.v", "eye.brightness")]
    with Master(build(fmu)) as master:
        plan = master.stepper
        assert isinstance(plan, PlanStepper)
        general = GridStepper(master.schedule, plan.coupling)
        first, second = (plan, general) if order == "plan first" else (general, plan)
        last = master.schedule.ticks(Fraction(2))
        go(first, 37, last)
        first.arrive(last)
        second.set_state(first.get_state())
        assert second.get_state() == first.get_state()
        assert second.time == first.time
        while not second.arrive(last):
            second.depart()
        assert [master.signals[name].tobytes() for name in ("mass.x", "mass.v", "eye.brightness")] == expected


def test_the_time_of_the_last_good_step_is_handed_over(fmu: FmuOf):
    with Master(build(fmu)) as master:
        master.run(Fraction(1))
        master.stepper.get_state()
        assert master.ensemble.instances["mass"].time == pytest.approx(1.0)
