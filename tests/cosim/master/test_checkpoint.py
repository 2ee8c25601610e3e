import contextlib
import json
import os
import struct
import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cosim import checkpointed_runs
from support.cosim.checkpointed_runs import checkpoint_of, record_of, resume, run
from support.cosim.event_systems import BOUNCING, COUNTING, bouncing, counting
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import native_fmu
from support.processes import program, with_path

from handover.cosim.exceptions import CosimError
from handover.cosim.master.checkpoint import (
    Checkpoint,
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
from handover.cosim.system.signals import ObserveAfter, Signals
from handover.cosim.system.system import System


def test_a_run_that_was_killed_goes_on_to_the_same_bytes(tmp_path: Path):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    whole.mkdir()
    killed.mkdir()
    run(whole)
    command = program("cosim/checkpointed_runs.py", killed)
    with subprocess.Popen(
        command, env=with_path(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "passed\n"
        process.kill()
    complete_record(record_of(killed))
    assert checkpointed_runs.PASSED <= Record(record_of(killed)).time[-1] <= checkpointed_runs.WAITS + 0.02
    assert resume(killed) == 7.0
    for name in ("signals.parquet", "signals.csv"):
        assert (killed / name).read_bytes() == (whole / name).read_bytes()
    assert sorted(os.listdir(killed)) == sorted(os.listdir(whole))


def test_a_checkpoint_is_written_at_the_first_communication_point_that_is_not_before_it(tmp_path: Path):
    s = System()
    s.add("sine", native_fmu("sine"), period=Fraction(1, 3))
    times: list[float] = []
    with Master(s) as master, Recorder(record_of(tmp_path)) as recorder:
        write = checkpointed_runs.Checkpointer(
            checkpoint_of(tmp_path), Fraction(1, 2), master, recorder, lambda: times.append(master.time) or b""
        )
        master.run(Fraction(3), [recorder, write])
    assert times == [2 / 3, 1.0, 5 / 3, 2.0, 8 / 3, 3.0]


def test_a_checkpoint_that_cannot_be_written_is_reported_and_the_run_goes_on(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    s = System()
    s.add("sine", native_fmu("sine"))
    checkpoint_of(tmp_path).mkdir()
    with Master(s) as master, Recorder(record_of(tmp_path)) as recorder:
        write = checkpointed_runs.Checkpointer(checkpoint_of(tmp_path), Fraction(1), master, recorder)
        master.run(Fraction(3, 2), [recorder, write])
        assert master.time == 1.5
    assert "checkpoint.zip cannot be written at t = 1 s, the former one stays: Is a directory" in caplog.text


@pytest.mark.parametrize(
    "options",
    [
        *(MasterOptions(algorithm=algorithm, cpu_times=True) for algorithm in Algorithm),
        MasterOptions(compiled=False, extrapolation=Extrapolation.LINEAR, cpu_times=True),
        MasterOptions(adaptive=AdaptiveStep(), extrapolation=Extrapolation.LINEAR, cpu_times=True),
        MasterOptions(repeat_discarded=True, cpu_times=True),
    ],
    ids=[*(algorithm.value for algorithm in Algorithm), "linear", "adaptive", "events"],
)
def test_a_run_goes_on_from_any_communication_point(tmp_path: Path, options: MasterOptions):
    points: list[Checkpoint] = []
    with Master(checkpointed_runs.oscillator(), options) as master, Recorder(tmp_path / "whole.parquet") as recorder:
        master.run(Fraction(1, 5), [recorder, lambda _t, _s: points.append(take_checkpoint(master, recorder.rows))])
    whole = Record(tmp_path / "whole.parquet")
    for c in points[:-1:2]:
        with Master(checkpointed_runs.oscillator(), options) as master, Recorder(tmp_path / "rest.parquet") as recorder:
            c.restore(master)
            assert len(master.cpu["a"]) == len(c.cpu["a"]) // 8
            master.run(Fraction(1, 5), [recorder])
        rest = Record(tmp_path / "rest.parquet")
        for name in ("a.x", "b.v", "between.f1"):
            assert rest[name].tolist() == whole[name].tolist()[c.rows - 1 :], (c.time, name)


@pytest.mark.parametrize("stops", [(Fraction(1),), (Fraction(1, 4), Fraction(1))])
def test_a_plan_that_goes_on_writes_the_record_by_itself(
    stops: tuple[Fraction, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Rows of Python's are the first of each run at most; 1/4 s is where no unit is due."""
    rows: list[float] = []
    add = Recorder.__call__

    def adding(self: Recorder, t: float, signals: Signals) -> None:
        rows.append(t)
        add(self, t, signals)

    monkeypatch.setattr(Recorder, "__call__", adding)
    file, compare = record_of(tmp_path), tmp_path / "whole.parquet"
    with Master(checkpointed_runs.oscillator()) as master, Recorder(compare) as recorder:
        for stop in (Fraction(1, 7), *stops):
            master.run(stop, [recorder])
    with Master(checkpointed_runs.oscillator()) as master, Recorder(file) as recorder:
        master.run(Fraction(1, 7), [recorder])
        c = take_checkpoint(master, recorder.rows)
    rows.clear()
    with Master(checkpointed_runs.oscillator()) as master, Recorder(tmp_path / "rest.parquet") as recorder:
        c.restore(master)
        for stop in stops:
            master.run(stop, [ObserveAfter(c.time, recorder)])
    assert len(rows) <= len(stops)
    whole, rest = Record(compare), Record(tmp_path / "rest.parquet")
    assert [*rest.time] == [*whole.time[c.rows :]]
    assert [*rest["a.x"]] == [*whole["a.x"][c.rows :]]


def test_pictures_and_truths_that_a_buffer_held_are_there_again(fmu: FmuOf):
    s = System()
    counter, echo = s.add("counter", fmu("Counter")), s.add("echo", fmu("Echo"), period=Fraction(3, 10))
    for name in ("n", "odd", "light", "pair", "picture"):
        s.connect(getattr(counter.y, name), getattr(echo.u, name))
    with Master(s) as master:
        master.run(Fraction(1, 2))
        c = take_checkpoint(master, 0)
        facts = {n: master.signals[n].tolist() for n in ("counter.picture", "counter.odd", "echo.brightness")}
        master.run(Fraction(1))
        later = {n: master.signals[n].tolist() for n in ("counter.picture", "counter.n", "echo.brightness")}
    with Master(s) as master:
        c.restore(master)
        assert {n: master.signals[n].tolist() for n in facts} == facts
        assert master.signals.text("counter.light") == "GREEN"
        master.run(Fraction(1))
        assert {n: master.signals[n].tolist() for n in later} == later


def test_units_that_do_not_save_their_states_are_refused_by_name():
    s = System()
    s.add("able", native_fmu("sine"))
    s.add("unable", native_fmu("sine", canGetAndSetFMUState=False))
    s.add("mute", native_fmu("sine", 2, canSerializeFMUstate=False))
    with pytest.raises(StateNotSaved) as caught:
        check_states(s)
    assert list(caught.value.units) == ["unable", "mute"]
    assert "lacks canGetAndSetFMUState" in caught.value.units["unable"]
    assert "lacks canSerializeFMUstate" in caught.value.units["mute"]


def test_what_is_read_is_what_was_written(tmp_path: Path):
    file = tmp_path / "checkpoint.zip"
    write_checkpoint(file, _some())
    assert read_checkpoint(file) == _some()


def test_a_missing_checkpoint_is_reported(tmp_path: Path):
    with pytest.raises(InvalidCheckpoint, match="there is no checkpoint; a run writes them with --checkpoint"):
        read_checkpoint(tmp_path / "checkpoint.zip")


def test_a_checkpoint_of_another_version_is_reported(tmp_path: Path):
    file = tmp_path / "checkpoint.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("checkpoint.json", '{"format": 1}')
    with pytest.raises(InvalidCheckpoint, match="of format 1; format 2 can be read"):
        read_checkpoint(file)


@given(st.data())
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
    with contextlib.suppress(InvalidCheckpoint):
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


def _some(kept: bytes = b"kept") -> Checkpoint:
    return Checkpoint(
        time=0.1,
        rows=3,
        stepper={"tick": 7},
        units={"a/../b": b"\0state"},
        contents={"a/../b": [[b"y"], []]},
        cpu={"a/../b": b"\0" * 8},
        kept=kept,
    )


@pytest.mark.parametrize(
    ("part", "fault"),
    [
        ({"cpu": {name: np.array([np.nan]).tobytes() for name in ("a", "b", "between")}}, "CPU times of a"),
        ({"stepper": {"tick": 10**17, "due": dict.fromkeys(("a", "b", "between"), 10**17)}}, "its steps reach"),
        ({"stepper": {"due": {"a": -1, "b": 2**40, "between": 2**40}}}, "steps of a are due before its time"),
        ({"time": 9.0}, "its time is 9 s"),
    ],
    ids=["cpu", "tick", "due", "time"],
)
def test_a_checkpoint_whose_parts_contradict_each_other_is_refused(part: dict[str, Any], fault: str):
    with Master(checkpointed_runs.oscillator(), stop=Fraction(1)) as master:
        master.run(Fraction(1, 5), [])
        c = take_checkpoint(master, 5)
    changed: dict[str, Any] = {**part, "stepper": {**c.stepper, **part.get("stepper", {})}}
    with Master(checkpointed_runs.oscillator(), stop=Fraction(1)) as master, pytest.raises(CosimError, match=fault):
        replace(c, **changed).restore(master)


def test_parts_of_a_checkpoint_that_overlap_are_refused(tmp_path: Path):
    """Each of many parts may be as long as the file, and all of them be kept."""
    write_checkpoint(tmp_path / "checkpoint.zip", _some(bytes(1000)))
    content = bytearray((tmp_path / "checkpoint.zip").read_bytes())
    at = content.rindex(b"PK\1\2")  # its size, as the list of members has it
    content[at + 20 : at + 28] = struct.pack("<2L", *[len(content)] * 2)
    (tmp_path / "checkpoint.zip").write_bytes(content)
    with pytest.raises(InvalidCheckpoint, match="its parts overlap"):
        read_checkpoint(tmp_path / "checkpoint.zip")


@pytest.mark.parametrize("algorithm", [Algorithm.JACOBI, Algorithm.GAUSS_SEIDEL])
@pytest.mark.parametrize(("build", "names"), [(bouncing, BOUNCING), (counting, COUNTING)])
def test_a_run_with_events_goes_on_from_a_checkpoint(
    build: Callable[[], System], names: tuple[str, ...], algorithm: Algorithm
):
    """Taken at the start, between events, at the impact at 0.45 s, and behind it."""
    options, taken = MasterOptions(algorithm=algorithm), list[Checkpoint]()
    whole: dict[float, tuple[float, ...]] = {}
    with Master(build(), options) as master:

        def observe(t: float, y: Signals) -> None:
            whole[t] = tuple(float(y[n]) for n in names)
            if len(taken) < 4 and t >= (0.0, 0.3, 0.45, 0.62)[len(taken)]:
                taken.append(take_checkpoint(master, len(whole)))
                json.dumps(taken[-1].stepper)

        master.run(Fraction(2), [observe])
    assert len(taken) == 4
    for checkpoint in taken:
        rows: dict[float, tuple[float, ...]] = {}
        with Master(build(), options) as master:
            checkpoint.restore(master)
            master.run(Fraction(2), [lambda t, y, rows=rows: rows.update({t: tuple(float(y[n]) for n in names)})])
        assert rows == {t: values for t, values in whole.items() if t >= checkpoint.time}
