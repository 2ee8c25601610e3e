"""Inputs from outside: asked once a communication point, recorded, and played back byte for byte."""

import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim.native_units import native_fmu
from support.cosim.observed_rows import observed_rows
from support.cosim.ssp_schemas import expect_valid
from support.wording import Wording

from handover.cosim.blocks.ports import Floats, Width
from handover.cosim.blocks.units import BaseExponents, Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import NotExportable, WiringError
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.stepping.external_inputs import InvalidExternalValue
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import ExternalSource, HeldValue, TimeSeries


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


@pytest.mark.parametrize(("algorithm", "fmi"), [*((a, 3) for a in Algorithm), (Algorithm.GAUSS_SEIDEL, 2)])
def test_it_is_asked_once_at_each_point_and_what_it_gave_acts_from_there(
    algorithm: Algorithm, fmi: int, tmp_path: Path
):
    source = Asked()
    record = recorded(pushed_mass(source, fmi), tmp_path / "a.parquet", MasterOptions(algorithm=algorithm))
    assert source.times == pytest.approx(np.arange(51) * 0.01)
    assert record["mass.f"].tolist() == source.given
    momentum: Floats = np.concatenate([[0.0], np.cumsum(source.given[:-1]) * 0.01])
    assert record["mass.v"] == pytest.approx(momentum, abs=1e-12)


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.NEWTON])
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


@pytest.mark.parametrize("way", [System.external, System.follow])
def test_a_sampled_unit_acts_on_what_comes_at_its_instant_and_a_discrete_input_is_an_event(way: Callable[..., None]):
    s = System()
    unit, watch = s.add("unit", native_fmu("gain", 2), sampled=True), s.add("watch", native_fmu("watch"))
    way(s, unit.u.u, TimeSeries([0.0, 2.0], [[0.0], [20.0]], linear=True))
    way(s, watch.u.count_in, TimeSeries([0.0, 0.3, 0.6], [[0], [4], [5]], linear=False))
    rows = observed_rows(s, Fraction(1), "unit.y", "watch.changed", "watch.count", "watch.changes")
    assert [y for y, *_ in rows.values()] == pytest.approx([10.0 * t for t in rows])
    assert rows[1.0][1:] == (pytest.approx(0.6), 5, 2)


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
    ("port", "value"),
    [
        ("mass.f", [np.nan]),
        ("mass.f", [1.0, 2.0]),
        ("mass.f", ["2.7"]),
        ("mass.f", [[1.0], [2.0, 3.0]]),
        ("watch.count_in", [2.7]),
        ("watch.count_in", [np.inf]),
        ("watch.count_in", [2**40]),
        ("watch.count_in", ["4"]),
    ],
)
def test_a_value_that_is_none_ends_the_run_with_its_reason(port: str, value: Any, tmp_path: Path, wording: Wording):
    system, (name, target) = System(), port.split(".")
    system.add(name, native_fmu(name))
    system.external(PortName(name, target), Given(value))
    with (
        Master(system) as master,
        pytest.raises(InvalidExternalValue) as failure,
        Recorder(tmp_path / "a.parquet") as recorder,
    ):
        master.run(Fraction(1), [recorder])
    wording.check(failure.value)
    assert Record(tmp_path / "a.parquet").time[-1] == pytest.approx(0.24 if name == "mass" else 0.2)


@pytest.mark.parametrize("way", [System.external, System.follow])
def test_what_cannot_come_from_outside_or_follow_is_refused_with_its_name(way: Callable[..., None], wording: Wording):
    system = System()
    mass, gain = system.add("mass", native_fmu("mass", 3)), system.add("gain", native_fmu("gain", 3))
    binary, passer = (system.add(n, native_fmu(f"{n}_passer", 3)) for n in ("binary", "discrete"))
    system.connect(gain.y.y, mass.u.f)
    system.follow(gain.u.u, TimeSeries([0.0], [[1.0, 2.0]], linear=True))
    targets = [mass.u.f, mass.u.g, mass.u.x, binary.u.u, PortName("hand", "u")]
    for target in (*targets, gain.u.u) if way is System.external else (*targets, passer.u.count_in):
        way(system, target, JUMP)
    with pytest.raises(WiringError) as refused:
        system.check()
    assert len(refused.value.faults) == 7
    wording.check(refused.value)


WHOLE: dict[str, Any] = {"kind": Kind.INTEGER, "fmi_type": "Int32", "width": Width.INT32}


@pytest.mark.parametrize("way", [System.external, System.follow])
@pytest.mark.parametrize(
    ("kind", "values", "unit"),
    [
        (WHOLE, [[0.7]], None),
        (WHOLE, [[0], [2**40]], None),
        (WHOLE, [[0.0], [0.5], [1.0]], None),
        ({"kind": Kind.BOOLEAN, "fmi_type": "Boolean"}, [[1], [2]], None),
        ({"kind": Kind.ENUMERATION, "fmi_type": "Int64", "items": (("A", 1), ("B", 2))}, [[1], [2], [3]], None),
        ({"maximum": 10.0}, [[0.0], [11.0], [0.0]], None),
        ({"unit": Unit("N", BaseExponents(kg=1, m=1, s=-2))}, [[0.0], [1.0], [2.0]], "kN"),
    ],
)
def test_values_over_time_that_an_input_cannot_take_are_refused(
    kind: dict[str, Any], values: list[list[float]], unit: str | None, way: Callable[..., None]
):
    d = describe_fmu(native_fmu("gain", 3))
    system = System()
    placed = system.add("a", replace(d, inputs={"u": replace(d.inputs["u"], **kind)}))
    for rows, of_unit, is_right in ((values, unit, False), (values[:1] if len(values) > 1 else [[0]], None, True)):
        way(system, placed.u.u, TimeSeries([float(k) for k in range(len(rows))], rows, linear=False, unit=of_unit))
        if is_right:
            system.check()
        else:
            with pytest.raises(WiringError) as refused:
                system.check()
            assert len(refused.value.faults) == 1
            assert refused.value.faults[0].startswith("a.u: ")


def test_a_held_value_is_set_to_what_it_can_hold():
    held = HeldValue([1])
    held.set([2.0])
    assert held.entries.tolist() == [2]
    for other, wrong in ((held, [[0.5], [np.nan], [1, 2], [2**70], ["x"]]), (HeldValue([1.0]), [[True]])):
        for value in wrong:
            with pytest.raises(ValueError, match="cannot be held here"):
                other.set(value)
    assert held.entries.tolist() == [2]


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


JUMP = TimeSeries([0.0, 0.5, 0.5, 1.0], [[0.0], [1.0], [3.0], [3.0]], linear=True)


def test_in_an_ssp_it_is_a_connector_of_the_system_and_what_follows_has_no_place(tmp_path: Path, wording: Wording):
    path = tmp_path / "a.ssp"
    write_ssp(pushed_mass(Asked()), path, "pushed")
    expect_valid(path, "2.0")
    structure = zipfile.ZipFile(path).read("SystemStructure.ssd").decode()
    assert '<ssd:Connector name="mass.f" kind="input">' in structure
    assert '<ssd:Connection startConnector="mass.f" endElement="mass" endConnector="f" />' in structure
    with SspFile(path) as ssp, Master(ssp.system) as master:
        master.run(Fraction(1, 2))
    system = System()
    system.follow(system.add("mass", native_fmu("mass", 2)).u.f, JUMP)
    with pytest.raises(NotExportable) as refused:
        write_ssp(system, tmp_path / "b.ssp", "b")
    wording.check(refused.value)


def test_values_are_held_or_on_lines_and_jump_where_a_time_is_given_twice():
    held, linear = (TimeSeries([0.0, 1.0, 1.0, 2.0], [[2.0], [4.0], [7.0], [5.0]], linear=x) for x in (False, True))
    times = (-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 9.0)
    assert [held.at(t).tolist() for t in times] == [[2.0], [2.0], [2.0], [7.0], [7.0], [5.0], [5.0]]
    assert [linear.at(t).tolist() for t in times] == [[2.0], [2.0], [3.0], [7.0], [6.0], [5.0], [5.0]]


@pytest.mark.parametrize(
    ("times", "values"),
    [([], []), ([0.0, 1.0], [[1.0]]), ([1.0, 0.0], [[1.0], [1.0]]), ([0.0], [[np.nan]]), ([np.inf], [[1.0]])],
)
def test_a_series_that_is_none_is_refused(times: list[float], values: list[list[float]], wording: Wording):
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        TimeSeries(times, values, linear=True)
    wording.check(refused.value)


@pytest.mark.parametrize("algorithm", list(Algorithm))
def test_a_mass_gets_the_momentum_of_what_it_follows(algorithm: Algorithm):
    system = System()
    mass = system.add("mass", native_fmu("mass", 2))
    follower = system.add("follower", native_fmu("gain", 3), period=mass.period)
    system.connect(mass.y.v, follower.u.u)
    system.follow(mass.u.f, JUMP)
    with Master(system, MasterOptions(algorithm=algorithm)) as master:
        master.run(Fraction(1))
        steps = 2 * np.arange(50) * 0.01  # held over each step of 10 ms
        assert master.signals["mass.v"] == pytest.approx(0.01 * (steps.sum() + 50 * 3.0), abs=1e-12)
        assert master.signals["follower.y"] == pytest.approx(master.signals["mass.v"], abs=0.031)
