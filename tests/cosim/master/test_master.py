import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.cosim.fmu_of import FmuOf
from support.cosim.observed_rows import observed_rows
from support.rewritten_archive import rewritten

from handover.cosim.exceptions import InitializationError, InvalidFmu
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.cosim.system.time_series import TimeSeries


@pytest.mark.parametrize(
    ("mass", "spring", "algorithm", "late"),
    [(2, 2, Algorithm.GAUSS_SEIDEL, 0), (2, 3, Algorithm.GAUSS_SEIDEL, 0), (3, 3, Algorithm.JACOBI, 1)],
)
def test_gauss_seidel_gives_the_force_of_the_present_position_and_jacobi_one_step_late(
    fmu: FmuOf, mass: int, spring: int, algorithm: Algorithm, late: int
):
    """m x'' = -k x with the force held over each step: m = 1 kg, k = 4 N/m, x(0) = 1 m."""
    s = System()
    a, b = s.add("mass", fmu("Mass", mass)), s.add("spring", fmu("Spring", spring))
    s.set_step(Fraction(1, 100))
    s.connect(a.y.x, b.u.x)
    s.connect(b.y.f, a.u.f)
    rows = observed_rows(s, Fraction(1), "mass.x", options=MasterOptions(algorithm=algorithm))
    dt, x, v, forces, expected = 0.01, 1.0, 0.0, [-4.0] * (late + 1), [1.0]
    for _ in range(100):
        f = forces[-1 - late]
        x, v = x + (v * dt + f * dt * dt / 2), v + f * dt
        forces.append(-4.0 * x)
        expected.append(x)
    assert [x for (x,) in rows.values()] == expected


def test_every_kind_of_port_reaches_its_reader_and_is_recorded(fmu: FmuOf, tmp_path: Path):
    s = System()
    counter, echo = s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"))
    s.add("mass", fmu("Mass"))
    for name in ("n", "odd", "light", "pair", "picture"):
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    seen: list[tuple[object, ...]] = []

    def observe(t: float, y: Signals) -> None:  # noqa: ARG001
        pair, mean = y["echo.pair_back"].tolist(), float(y["echo.brightness"])
        seen.append((int(y["echo.n_back"]), bool(y["echo.odd_back"]), y.text("echo.light_back"), pair, mean))

    with Master(s) as master, Recorder(tmp_path / "r.parquet") as recorder:
        master.run(Fraction(3, 10), [observe, recorder])
        signals = master.signals
    assert seen == [
        (0, False, "RED", [0.0, 0.0], 0.0),
        (1, True, "GREEN", [1.0, 1.0], 1.0),
        (2, False, "RED", [2.0, 4.0], 2.0),
        (3, True, "GREEN", [3.0, 9.0], 3.0),
    ]
    record = Record(tmp_path / "r.parquet")
    assert record.time.tolist() == [k / 10 for k in range(4)]
    assert record["counter.pair"].tolist() == [[k, k * k] for k in range(4)]
    assert record["counter.odd"].tolist() == [k % 2 == 1 for k in range(4)]
    assert record["counter.light"].tolist() == [1 + k % 2 for k in range(4)]
    assert record.unit("mass.v") == "m/s"
    del master  # what was given can be read after the run
    assert signals["counter.picture"].tolist() == [3] * 24
    assert int(signals["counter.n"]) == 3


def test_a_run_ends_when_an_observer_ends_it(fmu: FmuOf):
    s = System()
    s.add("counter", fmu("Counter"))
    with Master(s) as master:
        master.run(Fraction(100), until=lambda: int(master.signals["counter.n"]) == 7)
        assert master.time == 0.7


def test_stops_are_exact_and_a_system_that_was_changed_since_is_not_loaded(fmu: FmuOf):
    s = System()
    s.add("counter", fmu("Counter"))
    for stop, right in ((0.07, "'7/100'"), (np.float64(0.07), "'7/100'"), (math.inf, "'1/100'")):
        with pytest.raises(TypeError, match=rf"give .*Fraction\({right}\)"):
            Master(s, stop=stop)  # type: ignore
    with Master(s) as master, pytest.raises(TypeError, match="7/100"):
        master.run(0.07)  # type: ignore
    series = TimeSeries([0.0], [[0.0]], linear=False)
    a, b = s.add("a", fmu("Mass")), s.add("b", fmu("Mass"))
    for change in (
        lambda: s.add("mass", fmu("Mass")),
        lambda: s.follow(a.u.f, series),
        lambda: (s.followed.clear(), s.follow(b.u.f, series)),
        lambda: setattr(s, "start", Fraction(1)),
    ):
        late = Master(s)
        change()
        with pytest.raises(RuntimeError, match="was changed"):
            late.__enter__()


def test_a_unit_that_refuses_its_parameters_is_named_with_its_reason(fmu: FmuOf):
    s = System()
    s.add("picky", fmu("Picky"), low=3.0, high=2.0)
    with pytest.raises(InitializationError) as caught, Master(s):
        pass
    assert caught.value.failure is not None
    assert str(caught.value).startswith("picky does not start: ")
    assert "low = 3.0 must be below high" in str(caught.value)


def test_an_fmu_with_a_damaged_binary_is_refused(fmu: FmuOf, tmp_path: Path):
    def broken(name: str, content: bytes) -> bytes:
        return b"not a library" if name.startswith("binaries/") else content

    s = System()
    s.add("mass", rewritten(fmu("Mass"), tmp_path / "Mass.fmu", broken))
    here = Path.cwd()
    with pytest.raises(InvalidFmu, match=r"Mass.fmu: mass: could not be instantiated"), Master(s):
        pass
    assert Path.cwd() == here


def test_inputs_keep_their_start_values_until_their_source_is_known(fmu: FmuOf):
    """The force of the spring hangs on x alone: there is no loop."""
    for block in ("Pushed", "Mass"):
        s = System()
        mass, spring = s.add("mass", fmu(block), f=3.0), s.add("spring", fmu("Spring"))
        s.connect(mass.y.x, spring.u.x)
        s.connect(spring.y.f, mass.u.f)
        with Master(s) as master:
            assert float(master.signals["mass.a" if block == "Pushed" else "spring.f"]) == -4.0
