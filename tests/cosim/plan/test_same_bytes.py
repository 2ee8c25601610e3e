"""A compiled plan gives the bytes of the general path, whatever flows between units, and however they are timed."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.both_paths import PLAIN, expect_alike
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.buffers import SignalBuffer
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.options import Algorithm
from handover.cosim.stepping.stepper import GridStepper, Stepper
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import System

SECOND = Fraction(1)
JACOBI, GAUSS_SEIDEL = PLAIN


def two_masses(fmi: tuple[int, int], *, slower: int = 1, step: Fraction = Fraction(1, 64)) -> System:
    """Two masses and the spring between them; the second mass steps less often."""
    s = System()
    first = s.add("first", native_fmu("mass", fmi[0]), period=step, k=10.0, x0=1.0)
    second = s.add("second", native_fmu("mass", fmi[1]), period=step * slower, m=2.0, k=3.0)
    spring = s.add("spring", native_fmu("spring", fmi[1]), period=step, k=5.0, d=0.5)
    for mass, i in ((first, 1), (second, 2)):
        s.connect(mass.y.x, getattr(spring.u, f"x{i}"))
        s.connect(mass.y.v, getattr(spring.u, f"v{i}"))
        s.connect(getattr(spring.y, f"f{i}"), mass.u.f)
    return s


@pytest.mark.parametrize(
    ("build", "stops", "algorithm"),
    [
        pytest.param(lambda: two_masses((2, 2)), [SECOND], GAUSS_SEIDEL, id="fmi 2"),
        pytest.param(lambda: two_masses((2, 3), slower=7, step=Fraction(1, 300)), [SECOND], JACOBI, id="several rates"),
        pytest.param(lambda: two_masses((3, 3), step=Fraction(3, 10)), [SECOND], JACOBI, id="a stop between points"),
        pytest.param(
            lambda: two_masses((2, 3), slower=3), [SECOND, SECOND, Fraction(3, 2), 2 * SECOND], GAUSS_SEIDEL,
            id="several runs and rates",
        ),
    ],
)  # fmt: skip
def test_native_units(build: Callable[[], System], stops: list[Fraction], algorithm: Algorithm, tmp_path: Path):
    expect_alike(build, SECOND, tmp_path, algorithm, stops)


def test_a_record_longer_than_the_block_that_its_rows_wait_in(tmp_path: Path):
    def build() -> System:
        s = System()
        s.add("sine", native_fmu("sine", 2), period=Fraction(1, 1000))
        return s

    expect_alike(build, 5 * SECOND, tmp_path, Algorithm.JACOBI)


def ends(s: System, fmu: FmuOf, fmi: int) -> None:
    """A sampled unit acts once where one run ends and another begins."""
    s.add("sampled", fmu("Counter"), sampled=True)
    s.add("other", native_fmu("ramp", fmi), period=Fraction(1, 5))


def quantities(s: System, fmu: FmuOf, fmi: int) -> None:  # noqa: ARG001
    source = s.add("sine", native_fmu("sine", 2), a=40.0, w=3.0, b=20.0)
    other, si = s.add("other", native_fmu("workshop", fmi)), s.add("si", native_fmu("si", 2))
    for name in ("angle", "length", "temperature"):
        s.connect(source.y.y, getattr(other.u, f"{name}_in"))
        s.connect(getattr(other.y, name), getattr(si.u, f"{name}_in"))
    s.connect(source.y.y, s.add("reader", native_fmu("integrator", 2)).u.u, LinearTransformation(0.3, 0.7))


def kinds(s: System, fmu: FmuOf, fmi: int) -> None:
    counter = s.add("counter", fmu("Counter"), period=Fraction(1, 30), sampled=True)
    echo = s.add("echo", fmu("Echo"), period=Fraction(1, 20))
    passer = s.add("passer", native_fmu("discrete_passer", fmi), period=Fraction(1, 10))
    for name in ("n", "odd", "light", "pair", "picture"):
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    s.connect(echo.y.odd_back, passer.u.truth_in)
    s.connect(echo.y.n_back, passer.u.count_in)


def texts(s: System, fmu: FmuOf, fmi: int) -> None:
    """They become longer."""
    a, b = s.add("a", fmu("Diary", fmi)), s.add("b", fmu("Diary", 3), mark="bbb")
    s.connect(a.y.text, b.u.heard)
    s.connect(b.y.text, a.u.heard)


def widths_and_bytes(s: System, fmu: FmuOf, fmi: int) -> None:
    a, b = s.add("a", fmu("Tally", 3), factor=-3), s.add("b", fmu("Tally", fmi), factor=2)
    s.connect(a.y.positive, b.u.whole)
    s.connect(a.y.third, b.u.single)
    s.connect(a.y.single_third, b.u.double)
    s.connect(b.y.positive, a.u.whole)
    s.connect(b.y.third, a.u.double)
    first = s.add("first", native_fmu("binary_passer", 3), u=b"some bytes\0, a zero among them")
    s.connect(first.y.y, s.add("second", native_fmu("binary_passer", 3), period=Fraction(1, 5)).u.u)


@pytest.mark.parametrize(
    ("wire", "algorithm", "fmi"),
    [
        (ends, GAUSS_SEIDEL, 3),
        (quantities, JACOBI, 2),
        (kinds, JACOBI, 2),
        (texts, GAUSS_SEIDEL, 2),
        (widths_and_bytes, GAUSS_SEIDEL, 3),
    ],
)
def test_whatever_flows(
    wire: Callable[[System, FmuOf, int], None], fmu: FmuOf, fmi: int, algorithm: Algorithm, tmp_path: Path
):
    def build() -> System:
        s = System()
        wire(s, fmu, fmi)
        return s

    ran = expect_alike(build, SECOND, tmp_path, algorithm, [Fraction(1, 2), Fraction(1, 2), SECOND])
    assert ran.failure is None


def test_what_a_unit_gave_does_not_stay_in_its_memory():
    s = System()
    s.add("passer", native_fmu("binary_passer", 3), u=b"some bytes")
    with Master(s) as master:
        master.run(SECOND)
        (getter,) = master.ensemble.instances["passer"].getters
        kept = int(getter.native.arrays[0][0])
        SignalBuffer.__call__(getter)  # without the copy that an OutputBuffer makes
        assert int(getter.native.arrays[0][0]) != kept
        getter.native.arrays[0][0] = kept
        assert master.signals["passer.y"].tobytes() == b"some bytes"


def seeing(fmu: FmuOf) -> System:
    s = System()
    camera = s.add("camera", fmu("Counter"), period=Fraction(1, 30), sampled=True)
    eye = s.add("eye", fmu("Echo"), period=Fraction(1, 20), sampled=True)
    mass = s.add("mass", native_fmu("mass", 2), period=Fraction(1, 50), k=2.0)
    s.connect(camera.y.picture, eye.u.picture)
    s.connect(eye.y.brightness, mass.u.f, LinearTransformation(0.5))
    return s


def test_each_goes_on_from_the_others_state(fmu: FmuOf):
    def values(master: Master) -> list[bytes]:
        return [master.signals[name].tobytes() for name in ("mass.x", "mass.v", "eye.brightness")]

    def go(stepper: Stepper, points: int) -> None:
        while not stepper.arrive(last) and points:
            stepper.depart()
            points -= 1

    with Master(seeing(fmu)) as whole:
        whole.run(Fraction(2))
        expected = values(whole)
    for plan_first in (True, False):
        with Master(seeing(fmu)) as master:
            plan, last = master.stepper, master.schedule.ticks(Fraction(2))
            assert isinstance(plan, PlanStepper)
            general = GridStepper(master.schedule, plan.coupling, master.ensemble)
            first, second = (plan, general) if plan_first else (general, plan)
            go(first, 37)
            second.set_state(first.get_state())
            assert second.get_state() == first.get_state()
            assert second.time == first.time
            assert master.ensemble.instances["mass"].time == pytest.approx(first.time, abs=0.02)
            go(second, 10**6)
            assert values(master) == expected
