"""Systems with events and clocks, and signals of theirs."""

from fractions import Fraction

from handover.cosim.system.system import System
from support.cosim.native_units import native_fmu

BOUNCING = ("ball.h", "slow.x", "alarm.rings", "watch.changes")
COUNTING = ("fast.count", "slow.count", "thirds.count")


def bouncing() -> System:
    """At most times the slow unit is ahead; at an impact it is rolled back."""
    s = System()
    ball, slow = s.add("ball", native_fmu("ball")), s.add("slow", native_fmu("integrator"), period=Fraction(1, 2))
    alarm, watch = s.add("alarm", native_fmu("alarm"), delay=0.15), s.add("watch", native_fmu("watch"))
    s.connect(ball.y.v, slow.u.u)
    s.connect(ball.y.bounces, alarm.u.wish)
    s.connect(alarm.y.rings, watch.u.count_in)
    return s


def counting() -> System:
    """The tick of one clock lets another one tick."""
    s = System()
    fast, slow = s.add("fast", native_fmu("counter_tenths")), s.add("slow", native_fmu("counter_triggered"))
    thirds = s.add("thirds", native_fmu("counter_thirds"))
    s.connect(fast.y.carry, slow.u.tick)
    s.connect(slow.y.count, thirds.u.increment)
    return s
