"""Samples of inputs from outside pass from one process to another, whole, with their age."""

import multiprocessing
import subprocess
import sys
import threading
import time
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
import pytest
from support.wording import Wording

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.live.process import PageInputs, _let_go_without
from handover.scenarios.live.shared_inputs import NEVER, SharedInputs, UnknownInput

SIZES = {"person.p": 3, "person.closed": 1, "push.f": 40}


def inputs_in(folder: Path) -> SharedInputs:
    return SharedInputs.create(folder / "inputs", SIZES, ["person.age"])


def test_a_sample_is_used_with_its_age_and_what_it_does_not_say_holds_on(tmp_path: Path):
    written = inputs_in(tmp_path)
    sources = SharedInputs(tmp_path / "inputs").sources()
    assert set(sources) == {*SIZES, "person.age"}
    assert sources["person.p"].at(0.0) is None
    assert sources["person.age"].at(0.0) == [NEVER]
    stamps = [time.monotonic() - age for age in (0.5, 0.1)]
    assert written.set({"person.p": [1.0, 2.0, 3.0]}, stamps[0]) == 1
    assert sources["person.closed"].at(0.016) is None
    np.testing.assert_array_equal(sources["person.p"].at(0.016), [1.0, 2.0, 3.0])
    (age,) = sources["person.age"].at(0.016) or [0.0]
    assert 0.5 <= age < 30.0
    assert written.set({"person.closed": True}, stamps[1]) == 2
    assert sources["person.closed"].at(0.016) is None, "all of a communication point is of one sample"
    np.testing.assert_array_equal(sources["person.closed"].at(0.032), [1.0])
    np.testing.assert_array_equal(sources["person.p"].at(0.032), [1.0, 2.0, 3.0])
    assert (sources["person.age"].at(0.032) or [NEVER])[0] < age
    uses = written.uses()
    for name, used in (("t", [0.016, 0.032]), ("number", [1, 2]), ("stamp", stamps)):
        np.testing.assert_array_equal(uses[name], used)
    assert (np.diff(written.ages()) < 0.0).all()


def test_of_a_long_run_the_last_uses_are_reported(tmp_path: Path):
    inputs = inputs_in(tmp_path)
    for k in range(20_000):
        inputs.note_use(0.016 * k, k + 1, 0.0, 1.0)
    numbers = inputs.uses()["number"]
    assert numbers[-1] == 20_000
    assert len(numbers) > 15_000
    assert (np.diff(numbers) == 1).all()


@pytest.mark.parametrize(
    ("entries", "stamp"),
    [
        pytest.param({"person.p": [1.0, 2.0]}, 0.0, id="too few values"),
        pytest.param({"person.p": [1.0, 2.0, np.nan]}, 0.0, id="no number"),
        pytest.param({"person.p": [1.0, 2.0, 3.0]}, np.inf, id="a stamp for ever"),
        pytest.param({"person.q": 1.0}, 0.0, id="another input"),
    ],
)
def test_a_sample_that_cannot_be_is_refused_whole(
    tmp_path: Path, entries: dict[str, list[float]], stamp: float, wording: Wording
):
    inputs = inputs_in(tmp_path)
    with pytest.raises((ValueError, UnknownInput)) as refused:
        inputs.set({"person.closed": 1.0, **entries}, stamp)
    wording.check(refused.value)
    assert inputs.read() is None


def _write(path: Path, enough: Event) -> None:
    inputs, k = SharedInputs(path), 0
    while not enough.is_set():
        k += 1
        inputs.set({"person.p": [k] * 3, "person.closed": k % 2, "push.f": [-k] * 40}, time.monotonic())


def test_no_sample_is_torn_between_two_processes(tmp_path: Path):
    inputs, context = inputs_in(tmp_path), multiprocessing.get_context("fork")
    enough = context.Event()
    writer = context.Process(target=_write, args=(tmp_path / "inputs", enough), daemon=True)
    writer.start()
    sources, seen, point = inputs.sources(), set[float](), 0
    while len(seen) < 1000:
        assert writer.is_alive()
        point += 1
        p = sources["person.p"].at(float(point))
        closed, f = sources["person.closed"].at(float(point)), sources["push.f"].at(float(point))
        if p is None or closed is None or f is None:
            continue
        assert set(np.asarray(p).tolist()) == {p[0]}
        assert closed[0] == p[0] % 2
        assert set(np.asarray(f).tolist()) == {-p[0]}
        seen.add(float(p[0]))
    enough.set()
    writer.join()
    assert writer.exitcode == 0
    assert inputs.ages().max() < 30.0


def test_a_writer_that_was_killed_within_a_sample_stops_no_reader(tmp_path: Path):
    inputs = inputs_in(tmp_path)
    sources = inputs.sources()
    inputs.set({"person.closed": 1.0}, time.monotonic())
    np.testing.assert_array_equal(sources["person.closed"].at(0.0), [1.0])
    inputs._sample["begun"] = 2  # type: ignore
    inputs._values[3] = 0.0  # type: ignore
    np.testing.assert_array_equal(sources["person.closed"].at(0.016), [1.0])
    assert SharedInputs(tmp_path / "inputs").set({"person.closed": 0.0}, time.monotonic()) == 3
    np.testing.assert_array_equal(sources["person.closed"].at(0.032), [0.0])


@pytest.mark.parametrize("status", [0, 1])
def test_a_run_goes_on_without_a_server_that_fails_and_not_without_one_that_ends_after_it(status: int, tmp_path: Path):
    control = LiveControl.create(tmp_path / "control", 1.0, paused=True)
    server = subprocess.Popen([sys.executable, "-c", f"raise SystemExit({status})"])
    _let_go_without(server, control, PageInputs.create(tmp_path, {"push": 3}, None), threading.Event())
    assert control.paused == (status == 0)
