"""The CPU time of an isolated unit's steps is that of its own process, too."""

from fractions import Fraction

import pytest
from native_units import native_fmu

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

STEPS = 10
WAYS = [(algorithm, compiled) for algorithm in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL) for compiled in (False, True)]


def cpu_seconds(fmi: int, isolated: tuple[str, ...], algorithm: Algorithm, compiled: bool) -> dict[str, float]:
    """Return the CPU time of a heavy unit's steps and of a light one's that it feeds."""
    system = System()
    heavy = system.add("heavy", native_fmu("heavy", fmi), work=500)
    light = system.add("light", native_fmu("heavy", fmi), work=0)
    system.connect(heavy.y.y, light.u.u)
    options = MasterOptions(algorithm=algorithm, compiled=compiled, isolated=isolated, cpu_times=True)
    with Master(system, options) as master:
        master.run(Fraction(STEPS, 10))
        cpu = master.cpu
        assert {name: len(spent) for name, spent in cpu.items()} == dict.fromkeys(("heavy", "light"), STEPS)
        return {name: sum(spent) for name, spent in cpu.items()}


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("algorithm", "compiled"), WAYS)
def test_cpu_time_of_an_isolated_unit_counts(fmi: int, algorithm: Algorithm, compiled: bool):
    here = cpu_seconds(fmi, (), algorithm, compiled)
    alone = cpu_seconds(fmi, ("all",), algorithm, compiled)
    assert here["heavy"] > 0.01
    assert 0.4 * here["heavy"] < alone["heavy"] < 2.5 * here["heavy"]
    assert alone["light"] < 0.2 * alone["heavy"]


def test_the_same_where_steps_may_end_anywhere():
    options = MasterOptions(isolated=("heavy",), cpu_times=True, repeat_discarded=True)
    system = System()
    system.add("heavy", native_fmu("heavy"), work=500)
    with Master(system, options) as master:
        master.run(Fraction(STEPS, 10))
        assert sum(master.cpu["heavy"]) > 0.01
