"""Inputs from outside: asked once a communication point, recorded, and played back byte for byte."""

import zipfile
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.ssp_schemas import expect_valid

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import NotExportable, WiringError
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.stepping.external_inputs import InvalidExternalValue
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import ExternalSource, TimeSeries


class Asked:
    """A source that notes when it was asked, and draws another number each time."""

    def __init__(self, seed: int = 0) -> None:
        self.times: list[float] = []
        self.given: list[float] = []
        self._rng = np.random.default_rng(seed)

    def at(self, t: float) -> Sequence[float]:
        self.times.append(t)
        self.given.append(float(self._rng.normal()))
        return [self.given[-1]]


def pushed_mass(source: ExternalSource | None, fmi: int = 3, f: float = 0.0) -> System:
    system = System()
    mass = system.add("mass", native_fmu("mass", fmi), f=f)
    slow = system.add("slow", native_fmu("gain", fmi), period=3 * mass.period)
    system.connect(mass.y.v, slow.u.u)
    system.external(mass.u.f, source)
    return system


def recorded(system: System, path: Path, options: MasterOptions | None = None) -> Record:
    with Master(system, options or MasterOptions()) as master, Recorder(path) as recorder:
        master.run(Fraction(1, 2), [recorder])
    return Record(path)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_it_is_asked_once_at_each_point_and_what_it_gave_acts_from_there(
    algorithm: Algorithm, fmi: int, tmp_path: Path
):
    source = Asked()
    record = recorded(pushed_mass(source, fmi), tmp_path / "a.parquet", MasterOptions(algorithm=algorithm))
    assert source.times == pytest.approx(np.arange(51) * 0.01)
    assert record["mass.f"].tolist() == source.given
    momentum: Floats = np.concatenate([[0.0], np.cumsum(source.given[:-1]) * 0.01])
    assert record["mass.v"] == pytest.approx(momentum, abs=1e-12)


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_run_from_its_record_has_the_same_bytes(algorithm: Algorithm, tmp_path: Path):
    options = MasterOptions(algorithm=algorithm)
    first = recorded(pushed_mass(Asked(1)), tmp_path / "a.parquet", options)
    recorded(pushed_mass(first.series("mass.f")), tmp_path / "b.parquet", options)
    recorded(pushed_mass(Asked(2)), tmp_path / "c.parquet", options)
    a, b, c = ((tmp_path / f"{name}.parquet").read_bytes() for name in "abc")
    assert a == b != c


def test_an_adaptive_run_from_its_record_has_the_same_bytes(tmp_path: Path):
    options = MasterOptions(adaptive=AdaptiveStep(relative=1e-4, largest=Fraction(1, 50)))
    first = recorded(pushed_mass(TimeSeries([0.0, 0.1], [[0.0], [2.0]], linear=False)), tmp_path / "a.parquet", options)
    recorded(pushed_mass(first.series("mass.f")), tmp_path / "b.parquet", options)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_a_sampled_unit_acts_on_what_comes_at_its_instant(tmp_path: Path):
    system = System()
    unit = system.add("unit", native_fmu("gain", 2), sampled=True)
    source = Asked()
    system.external(unit.u.u, source)
    record = recorded(system, tmp_path / "a.parquet")
    assert record["unit.y"].tolist() == record["unit.u"].tolist() == source.given


def test_a_discrete_input_from_outside_is_an_event():
    system = System()
    watch = system.add("watch", native_fmu("watch"))
    system.external(watch.u.count_in, TimeSeries([0.0, 0.3, 0.6], [[0], [4], [5]], linear=False))
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["watch.changed"] == pytest.approx(0.6)
        assert (master.signals["watch.count"], master.signals["watch.changes"]) == (5, 2)


def test_without_a_source_the_start_value_holds(tmp_path: Path):
    record = recorded(pushed_mass(None, f=2.0), tmp_path / "a.parquet")
    assert set(record["mass.f"]) == {2.0}
    assert record["mass.v"][-1] == pytest.approx(1.0)


class Given:
    def __init__(self, value: Any) -> None:
        self._value = value

    def at(self, t: float) -> Any:
        return [0.0] if t < 0.25 else self._value


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ([np.nan], r"got \[nan\], which is not finite"),
        ([1.0, 2.0], "got 2 values where 1 is right"),
        (["2.7"], r"got \['2\.7'\], which is no array of numbers"),
        ([[1.0], [2.0, 3.0]], r"got \[\[1\.0\], \[2\.0, 3\.0\]\], which is no array of numbers"),
    ],
)
def test_a_value_that_is_none_ends_the_run_with_its_reason(value: Any, told: str, tmp_path: Path):
    system = pushed_mass(Given(value))
    with (
        Master(system) as master,
        pytest.raises(InvalidExternalValue, match=rf"^mass: setting f from outside at t = 0\.25 s {told}"),
        Recorder(tmp_path / "a.parquet") as recorder,
    ):
        master.run(Fraction(1), [recorder])
    assert Record(tmp_path / "a.parquet").time[-1] == pytest.approx(0.24)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ([2.7], r"got \[2\.7\] where whole numbers are right"),
        ([np.inf], r"got \[inf\], which is not finite"),
        ([2**40], r"got \[1099511627776\], which is out of range: from -2147483648 to 2147483647"),
        (["4"], r"got \['4'\], which is no array of numbers"),
    ],
)
def test_what_is_no_whole_number_is_not_rounded_for_an_integer_input(value: Any, told: str):
    system = System()
    watch = system.add("watch", native_fmu("watch"))
    system.external(watch.u.count_in, Given(value))
    with Master(system) as master, pytest.raises(InvalidExternalValue, match=told):
        master.run(Fraction(1))


def test_what_cannot_come_from_outside_is_refused_with_its_name():
    system = System()
    mass, gain = system.add("mass", native_fmu("mass", 3)), system.add("gain", native_fmu("gain", 3))
    binary = system.add("binary", native_fmu("binary_passer"))
    system.connect(gain.y.y, mass.u.f)
    system.follow(gain.u.u, TimeSeries([0.0], [[1.0]], linear=True))
    for target in (mass.u.f, mass.u.g, mass.u.x, binary.u.u, gain.u.u, PortName("hand", "u")):
        system.external(target)
    with pytest.raises(WiringError) as refused:
        system.check()
    assert refused.value.faults == (
        "mass.f: fed by gain.y, so it cannot come from outside",
        "mass.g: mass has no input 'g'; valid: f",
        "mass.x: mass.x is an output, not an input",
        "binary.u: a binary cannot come from outside",
        "gain.u: follows values over time, so it cannot come from outside",
        "hand.u: there is no unit 'hand'; did you mean gain?",
    )


def test_a_resumed_run_goes_on_with_what_was_given_at_its_point():
    first, second = pushed_mass(Given([3.0])), pushed_mass(Given([5.0]))
    with Master(first) as before:
        before.run(Fraction(30, 100))
        state = before.stepper.get_state()
    with Master(second) as after:
        after.run(Fraction(30, 100))
        after.stepper.set_state(state)
        after.stepper.arrive(after.schedule.ticks(Fraction(30, 100)))
        assert after.signals["mass.f"] == 3.0
        after.stepper.depart()
        after.stepper.arrive(after.schedule.ticks(Fraction(31, 100)))
        assert after.signals["mass.f"] == 5.0


def test_in_an_ssp_it_is_a_connector_of_the_system(tmp_path: Path):
    path = tmp_path / "a.ssp"
    write_ssp(pushed_mass(Asked()), path, "pushed")
    expect_valid(path, "2.0")
    structure = zipfile.ZipFile(path).read("SystemStructure.ssd").decode()
    assert '<ssd:Connector name="mass.f" kind="input">' in structure
    assert '<ssd:Connection startConnector="mass.f" endElement="mass" endConnector="f" />' in structure
    with SspFile(path) as ssp, Master(ssp.system) as master:
        master.run(Fraction(1, 2))


JUMP = TimeSeries([0.0, 0.5, 0.5, 1.0], [[0.0], [1.0], [3.0], [3.0]], linear=True)


@pytest.mark.parametrize(
    ("t", "held", "linear"),
    [(-1.0, 2.0, 2.0), (0.0, 2.0, 2.0), (0.5, 2.0, 3.0), (1.0, 7.0, 7.0), (1.5, 7.0, 6.0), (2.0, 5.0, 5.0), (9, 5, 5)],
)
def test_values_are_held_or_on_lines_and_jump_where_a_time_is_given_twice(t: float, held: float, linear: float):
    times, values = [0.0, 1.0, 1.0, 2.0], [[2.0], [4.0], [7.0], [5.0]]
    assert TimeSeries(times, values, linear=False).at(t).tolist() == [held]
    assert TimeSeries(times, values, linear=True).at(t).tolist() == [linear]


@pytest.mark.parametrize(
    ("times", "values"),
    [([], []), ([0.0, 1.0], [[1.0]]), ([1.0, 0.0], [[1.0], [1.0]]), ([0.0], [[np.nan]]), ([np.inf], [[1.0]])],
)
def test_a_series_that_is_none_is_refused(times: list[float], values: list[list[float]]):
    with pytest.raises(ValueError, match=r"series|row a time|descend|finite"):
        TimeSeries(times, values, linear=True)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_mass_gets_the_momentum_of_what_it_follows(algorithm: Algorithm, fmi: int):
    system = System()
    mass = system.add("mass", native_fmu("mass", fmi))
    follower = system.add("follower", native_fmu("gain", fmi), period=mass.period)
    system.connect(mass.y.v, follower.u.u)
    system.follow(mass.u.f, JUMP)
    with Master(system, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1))
        steps = 2 * np.arange(50) * 0.01  # held over each step of 10 ms
        assert master.signals["mass.v"] == pytest.approx(0.01 * (steps.sum() + 50 * 3.0), abs=1e-12)
        assert master.signals["follower.y"] == pytest.approx(master.signals["mass.v"], abs=0.031)


def test_an_adaptive_step_follows_too():
    system = System()
    mass = system.add("mass", native_fmu("mass", 2))
    system.follow(mass.u.f, TimeSeries([0.0, 1.0], [[0.0], [2.0]], linear=True))
    control = AdaptiveStep(relative=1e-6, largest=Fraction(1, 50))
    with Master(system, MasterOptions(adaptive=control)) as master:
        master.run(Fraction(1))
        assert master.signals["mass.v"] == pytest.approx(1.0, abs=0.02)


def test_a_sampled_unit_acts_on_the_value_of_the_instant():
    system = System()
    unit = system.add("unit", native_fmu("gain", 2), sampled=True)
    system.follow(unit.u.u, TimeSeries([0.0, 1.0], [[0.0], [10.0]], linear=True))
    with Master(system) as master:
        master.run(Fraction(1, 2))
        assert master.signals["unit.y"] == pytest.approx(5.0)


def test_a_discrete_input_that_changes_is_an_event():
    system = System()
    watch = system.add("watch", native_fmu("watch"))
    system.follow(watch.u.count_in, TimeSeries([0.0, 0.3, 0.6], [[0], [4], [5]], linear=False))
    with Master(system) as master:
        master.run(Fraction(1))
        assert master.signals["watch.changed"] == pytest.approx(0.6)
        assert (master.signals["watch.count"], master.signals["watch.changes"]) == (5, 2)


def test_what_cannot_follow_is_refused_with_its_name():
    system = System()
    mass, spring = system.add("mass", native_fmu("mass", 3)), system.add("gain", native_fmu("gain", 3))
    binary = system.add("binary", native_fmu("binary_passer"))
    passer = system.add("passer", native_fmu("discrete_passer", 3))
    system.connect(spring.y.y, mass.u.f)
    for target in (mass.u.f, mass.u.g, mass.u.x, binary.u.u, passer.u.count_in):
        system.follow(target, JUMP)
    system.follow(spring.u.u, TimeSeries([0.0], [[1.0, 2.0]], linear=True))
    with pytest.raises(WiringError) as refused:
        system.check()
    assert refused.value.faults == (
        "mass.f: fed by gain.y, so it cannot follow values over time",
        "mass.g: mass has no input 'g'; valid: f",
        "mass.x: mass.x is an output, not an input",
        "binary.u: a binary cannot follow values over time",
        "passer.count_in: its values are held: it does not vary continuously",
        "gain.u: 2 values a time where 1 is right",
    )


def test_an_ssp_has_no_place_for_it(tmp_path_factory: pytest.TempPathFactory):
    system = System()
    system.follow(system.add("mass", native_fmu("mass", 2)).u.f, JUMP)
    with pytest.raises(NotExportable, match=r"mass\.f follows values over time"):
        write_ssp(system, tmp_path_factory.mktemp("ssp") / "a.ssp", "a")
