"""What goes wrong as a round is played: it is void, or goes on, but never counts as what it was not."""

import asyncio
import contextlib
import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from support.processes import with_argument
from support.scenarios.sample_study import record
from support.scenarios.study_server import (
    HAND,
    PLAN,
    EndlessTrial,
    act,
    page_at,
    page_of,
    reported,
    served,
    server_of,
    to_round,
    without_runs,  # noqa: F401
)
from support.wording import Wording
from websockets.sync.client import ClientConnection

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.session import seat as seat_module
from handover.scenarios.study.session.practice import Reached
from handover.scenarios.study.session.protocol import Protocol
from handover.scenarios.study.session.screen_content import VoidCause
from handover.scenarios.study.session.served_study import line_of_round
from handover.scenarios.study.session.trial import Frame


@pytest.mark.usefixtures("without_runs")
def test_samples_that_cannot_be_used_are_refused_and_the_round_goes_on(tmp_path: Path, wording: Wording):
    with page_of(server_of(tmp_path / "study")) as page:
        to_round(page)
        page.send(json.dumps({"hand": {**HAND, "stamp": 0.9}}))
        wrong = ({"p_WH": [1.0, 0.0]}, {"p_WH": [9.0, 0.0, 0.0]}, {"stamp": "now"}, {"stamp": 0.5})
        for message in (*({"hand": {**HAND, "stamp": 1.0, **sample}} for sample in wrong), {"drawn": [-1.0]}):
            page.send(json.dumps(message))
            wording.check(reported(page, "refused"))
        seen = time_seen(page)
        assert time_seen(page) > seen
    assert StudyFolder.opened(tmp_path / "study", PLAN).session(1).records == {}


def time_seen(page: ClientConnection) -> float:
    """Return the simulated time of the next state of the run, s."""
    while isinstance(message := page.recv(timeout=60), str):
        assert "void" not in message
    return float(np.frombuffer(message, dtype="<f8")[0])


RATINGS = {"S1": 7, "S2": 8, "S3": 9}


@pytest.mark.usefixtures("without_runs")
def test_a_page_that_is_closed_makes_its_round_void_and_it_is_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(EndlessTrial, "closing", 0.5)
    server = server_of(tmp_path / "study")
    with served(server) as where:
        with page_at(where) as page:
            to_round(page)
            page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
        with page_at(where) as reloaded:  # while the run of the page that has gone is ended
            assert reported(reloaded, "screen")["screen"] == "void"
    attempts = StudyFolder.opened(tmp_path / "study", PLAN).session(1).notes.void_attempts
    assert [(a.number, a.attempt) for a in attempts] == [(1, 1)], attempts
    assert "the page was closed" in attempts[0].reason
    assert server.seat.protocol.screen == "void"


@pytest.mark.usefixtures("without_runs")
def test_who_withdraws_in_a_round_sees_nothing_but_that_and_no_attempt_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(seat_module, "SILENCE", 0.2)
    monkeypatch.setattr(EndlessTrial, "closing", 0.5)  # the silence passes while the run is ended
    with page_of(server_of(tmp_path / "study")) as page:
        to_round(page)
        page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
        act(page, "withdraw")
        assert reported(page, "screen")["screen"] == "withdrawn"
        page.send('{"clock": 1.0}')  # nothing else is shown after it
        with contextlib.suppress(TimeoutError):
            while message := page.recv(timeout=0.5):
                assert not isinstance(message, str) or "screen" not in json.loads(message), message
    session = StudyFolder.opened(tmp_path / "study", PLAN).session(1)
    assert session.notes.withdrawn is not None
    assert session.notes.void_attempts == []


@pytest.mark.usefixtures("without_runs")
def test_a_device_that_falls_silent_makes_the_round_void(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(seat_module, "SILENCE", 0.5)
    with page_of(server_of(tmp_path / "study")) as page:
        to_round(page)
        shown = reported(page, "screen")
        assert shown["screen"] == "void"
        assert "no sample of the hand" in shown["reason"]
        act(page, "next")
        assert reported(page, "screen")["round"] == 1


class RecordedTrial:
    """A trial of one state, whose process exits some polls after it."""

    hand, scene, newest, led = HAND, "a scene", None, None

    def __init__(self) -> None:
        self._states, self._polls = 1, 21

    def scene_content(self) -> dict[str, Any]:
        return {}

    def go(self) -> None:
        pass

    @property
    def is_running(self) -> bool:
        self._polls -= 1
        return self._polls >= 0

    def frame(self, *, always: bool = False) -> Frame | None:
        self._states -= 0 if always else 1
        return Frame(0.0, 0.0, np.zeros(0)) if always or self._states >= 0 else None


def test_silence_does_not_count_while_the_runs_process_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(seat_module, "SILENCE", 0.1)
    seat: Any = server_of(tmp_path / "study").seat

    async def told_why() -> str | None:
        playing = asyncio.ensure_future(seat._run(RecordedTrial()))
        seat._playing = playing
        await asyncio.sleep(0.0)
        await asyncio.sleep(0.0)
        seat._page_ready.set()
        return await playing

    assert VoidCause.NO_SAMPLE.value not in (asyncio.run(told_why()) or "")


@pytest.mark.slow
def test_a_run_that_is_killed_makes_its_round_void(tmp_path: Path):
    server = server_of(tmp_path / "study")
    with served(server) as where, page_at(where) as page:
        to_round(page)
        page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
        assert time_seen(page) >= 0.0
        (trial,) = with_argument(os.getpid(), "handover.scenarios.study.session")
        os.kill(trial, signal.SIGKILL)
        shown = reported(page, "screen")
        assert (shown["screen"], shown["again"]) == ("void", True)
        assert "the simulation's process ended (killed by signal 9)" in shown["reason"]
    assert StudyFolder.opened(tmp_path / "study", PLAN).session(1).records == {}


def choose_mouse(protocol: Protocol) -> None:
    for action, value in (("language", "en"), ("consent", True), ("eligibility", [True] * 3), ("device", "mouse")):
        protocol.act(action, value)


def test_who_sits_down_after_a_withdrawal_has_practised_nothing(tmp_path: Path):
    seat = server_of(tmp_path / "study").seat
    for _ in range(2):
        choose_mouse(seat.protocol)
        assert seat.practice.done == 0.0
        assert seat.practice.test.reached == []
        seat.practice.done = 100.0
        seat.practice.test.reached.append(Reached("+x", 1.0))
        assert seat.practice.done == 100.0
        seat.protocol.act("withdraw")
        seat.protocol.act("next")


def test_a_round_that_cannot_be_kept_is_reported_and_can_be_played_again(tmp_path: Path):
    seat = server_of(tmp_path / "study").seat
    protocol = seat.protocol
    choose_mouse(protocol)
    protocol.act("begin")
    in_the_way = protocol.study.session(1).path / "rounds" / "01.json"
    in_the_way.mkdir()
    seat.keep(None, record(), is_round=True)
    assert protocol.screen == "void"
    assert "it could not be kept" in protocol.void_reason
    in_the_way.rmdir()
    protocol.act("next")
    protocol.act("begin")
    tables = protocol.study.session(1).path / "rounds.csv"
    tables.unlink()
    tables.mkdir()
    seat.keep(None, record(), is_round=True)
    assert protocol.screen == "rating"
    with pytest.raises(RecordNotWritten):
        protocol.act("rate", RATINGS)
    tables.rmdir()
    protocol.act("rate", RATINGS)
    assert (protocol.screen, protocol.content()["round"]) == ("instruction", 2)
    assert len(pd.read_csv(tables)) == 1


def test_a_round_that_the_servers_end_broke_off_is_an_attempt_in_the_tables(tmp_path: Path):
    protocol = server_of(tmp_path / "study").seat.protocol
    choose_mouse(protocol)
    protocol.act("begin")
    session = protocol.study.session(1)
    session.run_folder(1).mkdir(parents=True)  # then the server was killed
    again = server_of(tmp_path / "study").seat.protocol
    again.act("continue", 1)
    assert again.screen == "void"
    again.act("next")
    assert (again.screen, again.content()["round"]) == ("instruction", 1)
    session.run_folder(1).mkdir()  # is made ready, and not begun when the server is killed once more
    again = server_of(tmp_path / "study").seat.protocol
    again.act("continue", 1)
    assert again.screen == "instruction"
    again.act("begin")
    again.void_round("the page was closed")
    table: Any = pd.read_csv(session.path / "void_attempts.csv")
    assert table["attempt"].tolist() == [1, 2]
    assert table["reason"].tolist() == ["the study's server ended before the round did", "the page was closed"]
    assert table["folder"].tolist() == ["01_unfinished_1", "01_unfinished_2"]


def test_the_experimenter_sees_what_became_of_each_round(tmp_path: Path, wording: Wording):
    seat = server_of(tmp_path / "study").seat
    seat.on_round_end = lambda planned, ended: wording.check(line_of_round(PLAN, 1, planned, ended))
    choose_mouse(seat.protocol)
    seat.protocol.act("begin")
    seat.keep("the page was closed", is_round=True)
    seat.protocol.act("next")
    for latency in (90.0, 376.0):
        seat.protocol.act("begin")
        seat.keep(None, record(latency=latency), is_round=True)
        seat.protocol.act("rate", RATINGS)
    assert seat.protocol.content()["round"] == 3
