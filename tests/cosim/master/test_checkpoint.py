import os
import shutil
import struct
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.cosim.checkpointed_runs import checkpoint_of, oscillator, record_of, resume, run
from support.cosim.event_systems import BOUNCING, COUNTING, bouncing, counting
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import CosimError
from handover.cosim.master.checkpoint import (
    Checkpoint,
    Checkpointer,
    InvalidCheckpoint,
    StateNotSaved,
    check_states,
    read_checkpoint,
    take_checkpoint,
    write_checkpoint,
)
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.record.stream import complete_record
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.signals import ObserveAfter, Observer, Signals
from handover.cosim.system.system import System


def test_a_run_that_was_killed_goes_on_to_the_same_bytes(tmp_path: Path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    whole.mkdir()

    def leave_what_a_kill_would(t: float, _y: object) -> None:
        if t >= 10.4 and not killed.exists():  # behind the checkpoint at 7 s, before the next one at 10.5 s
            shutil.copytree(whole, killed)

    run(whole, leave_what_a_kill_would)
    complete_record(record_of(killed))
    assert Record(record_of(killed)).time[-1] == 10.4
    assert resume(killed) == 7.0
    for name in ("signals.parquet", "signals.csv"):
        assert (killed / name).read_bytes() == (whole / name).read_bytes()
    assert sorted(os.listdir(killed)) == sorted(os.listdir(whole))


@pytest.mark.parametrize(
    ("every", "wanted"),
    [
        (Fraction(1, 2), [2 / 3, 1.0, 5 / 3, 2.0, 8 / 3, 3.0]),
        (Fraction(1, 10**300), [k / 3 for k in range(1, 10)]),
    ],
    ids=["half", "tiny"],
)
def test_a_checkpoint_is_written_at_the_first_communication_point_that_is_not_before_it(
    every: Fraction, wanted: list[float], tmp_path: Path
):
    s = System()
    s.add("sine", native_fmu("sine"), period=Fraction(1, 3))
    times: list[float] = []
    with Master(s) as master, Recorder(record_of(tmp_path)) as recorder:
        path = checkpoint_of(tmp_path)
        write = Checkpointer(path, every, master, recorder, lambda: times.append(master.time) or b"")
        master.run(Fraction(3), [recorder, write])
    assert times == wanted


def test_a_checkpoint_that_cannot_be_written_is_reported_and_the_run_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    s = System()
    s.add("sine", native_fmu("sine"))
    checkpoint_of(tmp_path).mkdir()
    with Master(s) as master, Recorder(record_of(tmp_path)) as recorder:
        write = Checkpointer(checkpoint_of(tmp_path), Fraction(1), master, recorder)
        master.run(Fraction(3, 2), [recorder, write])
        assert master.time == 1.5
    assert "checkpoint.zip cannot be written at t = 1 s, the former one stays: Is a directory" in caplog.text


MOTION, LINEAR = ("a.x", "b.v", "between.f1"), Extrapolation.LINEAR
FIXED_POINT = Algorithm.FIXED_POINT  # which keeps what Newton's keeps


@pytest.mark.parametrize(
    ("build", "names", "options"),
    [
        *(pytest.param(oscillator, MOTION, {"algorithm": a}, id=a.value) for a in Algorithm if a is not FIXED_POINT),
        pytest.param(oscillator, MOTION, {"compiled": False, "extrapolation": LINEAR}, id="linear"),
        pytest.param(oscillator, MOTION, {"adaptive": AdaptiveStep(), "extrapolation": LINEAR}, id="adaptive"),
        pytest.param(bouncing, BOUNCING, {}, id="events"),
        pytest.param(counting, COUNTING, {"algorithm": Algorithm.JACOBI}, id="clocks"),
    ],
)
def test_a_run_goes_on_from_a_checkpoint(
    build: Callable[[], System], names: tuple[str, ...], options: dict[str, Any], tmp_path: Path
):
    """Taken at the start, at the ball's impact at 0.45 s, and behind it, amid steps of slow units."""
    taken = list[Checkpoint]()
    rows: dict[float, tuple[float, ...]] = {}

    def run_on(master: Master, *others: Observer) -> tuple[object, ...]:
        rows.clear()
        master.run(Fraction(6, 5), [lambda t, y: rows.update({t: tuple(float(y[n]) for n in names)}), *others])
        return dict(rows), str(master.iterations), getattr(master.stepper, "statistics", None)

    def take(t: float, _y: object) -> None:
        if len(taken) < 3 and t >= (0.0, 0.45, 0.62)[len(taken)]:
            taken.append(take_checkpoint(master, len(rows)))

    with Master(build(), MasterOptions(cpu_times=True, **options)) as master:
        whole, *counts = run_on(master, take)
    assert isinstance(whole, dict)
    assert len(taken) == 3
    for checkpoint in taken:
        write_checkpoint(tmp_path / "checkpoint", checkpoint)
        with Master(build(), MasterOptions(cpu_times=True, **options)) as master:
            read_checkpoint(tmp_path / "checkpoint").restore(master)
            assert {name: len(master.cpu[name]) * 8 for name in checkpoint.cpu} == {
                name: len(spent) for name, spent in checkpoint.cpu.items()
            }
            rest, *others = run_on(master)
        assert rest == {t: values for t, values in whole.items() if t >= checkpoint.time}
        assert others == counts


def test_a_plan_that_goes_on_writes_the_record_by_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Rows of Python's are the first of each run at most; 1/4 s is where no unit is due."""
    rows: list[float] = []
    add = Recorder.__call__

    def noted(self: Recorder, t: float, y: Signals) -> None:
        rows.append(t)
        add(self, t, y)

    monkeypatch.setattr(Recorder, "__call__", noted)
    with Master(oscillator()) as master:
        master.run(Fraction(1, 7), [])
        c = take_checkpoint(master, 0)
    with Master(oscillator()) as master, Recorder(tmp_path / "rest.parquet") as recorder:
        c.restore(master)
        for stop in (Fraction(1, 4), Fraction(1)):
            master.run(stop, [ObserveAfter(c.time, recorder)])
        assert len(rows) <= 2
        assert recorder.rows > 50


def test_pictures_and_truths_that_a_buffer_held_are_there_again(fmu: FmuOf):
    s = System()
    counter, echo = s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"), period=Fraction(3, 10))
    for name in ("n", "odd", "light", "pair", "picture"):
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    names = ("counter.picture", "counter.odd", "counter.n", "echo.brightness")

    def facts(master: Master) -> list[object]:
        return [master.signals.text("counter.light"), *(master.signals[n].tolist() for n in names)]

    with Master(s) as master:
        master.run(Fraction(1, 2))
        c, at_it = take_checkpoint(master, 0), facts(master)
        master.run(Fraction(1))
        later = facts(master)
    with Master(s) as master:
        c.restore(master)
        assert facts(master) == at_it
        assert at_it[0] == "GREEN"
        master.run(Fraction(1))
        assert facts(master) == later


def test_units_that_do_not_save_their_states_are_refused_by_name():
    s = System()
    s.add("able", native_fmu("sine"))
    s.add("unable", native_fmu("sine", canGetAndSetFMUState=False))
    s.add("mute", native_fmu("sine", 2, canSerializeFMUstate=False))
    with pytest.raises(StateNotSaved) as caught:
        check_states(s)
    assert list(caught.value.units) == ["unable", "mute"]
    for name, flag in (("unable", "canGetAndSetFMUState"), ("mute", "canSerializeFMUstate")):
        assert caught.value.units[name].endswith(f".fmu lacks {flag}")


def _some(kept: bytes = b"kept") -> Checkpoint:
    contents: dict[str, Any] = {"a/../b": [[b"y"], []]}
    units, cpu = {"a/../b": b"\0state"}, {"a/../b": b"\0" * 8}
    return Checkpoint(time=0.1, rows=3, stepper={"tick": 7}, units=units, contents=contents, cpu=cpu, kept=kept)


def test_what_is_no_checkpoint_is_refused(tmp_path: Path, wording: Wording):
    """Each of many parts that overlap may be as long as the file, and all of them be kept."""
    missing, other, overlapping = (tmp_path / f"{name}.zip" for name in ("missing", "other", "overlapping"))
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("checkpoint.json", '{"format": 1}')
    write_checkpoint(overlapping, _some(bytes(1000)))
    content = bytearray(overlapping.read_bytes())
    at = content.rindex(b"PK\1\2")  # its size, as the list of members has it
    content[at + 20 : at + 28] = struct.pack("<2L", *[len(content)] * 2)
    overlapping.write_bytes(content)
    for file in (missing, other, overlapping):
        with pytest.raises(InvalidCheckpoint) as caught:
            read_checkpoint(file)
        wording.check(caught.value)


@pytest.mark.parametrize(
    "stepper",
    [
        {"now": "1e999999999"},
        {"due": {"a": "1e999999999"}},
        {"courses": {"a": ["0", "1e999999999", False]}},
        {"units": {"a": {"ticks": {"clock": "1e999999999"}}}},
        {"statistics": {"accepted": 1, "rejected": "x", "shortest": 0.1, "longest": 0.2}},
        {"statistics": {"accepted": 1, "rejected": 0, "shortest": None, "longest": 0.2}},
    ],
    ids=lambda stepper: next(iter(stepper)),
)
def test_times_and_counts_of_a_stepper_are_checked_when_they_are_read(stepper: dict[str, Any], tmp_path: Path):
    write_checkpoint(tmp_path / "c.zip", replace(_some(), stepper=stepper))
    with pytest.raises(InvalidCheckpoint, match=next(iter(stepper))):
        read_checkpoint(tmp_path / "c.zip")


@given(st.data())
@settings(max_examples=40)
def test_a_damaged_checkpoint_is_reported_or_is_what_was_written(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
):
    file = tmp_path_factory.mktemp("damaged") / "checkpoint.zip"
    write_checkpoint(file, _some())
    content = bytearray(file.read_bytes())
    if data.draw(st.booleans(), "cut off"):
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    file.write_bytes(content)
    with suppress(InvalidCheckpoint):
        assert read_checkpoint(file) == _some()


@pytest.mark.parametrize("size", range(0, 2000, 393))
def test_a_checkpoint_that_cannot_be_written_leaves_the_former_one(tmp_path: Path, size: int):
    resource = pytest.importorskip("resource")
    file = tmp_path / "checkpoint.zip"
    write_checkpoint(file, _some())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            write_checkpoint(file, _some(b"x" * 5000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert read_checkpoint(file) == _some()
    assert os.listdir(tmp_path) == [file.name]


UNITS = ("a", "b", "between")


@pytest.mark.parametrize(
    "part",
    [
        pytest.param({"cpu": {name: np.array([np.nan]).tobytes() for name in UNITS}}, id="cpu"),
        pytest.param({"stepper": {"tick": 10**17, "due": dict.fromkeys(UNITS, 10**17)}}, id="tick"),
        pytest.param({"stepper": {"due": {"a": -1, "b": 2**40, "between": 2**40}}}, id="due"),
        pytest.param({"time": 9.0}, id="time"),
    ],
)
def test_a_checkpoint_whose_parts_contradict_each_other_is_refused(part: dict[str, Any], wording: Wording):
    with Master(oscillator(), stop=Fraction(1)) as master:
        master.run(Fraction(1, 5), [])
        c = take_checkpoint(master, 5)
        changed: dict[str, Any] = {**part, "stepper": {**c.stepper, **part.get("stepper", {})}}
        with pytest.raises(CosimError) as caught:
            replace(c, **changed).restore(master)
    wording.check(caught.value)
