import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from support.cosim.observed_rows import observed_rows
from support.rewritten_archive import described_otherwise, rewritten

from handover.cosim.exceptions import InitializationError, InvalidFmu, InvalidOptions, UnitFailure, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

FmuOf = Callable[..., Path]


def oscillator(fmu: FmuOf, fmi: int = 3, period: Fraction = Fraction(1, 100)) -> System:
    s = System()
    mass = s.add("mass", fmu("Mass", fmi), m=1.0, x_0=1.0, period=period)
    spring = s.add("spring", fmu("Spring", fmi), k=4.0, period=period)
    s.connect(mass.y.x, spring.u.x)
    s.connect(spring.y.f, mass.u.f)
    return s


def positions(system: System, stop: Fraction, algorithm: Algorithm = Algorithm.GAUSS_SEIDEL) -> dict[float, float]:
    rows = observed_rows(system, stop, "mass.x", options=MasterOptions(algorithm=algorithm))
    return {t: x for t, (x,) in rows.items()}


def held_force(n: int, dt: float, delay: int) -> list[float]:
    """The oscillator of `oscillator`, its force held over each step, known `delay` steps late."""
    x, v, forces, xs = 1.0, 0.0, [-4.0] * (delay + 1), [1.0]
    for _ in range(n):
        f = forces[-1 - delay]
        x, v = x + (v * dt + f * dt * dt / 2), v + f * dt
        forces.append(-4.0 * x)
        xs.append(x)
    return xs


@pytest.mark.parametrize("fmi", [2, 3])
def test_gauss_seidel_gives_the_force_of_the_present_position(fmu: FmuOf, fmi: int):
    seen = list(positions(oscillator(fmu, fmi), Fraction(1)).values())
    assert seen == held_force(100, 0.01, delay=0)


def test_jacobi_gives_the_force_one_step_late(fmu: FmuOf):
    seen = list(positions(oscillator(fmu), Fraction(1), Algorithm.JACOBI).values())
    assert seen == held_force(100, 0.01, delay=1)


def test_the_coupling_error_shrinks_with_the_step(fmu: FmuOf):
    errors: list[float] = []
    for n in (50, 100, 200):
        seen = positions(oscillator(fmu, period=Fraction(1, n)), Fraction(1))
        errors.append(abs(seen[1.0] - np.cos(2.0)))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.1)


def test_units_of_both_standards_work_together(fmu: FmuOf):
    s = System()
    mass, spring = s.add("mass", fmu("Mass", 2)), s.add("spring", fmu("Spring", 3))
    s.connect(mass.y.x, spring.u.x)
    s.connect(spring.y.f, mass.u.f)
    assert list(positions(s, Fraction(1)).values()) == held_force(10, 0.1, delay=0)


def test_every_kind_of_port_reaches_its_reader(fmu: FmuOf):
    s = System()
    counter, echo = s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"))
    for name in ("n", "odd", "light", "pair", "picture"):
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    entries: list[tuple[object, ...]] = []

    def observe(t: float, y: Signals) -> None:  # noqa: ARG001
        pair, mean = y["echo.pair_back"].tolist(), float(y["echo.brightness"])
        entries.append((int(y["echo.n_back"]), bool(y["echo.odd_back"]), y.text("echo.light_back"), pair, mean))

    with Master(s) as master:
        master.run(Fraction(3, 10), [observe])
    assert entries == [
        (0, False, "RED", [0.0, 0.0], 0.0),
        (1, True, "GREEN", [1.0, 1.0], 1.0),
        (2, False, "RED", [2.0, 4.0], 2.0),
        (3, True, "GREEN", [3.0, 9.0], 3.0),
    ]


def test_each_unit_steps_at_its_own_rate_and_time_does_not_drift(fmu: FmuOf):
    s = System()
    s.add("fast", fmu("Counter"), period=Fraction(1, 30))
    s.add("slow", fmu("Counter"), period=Fraction(1, 7))
    with Master(s) as master:
        master.run(Fraction(100))
        assert int(master.signals["fast.n"]) == 3000
        assert int(master.signals["slow.n"]) == 700
        assert float(master.signals["slow.at"]) == pytest.approx(100.0, abs=1e-12)


def test_a_run_ends_when_an_observer_ends_it(fmu: FmuOf):
    s = System()
    s.add("counter", fmu("Counter"))
    with Master(s) as master:
        master.run(Fraction(100), until=lambda: int(master.signals["counter.n"]) == 7)
        assert master.time == 0.7


def test_a_failure_names_unit_call_and_time_and_keeps_the_record(fmu: FmuOf, tmp_path: Path):
    s = System()
    s.add("steady", fmu("Counter"))
    s.add("failing", fmu("Counter"), fails_at=5)
    file = tmp_path / "signals.parquet"
    with (
        pytest.raises(UnitFailure, match=r"failing: fmi3DoStep at t = 0\.4 s") as caught,
        Master(s) as master,
        Recorder(file) as recorder,
    ):
        master.run(Fraction(1), [recorder])
    assert any("count 5 was asked to fail" in line for line in caught.value.log)
    assert Record(file)["steady.n"].tolist() == [0, 1, 2, 3, 4]


def test_a_unit_that_refuses_its_parameters_is_named_with_its_reason(fmu: FmuOf):
    s = System()
    s.add("picky", fmu("Picky"), low=3.0, high=2.0)
    with pytest.raises(InitializationError, match=r"picky does not start: .*low = 3\.0 must be below high"), Master(s):
        pass


def test_a_record_has_all_scalars_with_their_units(fmu: FmuOf, tmp_path: Path):
    s = System()
    s.add("counter", fmu("Counter"))
    s.add("mass", fmu("Mass"))
    file = tmp_path / "signals.parquet"
    with Master(s) as master, Recorder(file) as recorder:
        master.run(Fraction(2), [recorder])
    record = Record(file)
    assert record.time.tolist() == [k / 10 for k in range(21)]
    assert record["counter.pair"].tolist() == [[k, k * k] for k in range(21)]
    assert record["counter.odd"].tolist() == [k % 2 == 1 for k in range(21)]
    assert record["counter.light"].tolist() == [1 + k % 2 for k in range(21)]
    assert record.unit("mass.v") == "m/s"
    with pytest.raises(KeyError, match=r"did you mean mass\.v or mass\.x"):
        record["mass.w"]


def test_the_same_system_gives_the_same_bytes(fmu: FmuOf, tmp_path: Path):
    for name in ("a", "b"):
        with Master(oscillator(fmu)) as master, Recorder(tmp_path / name) as recorder:
            master.run(Fraction(10), [recorder])
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_wrong_system_does_not_start(fmu: FmuOf):
    s = oscillator(fmu)
    s.connect(s.units["mass"].y.v, s.units["spring"].u.x)
    with pytest.raises(WiringError):
        Master(s)


def test_an_fmu_with_a_damaged_binary_is_refused(fmu: FmuOf, tmp_path: Path):
    def broken(name: str, content: bytes) -> bytes:
        return b"not a library" if name.startswith("binaries/") else content

    s = System()
    s.add("mass", rewritten(fmu("Mass"), tmp_path / "Mass.fmu", broken))
    here = Path.cwd()
    with pytest.raises(InvalidFmu, match=r"Mass.fmu: mass: could not be instantiated"), Master(s):
        pass
    assert Path.cwd() == here


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_plant_with_feedthrough_is_recorded_as_fmpy_records_it(fmu: FmuOf, algorithm: Algorithm):
    s = System()
    s.add("mass", fmu("Pushed"), f=1.0, x_0=0.0)
    result = fmpy.simulate_fmu(
        str(fmu("Pushed")), stop_time=1.0, output_interval=0.1, start_values={"f": 1.0, "x_0": 0.0}, output=["x", "a"]
    )
    seen: list[tuple[float, float]] = []
    with Master(s, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1), [lambda t, y: seen.append((t, float(y["mass.x"])))])
    assert [x for _, x in seen] == pytest.approx(result["x"].tolist(), rel=1e-12)
    assert [t for t, _ in seen] == pytest.approx(result["time"].tolist())


def without_dependencies(file: Path, folder: Path, *, states: bool) -> Path:
    """Copy an FMU but for what it declares of its outputs' dependencies and, as asked for, of its states."""

    def change(text: str) -> str:
        bare = re.sub(r' dependencies(Kind)?="[^"]*"', "", text)
        return bare if states else re.sub(r' can(GetAndSet|Serialize)FMUState="true"', "", bare)

    return described_otherwise(file, folder / file.name, change)


@pytest.mark.parametrize("states", [True, False])
def test_units_that_declare_no_dependencies_run_in_a_loop(fmu: FmuOf, states: bool, tmp_path: Path):
    def system(file_of: Callable[[str], Path]) -> System:
        s = System()
        mass, spring = s.add("mass", file_of("Mass")), s.add("spring", file_of("Spring"))
        s.connect(mass.y.x, spring.u.x)
        s.connect(spring.y.f, mass.u.f)
        return s

    bare = system(lambda block: without_dependencies(fmu(block), tmp_path, states=states))
    found = list(positions(bare, Fraction(1)).values())
    if states:  # solved as if it were an algebraic loop, which is what the iterated coupling does
        iterated = positions(system(fmu), Fraction(1), Algorithm.NEWTON)
        assert found == pytest.approx(list(iterated.values()), rel=1e-6)
    else:
        assert found == held_force(10, 0.1, delay=0)


def test_a_second_run_goes_on_where_the_first_ended(fmu: FmuOf):
    whole = positions(oscillator(fmu), Fraction(1))
    seen: dict[float, float] = {}

    def observe(t: float, y: Signals) -> None:
        seen[t] = float(y["mass.x"])

    with Master(oscillator(fmu)) as master:
        master.run(Fraction(1, 2), [observe])
        master.run(Fraction(1), [observe])
    assert seen == whole


def test_inputs_keep_their_start_values_until_their_source_is_known(fmu: FmuOf):
    s = System()
    first, second = s.add("first", fmu("Pushed"), f=3.0), s.add("second", fmu("Spring"))
    s.connect(first.y.x, second.u.x)
    s.connect(second.y.f, first.u.f)
    with Master(s) as master:
        assert float(master.signals["first.a"]) == -4.0  # of the spring's force, which hangs on x alone: no loop
    s = System()
    mass = s.add("mass", fmu("Mass"), f=3.0)
    spring = s.add("spring", fmu("Spring"))
    s.connect(mass.y.x, spring.u.x)
    s.connect(spring.y.f, mass.u.f)
    with Master(s) as master:
        assert float(master.signals["spring.f"]) == -4.0


def test_pictures_and_numbers_can_be_read_after_the_run(fmu: FmuOf):
    s = System()
    s.add("counter", fmu("Counter"))
    with Master(s) as master:
        master.run(Fraction(1, 2))
        signals = master.signals
    del master
    assert signals["counter.picture"].tolist() == [5] * 24
    assert int(signals["counter.n"]) == 5


@pytest.mark.parametrize(
    ("option", "value", "entries"),
    [
        ("algorithm", "newton", r"algorithm = 'newton': one of Algorithm\.JACOBI, .* is right"),
        ("adaptive", 1e-4, r"adaptive = 0\.0001: None, or such as AdaptiveStep\(\) is right"),
        ("max_iterations", 2.5, r"max_iterations = 2\.5: a whole number"),
        ("tolerance", "x", r"tolerance = 'x': a finite number"),
    ],
)
def test_a_value_of_another_kind_is_reported_with_valid_values(option: str, value: Any, entries: str):
    with pytest.raises(InvalidOptions, match=entries):
        MasterOptions(**{option: value})
