"""Isolated units give the bytes of units in one process, however they are coupled and whatever flows between them."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cosim import checkpointed_runs, decay
from support.cosim.both_paths import Build, everything
from support.cosim.event_systems import bouncing, counting
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu

from handover.cosim.exceptions import UnitFailure
from handover.cosim.master.checkpoint import take_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.master.unit_options import isolated_units
from handover.cosim.record.recorder import Recorder
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

ONCE = ("<CoSimulation ", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" ')
SECOND = Fraction(1)
TENTH = Fraction(1, 10)
OPTIONS = {
    **{algorithm.value: {"algorithm": algorithm} for algorithm in Algorithm},
    **{f"{a.value} general": {"algorithm": a, "compiled": False} for a in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL)},
    "jacobi events": {"algorithm": Algorithm.JACOBI, "repeat_discarded": True},
    "events": {"repeat_discarded": True},
    "linear": {"extrapolation": Extrapolation.LINEAR},
    "adaptive": {"adaptive": AdaptiveStep(), "extrapolation": Extrapolation.LINEAR},
}
GENERAL, PLAN = ({"algorithm": Algorithm.GAUSS_SEIDEL, "compiled": compiled} for compiled in (False, True))
JACOBI, JACOBI_PLAN = ({"algorithm": Algorithm.JACOBI, "compiled": compiled} for compiled in (False, True))
ways = pytest.mark.parametrize(
    ("options", "all_isolated"),
    [
        pytest.param(PLAN, True, id="gauss-seidel plan, all"),
        pytest.param(JACOBI, False, id="jacobi, some"),
        pytest.param(JACOBI_PLAN, False, id="jacobi plan, some", marks=pytest.mark.slow),
        pytest.param(GENERAL, True, id="gauss-seidel, all", marks=pytest.mark.slow),
    ],
)
"""Of units in Python, whose processes take long to start, pairs of ways are enough; native units go all of them."""


def recorded(build: Build, stop: Fraction, folder: Path, isolated: Sequence[str], **options: Any) -> object:
    """Return the record, what an observer saw, and how the run failed, if it did."""
    seen: list[object] = []
    system = build()
    file = folder / f"{'-'.join(isolated) or 'none'}.parquet"
    failure = ""

    def look(t: float, signals: Signals) -> None:
        seen.append((t, everything(system, signals)))

    with (
        Master(system, MasterOptions(isolated=tuple(isolated), **options)) as master,
        Recorder(file) as recorder,
    ):
        try:
            master.run(stop / 2, [recorder])
            master.run(stop, [recorder, look])
        except UnitFailure as e:
            failure = f"{type(e)} {vars(e)}"
    return file.read_bytes(), tuple(seen), failure


def expect_alike(build: Build, stop: Fraction, folder: Path, options: dict[str, Any], *some: str) -> None:
    """Expect the outcome of one process if some units are isolated, and if all are."""
    expect_those_alike(build, stop, folder, options, some, ("all",))


def expect_those_alike(
    build: Build, stop: Fraction, folder: Path, options: dict[str, Any], *isolated: tuple[str, ...]
) -> None:
    together = recorded(build, stop, folder, (), **options)
    for units in isolated:
        assert recorded(build, stop, folder, units, **options) == together


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_native_units_at_three_rates(options: dict[str, Any], tmp_path: Path):
    expect_alike(checkpointed_runs.oscillator, SECOND, tmp_path, options, "a", "between")


@ways
def test_every_kind_of_port_sampled_and_pictures(
    fmu: FmuOf, options: dict[str, Any], all_isolated: bool, tmp_path: Path
):
    def build() -> System:
        s = System()
        counter = s.add("counter", fmu("Counter"), period=Fraction(1, 30), sampled=True)
        echo = s.add("echo", fmu("Echo"), period=Fraction(1, 20))
        passer = s.add("passer", native_fmu("discrete_passer", 2 if all_isolated else 3), period=TENTH)
        for name in ("n", "odd", "light", "pair", "picture"):
            s.connect(getattr(counter.y, name), getattr(echo.u, name))
        s.connect(echo.y.odd_back, passer.u.truth_in)
        s.connect(echo.y.n_back, passer.u.count_in)
        return s

    expect_those_alike(build, SECOND, tmp_path, options, ("all",) if all_isolated else ("counter", "passer"))


@ways
def test_texts_that_become_longer(fmu: FmuOf, options: dict[str, Any], all_isolated: bool, tmp_path: Path):
    def build() -> System:
        s = System()
        a, b = s.add("a", fmu("Diary", 2 if all_isolated else 3)), s.add("b", fmu("Diary", 3), mark="bbb")
        s.connect(a.y.text, b.u.heard)
        s.connect(b.y.text, a.u.heard)
        return s

    expect_those_alike(build, 2 * SECOND, tmp_path, options, ("all",) if all_isolated else ("a",))


@ways
def test_numbers_of_other_widths_and_bytes(fmu: FmuOf, options: dict[str, Any], all_isolated: bool, tmp_path: Path):
    def build() -> System:
        s = System()
        a, b = s.add("a", fmu("Tally", 3), factor=-3), s.add("b", fmu("Tally", 3), factor=2)
        s.connect(a.y.positive, b.u.whole)
        s.connect(a.y.third, b.u.single)
        s.connect(b.y.third, a.u.double)
        first = s.add("first", native_fmu("binary_passer", 3), u=b"some bytes\0, a zero among them")
        second = s.add("second", native_fmu("binary_passer", 3), period=Fraction(1, 5))
        s.connect(first.y.y, second.u.u)
        return s

    expect_those_alike(build, 2 * SECOND, tmp_path, options, ("all",) if all_isolated else ("b", "first"))


@pytest.mark.parametrize(
    ("build", "algorithm", "some"),
    [(bouncing, Algorithm.GAUSS_SEIDEL, ("ball", "slow")), (counting, Algorithm.JACOBI, ("slow",))],
)
def test_events_and_clocks(build: Build, algorithm: Algorithm, some: tuple[str, ...], tmp_path: Path):
    expect_alike(build, 2 * SECOND, tmp_path, {"algorithm": algorithm}, *some)


@pytest.mark.parametrize("repeats", [False, True])
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_that_is_discarded(fmi: int, repeats: bool, tmp_path: Path):
    def build() -> System:
        s = System()
        s.add("short", native_fmu("discards", fmi))
        s.add("other", native_fmu("integrator"), u=1.0)
        return s

    expect_alike(build, SECOND, tmp_path, {"repeat_discarded": repeats}, "short")


@pytest.mark.parametrize("options", [GENERAL, PLAN], ids=["general", "plan"])
@pytest.mark.parametrize("into", [(), ("all",)], ids=["together", "isolated"])
def test_a_run_that_is_resumed(into: tuple[str, ...], options: dict[str, Any], tmp_path: Path):
    """A checkpoint of isolated units is one of units in one process, and the other way round."""
    whole, rest = tmp_path / "whole.parquet", tmp_path / "rest.parquet"
    make: Callable[..., MasterOptions] = MasterOptions
    with Master(checkpointed_runs.oscillator(), make(**options)) as master, Recorder(whole) as recorder:
        master.run(SECOND, [recorder])
    out = tuple({"all"} - {*into})
    with Master(checkpointed_runs.oscillator(), make(isolated=out, **options)) as master, Recorder(rest) as recorder:
        master.run(Fraction(2, 5), [recorder])
        checkpoint = take_checkpoint(master, recorder.rows)
    with Master(checkpointed_runs.oscillator(), make(isolated=into, **options)) as master:
        checkpoint.restore(master)
        with Recorder(rest, after=checkpoint.rows) as recorder:
            skipped = iter([True])
            master.run(SECOND, [lambda t, y: None if next(skipped, False) else recorder(t, y)])
    assert rest.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("isolated", [(), ("right",), ("left", "right"), ("all",), ("foreign",)])
def test_units_that_a_process_may_hold_once_are_isolated_by_themselves(
    decay_library: bytes, tmp_path: Path, isolated: tuple[str, ...]
):
    """x' = -x + u: what one keeps in global memory would be the other's, too."""
    description = decay.spoilt("shares_memory").replace(*ONCE)
    fmu, plain = decay.pack(tmp_path / "once.fmu", decay_library, description), native_fmu("integrator", 2)
    system = System()
    for name, u in (("left", 0.0), ("right", 3.0)):
        system.add(name, fmu, u=u)
    system.add("other", plain)
    assert isolated_units(system, isolated) == {"left", "right"} | (
        {"other"} if isolated in (("all",), ("foreign",)) else set()
    )
    with Master(system, MasterOptions(isolated=isolated)) as master:
        unasked = ["left and right are one FMU, once.fmu" in line for line in master.isolations]
        assert unasked == ([True] if isolated in ((), ("right",)) else [])
        master.run(SECOND)
        found = [master.signals.plain(f"{name}.y") for name in ("left", "right")]
    assert found == pytest.approx([np.exp(-1.0), 3.0 - 2.0 * np.exp(-1.0)])


def test_one_unit_that_a_process_may_hold_once_stays_in_this_process(decay_library: bytes, tmp_path: Path):
    system = System()
    system.add("one", decay.pack(tmp_path / "once.fmu", decay_library, decay.DESCRIPTION.replace(*ONCE)))
    system.add("sound", decay.pack(tmp_path / "sound.fmu", decay_library))
    system.add("other", decay.pack(tmp_path / "sound.fmu", decay_library))
    assert isolated_units(system, ()) == frozenset()
