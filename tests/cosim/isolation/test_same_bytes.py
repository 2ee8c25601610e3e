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
    **{a.value: {"algorithm": a} for a in (Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL, Algorithm.NEWTON)},
    "gauss-seidel general": {"algorithm": Algorithm.GAUSS_SEIDEL, "compiled": False},
    "events": {"repeat_discarded": True},
    "adaptive": {"adaptive": AdaptiveStep(), "extrapolation": Extrapolation.LINEAR},
}
GENERAL, PLAN = ({"algorithm": Algorithm.GAUSS_SEIDEL, "compiled": compiled} for compiled in (False, True))
JACOBI = {"algorithm": Algorithm.JACOBI, "compiled": False}


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


def expect_alike(
    build: Build, stop: Fraction, folder: Path, options: dict[str, Any], *isolated: tuple[str, ...]
) -> None:
    """Expect the outcome of one process if some units are isolated, or all."""
    together = recorded(build, stop, folder, (), **options)
    for units in isolated:
        assert recorded(build, stop, folder, units, **options) == together


@pytest.mark.parametrize(
    ("options", "isolated"), [(name, ("a", "between") if i % 2 else ("all",)) for i, name in enumerate(OPTIONS)]
)
def test_native_units_at_three_rates(options: str, isolated: tuple[str, ...], tmp_path: Path):
    expect_alike(checkpointed_runs.oscillator, SECOND, tmp_path, OPTIONS[options], isolated)


@pytest.mark.parametrize(
    ("options", "fmi", "isolated"),
    [
        (PLAN, 2, ("counter", "echo", "one", "two", "first", "second")),
        (JACOBI, 3, ("echo", "passer", "third", "first")),
    ],
    ids=["gauss-seidel plan", "jacobi"],
)
def test_every_kind_of_value_sampled_units_pictures_and_texts_that_become_longer(
    fmu: FmuOf, options: dict[str, Any], fmi: int, isolated: tuple[str, ...], tmp_path: Path
):
    """Units in Python take long to start in processes of their own: native units go all ways."""

    def build() -> System:
        s = System()
        counter = s.add("counter", fmu("Counter"), period=Fraction(1, 30), sampled=True)
        echo = s.add("echo", fmu("Echo"), period=Fraction(1, 20))
        passer = s.add("passer", native_fmu("discrete_passer", fmi), period=TENTH)
        for name in ("n", "odd", "light", "pair", "picture"):
            s.connect(getattr(counter.y, name), getattr(echo.u, name))
        s.connect(echo.y.odd_back, passer.u.truth_in)
        s.connect(echo.y.n_back, passer.u.count_in)
        one, two = s.add("one", fmu("Diary", fmi)), s.add("two", fmu("Diary", 3), mark="bbb")
        s.connect(one.y.text, two.u.heard)
        s.connect(two.y.text, one.u.heard)
        third, fourth = s.add("third", fmu("Tally", 3), factor=-3), s.add("fourth", fmu("Tally", 3), factor=2)
        s.connect(third.y.positive, fourth.u.whole)
        s.connect(third.y.third, fourth.u.single)
        s.connect(fourth.y.third, third.u.double)
        first = s.add("first", native_fmu("binary_passer", 3), u=b"some bytes\0, a zero among them")
        second = s.add("second", native_fmu("binary_passer", 3), period=Fraction(1, 5))
        s.connect(first.y.y, second.u.u)
        return s

    expect_alike(build, SECOND, tmp_path, options, isolated)


@pytest.mark.parametrize(
    ("build", "algorithm", "some"),
    [(bouncing, Algorithm.GAUSS_SEIDEL, ("ball", "slow")), (counting, Algorithm.JACOBI, ("slow",))],
)
def test_events_and_clocks(build: Build, algorithm: Algorithm, some: tuple[str, ...], tmp_path: Path):
    expect_alike(build, 2 * SECOND, tmp_path, {"algorithm": algorithm}, some, ("all",))


@pytest.mark.parametrize(("fmi", "repeats"), [(2, False), (3, True)])
def test_a_step_that_is_discarded(fmi: int, repeats: bool, tmp_path: Path):
    def build() -> System:
        s = System()
        s.add("short", native_fmu("discards", fmi))
        s.add("other", native_fmu("integrator"), u=1.0)
        return s

    expect_alike(build, SECOND, tmp_path, {"repeat_discarded": repeats}, ("short",), ("all",))


@pytest.mark.parametrize(("into", "options"), [((), PLAN), (("all",), GENERAL)], ids=["together", "isolated"])
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


@pytest.mark.parametrize("isolated", [(), ("right",), ("left", "right"), ("foreign",)])
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
    assert isolated_units(system, isolated) == {"left", "right"} | ({"other"} if isolated == ("foreign",) else set())
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
