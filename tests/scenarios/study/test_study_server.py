"""Who is not a study's page is refused, and what a page sends that it should not; a round is void, never wrong."""

import asyncio
import contextlib
import json
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import psutil
import pytest
import uvicorn
from sample_study import record
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import ServerConnection, serve

from handover.cosim.exceptions import RecordNotWritten
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.led_hands import hand_faults
from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session import seat as seat_module
from handover.scenarios.study.session.device_test import Reached
from handover.scenarios.study.session.pilot import PilotRefused, SeenScene, play_sessions
from handover.scenarios.study.session.protocol import Protocol
from handover.scenarios.study.session.seat import StudySeat
from handover.scenarios.study.session.server import StudyServer, uvicorn_config

HOST = "127.0.0.1"
SHORT = default_plan().replace("practice = 600 ", "practice = 0 ") + "\n[parameters]\npatience = 30\n"
PLAN = parse_plan(SHORT)
HAND = {"p_WH": [-0.4, 0.1, -0.05], "q_WH": [1.0, 0.0, 0.0, 0.0], "closed": False}


def server_of(path: Path, host: str = HOST) -> StudyServer:
    return StudyServer(StudySeat(Protocol(StudyFolder.opened(path, PLAN), ["mouse", "tracker"])), host)


@contextmanager
def served(server: StudyServer) -> Generator[str, None, None]:
    """Serve a study in a thread; yield host and port. A run under way ends with it."""
    running = uvicorn.Server(uvicorn_config(server))
    with socket.create_server((HOST, 0)) as listening:
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield f"{HOST}:{listening.getsockname()[1]}"
        finally:
            running.should_exit = True
            thread.join()


@contextmanager
def page_at(where: str, path: str = "/", origin: str | None = None) -> Generator[ClientConnection, None, None]:
    own = f"http://{where}" if origin is None else origin
    with connect(f"ws://{where}{path}seat", origin=own, max_size=None, max_queue=None) as page:  # pyright: ignore[reportArgumentType]
        yield page


@contextmanager
def page_of(server: StudyServer) -> Generator[ClientConnection, None, None]:
    with served(server) as where, page_at(where) as page:
        yield page


def status(where: str, path: str, host: str = "") -> int:
    """Return the status by which a server answers a path."""
    request = urllib.request.Request(f"http://{where}{path}", headers={"Host": host} if host else {})
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.status
    except urllib.error.HTTPError as e:
        return e.code


def told(page: ClientConnection, name: str) -> Any:
    """Return the next message of a name; states of the run are passed over."""
    while True:
        message = page.recv(timeout=120)
        content: dict[str, Any] = json.loads(message) if isinstance(message, str) else {}
        if name in content:
            return content[name]


def act(page: ClientConnection, action: str, value: Any = None) -> None:
    page.send(json.dumps({"act": {"action": action, "value": value}}))


def to_instruction(page: ClientConnection, device: str = "mouse") -> None:
    act(page, "language", "en")
    act(page, "consent", True)
    act(page, "eligibility", [True] * 3)
    act(page, "device", device)
    while told(page, "screen")["screen"] != "instruction":
        pass


def to_round(page: ClientConnection) -> None:
    to_instruction(page)
    act(page, "begin")
    told(page, "scene")
    page.send('{"ready": true}')


def test_the_page_alone_is_served_and_to_this_computer_alone(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where:
        with urllib.request.urlopen(f"http://{where}/") as answer:
            page = answer.read().decode()
            assert answer.headers["x-frame-options"] == "DENY"
        assert "script-src &#39;sha256-" in page
        assert "unsafe-eval" not in page
        for path in ("/plan.toml", "/participants/P01/session.json", "/static/../plan.toml", "/seat"):
            assert status(where, path) == 404, path
        assert status(where, "/", host="elsewhere.example") == 400


@pytest.mark.parametrize("origin", ["http://elsewhere.example", "null"])
def test_a_connection_of_another_origin_is_refused(origin: str, tmp_path: Path):
    with (
        served(server_of(tmp_path / "study")) as where,
        pytest.raises(InvalidStatus, match="403"),
        page_at(where, origin=origin),
    ):
        pass


def test_on_another_address_the_page_is_below_a_token(tmp_path: Path):
    server = server_of(tmp_path / "study", host="192.0.2.7")
    assert len(server.token) > 20
    assert server.token != server_of(tmp_path / "study", host="192.0.2.7").token
    with served(server) as where:
        assert status(where, server.path) == 200
        for path in ("/", "/seat", "/wrong/", f"/{server.token[:-1]}/"):
            assert status(where, path) == 404, path
        with pytest.raises(InvalidStatus), page_at(where):
            pass
        with page_at(where, server.path) as page:
            assert told(page, "screen")["screen"] == "language"


def test_a_second_page_is_told_that_the_seat_is_taken_and_the_first_stays(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where:
        with page_at(where) as first:
            assert told(first, "screen")["screen"] == "language"
            with page_at(where) as second:
                assert told(second, "gone") == "seat_taken"
            act(first, "language", "de")
            assert told(first, "screen")["screen"] == "consent"
        time.sleep(0.5)
        with page_at(where) as third:
            assert told(third, "screen")["screen"] == "consent"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "not JSON"),
        ("[" * 5000, "not JSON"),
        ("[]", "not an object"),
        ('{"act": 1, "hand": 2}', "not an object"),
        ('{"run": "rm"}', "not an object"),
        ('{"act": 3}', "'None' is not for"),
        ('{"act": {"action": "consent", "value": true}}', "'consent' is not for the screen 'language'"),
        ('{"act": {"action": "language", "value": "../.."}}', "no language"),
        ('{"act": {"action": "language", "value": []}}', "no language []"),
        (b"\x00\xff", "a text, and not bytes"),
        (" " * 30_000, "characters at most"),
    ],
)
def test_what_is_no_message_of_the_page_is_refused_with_the_reason(text: str | bytes, why: str, tmp_path: Path):
    with page_of(server_of(tmp_path / "study")) as page:
        page.send(text)
        assert why in told(page, "refused")
        act(page, "language", "en")
        assert told(page, "screen")["screen"] == "consent"


def test_samples_that_cannot_be_used_are_refused_and_the_round_goes_on(tmp_path: Path):
    with page_of(server_of(tmp_path / "study")) as page:
        to_round(page)
        wrong: list[tuple[dict[str, Any], str]] = [
            ({**HAND, "stamp": 1.0, "p_WH": [float("nan"), 0.0, 0.0]}, "p_WH: 3 finite numbers"),
            ({**HAND, "stamp": 1.0, "p_WH": [9.0, 0.0, 0.0]}, "reaches"),
            ({**HAND, "stamp": float("inf")}, "stamp"),
            ({**HAND, "stamp": 0.5}, "not after the one before"),
        ]
        page.send(json.dumps({"hand": {**HAND, "stamp": 0.9}}))
        for sample, why in wrong:
            page.send(json.dumps({"hand": sample}))
            assert why in told(page, "refused")
        page.send(json.dumps({"drawn": [-1.0]}))
        assert "0 to 60000 ms" in told(page, "refused")
        seen = time_seen(page)
        assert time_seen(page) > seen
    session = StudyFolder.opened(tmp_path / "study", PLAN).session(1)
    assert session.records == {}


def time_seen(page: ClientConnection) -> float:
    """Return the simulated time of the next state of the run, s."""
    while isinstance(message := page.recv(timeout=60), str):
        assert "void" not in message
    return float(np.frombuffer(message, dtype="<f8")[0])


def test_a_page_that_is_closed_makes_its_round_void_and_it_is_played_again(tmp_path: Path):
    server = server_of(tmp_path / "study")
    with served(server) as where:
        with page_at(where) as page:
            to_round(page)
            page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
        with page_at(where) as reloaded:  # while the run of the page that has gone is ended
            assert told(reloaded, "screen")["screen"] == "void"
    attempts = StudyFolder.opened(tmp_path / "study", PLAN).session(1).notes.void_attempts
    assert [(a.number, a.attempt) for a in attempts] == [(1, 1)], attempts
    assert "the page was closed" in attempts[0].reason
    assert server.seat.protocol.screen == "void"


def test_a_device_that_falls_silent_makes_the_round_void(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(seat_module, "SILENCE", 0.5)
    with page_of(server_of(tmp_path / "study")) as page:
        to_round(page)
        shown = told(page, "screen")
        assert shown["screen"] == "void"
        assert "no sample of the hand" in shown["reason"]
        act(page, "next")
        assert told(page, "screen")["round"] == 1


def test_a_page_that_floods_is_refused_and_at_last_put_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page_messages, "MOST_A_SECOND", 20)
    monkeypatch.setattr(page_messages, "FLOOD", 200)
    with page_of(server_of(tmp_path / "study")) as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(1000):
                page.send('{"drawn": []}')
        assert "more than 20 messages in a second" in told(page, "refused")
        assert told(page, "gone") == "flood"


def test_a_run_that_is_killed_makes_its_round_void(tmp_path: Path):
    server = server_of(tmp_path / "study")
    with served(server) as where, page_at(where) as page:
        to_round(page)
        page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
        assert time_seen(page) >= 0.0
        (trial,) = [p for p in psutil.Process().children() if "handover.scenarios.study.session" in p.cmdline()]
        trial.kill()
        shown = told(page, "screen")
        assert (shown["screen"], shown["again"]) == ("void", True)
        assert "the simulation's process ended (killed by signal 9)" in shown["reason"]
    assert StudyFolder.opened(tmp_path / "study", PLAN).session(1).records == {}


def test_a_page_that_floods_in_a_round_makes_it_void(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page_messages, "FLOOD", 200)
    server = server_of(tmp_path / "study")
    with served(server) as where:
        with page_at(where) as page:
            to_round(page)
            with contextlib.suppress(ConnectionClosed):
                for k in range(1000):
                    page.send(json.dumps({"hand": {**HAND, "stamp": 1.0 + k}}))
            assert told(page, "gone") == "flood"
        with page_at(where) as reloaded:
            assert told(reloaded, "screen")["screen"] == "void"
    session = StudyFolder.opened(tmp_path / "study", PLAN).session(1)
    assert session.records == {}
    assert "the page was closed" in session.notes.void_attempts[0].reason


def test_a_tracker_leads_the_hand_and_its_pictures_are_timed_by_the_pages_clock(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where, page_at(where) as page:
        assert told(page, "tracker") is False
        to_instruction(page, "tracker")
        with connect(f"ws://{where}/hand") as tracker:
            rest = told(tracker, "hand")
            assert told(page, "tracker") is True
            assert len(rest["angles"]) == 14
            there = [rest["p_WH"][0] + 0.1, *rest["p_WH"][1:]]
            act(page, "begin")
            scene = SeenScene(told(page, "scene"))
            assert told(tracker, "hand")["p_WH"] == rest["p_WH"]
            ahead = 1000.0  # the page's clock goes before this computer's
            page.send(json.dumps({"clock": time.monotonic() + ahead}))
            page.send(json.dumps({"ready": True}))
            end = time.monotonic() + 60.0
            while not (np.linalg.norm(scene.place("hand") - there) < 0.02 and np.isfinite(scene.stamp)):
                assert time.monotonic() < end
                tracker.send(json.dumps({**HAND, "p_WH": there, "stamp": time.monotonic() - 500.0, "device": "leap"}))
                message = page.recv(timeout=60)
                if isinstance(message, bytes):
                    scene.take(message)
            assert 0.0 <= time.monotonic() + ahead - scene.stamp < 30.0
            page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
            assert "the tracker leads the hand" in told(page, "refused")
        assert told(page, "tracker") is False


def test_a_tracker_is_told_why_it_is_refused(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where, page_at(where) as page:
        with pytest.raises(InvalidStatus), connect(f"ws://{where}/hand", origin="http://elsewhere.example"):  # pyright: ignore[reportArgumentType]
            pass
        with connect(f"ws://{where}/hand") as tracker:
            told(tracker, "hand")
            with connect(f"ws://{where}/hand") as second:
                assert "another tracker" in told(second, "refused")
            to_instruction(page, "mouse")
            tracker.send(json.dumps({**HAND, "stamp": 1.0}))
            assert told(tracker, "refused") == "in this session the hand is led by: mouse"


def test_what_is_no_sample_is_refused_and_a_tracker_that_floods_is_put_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(page_messages, "FLOOD", 20)
    with served(server_of(tmp_path / "study")) as where, connect(f"ws://{where}/hand") as tracker:
        tracker.send(b"\x00\xff")
        assert "a text, and not bytes" in told(tracker, "refused")
        with contextlib.suppress(ConnectionClosed):
            for _ in range(1000):
                tracker.send("{}")
        with pytest.raises(ConnectionClosed) as closed:
            told(tracker, "nothing")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.reason == "more than 20 messages in a second"


def test_who_sits_down_after_a_withdrawal_has_practised_nothing(tmp_path: Path):
    seat = server_of(tmp_path / "study").seat
    for _ in range(2):
        for action, value in (("language", "en"), ("consent", True), ("eligibility", [True] * 3), ("device", "mouse")):
            seat.protocol.act(action, value)
        assert seat.practice.done == 0.0
        assert seat.practice.test.reached == []
        seat.practice.done = 100.0
        seat.practice.test.reached.append(Reached("+x", 1.0))
        assert seat.practice.done == 100.0
        seat.protocol.act("withdraw")
        seat.protocol.act("next")


def test_a_round_that_cannot_be_kept_is_told_and_can_be_played_again(tmp_path: Path):
    seat = server_of(tmp_path / "study").seat
    protocol = seat.protocol
    for action, value in (("language", "en"), ("consent", True), ("eligibility", [True] * 3), ("device", "mouse")):
        protocol.act(action, value)
    protocol.act("begin")
    in_the_way = protocol.study.session(1).path / "rounds" / "01.json"
    in_the_way.mkdir()
    seat.keep(None, record(), is_round=True)
    assert protocol.screen == "void"
    assert "it could not be kept" in protocol.void_reason
    protocol.act("next")
    protocol.act("begin")
    seat.keep("the page was closed", is_round=True)
    assert protocol.screen == "void"
    in_the_way.rmdir()
    protocol.act("next")
    protocol.act("begin")
    tables = protocol.study.session(1).path / "rounds.csv"
    tables.unlink()
    tables.mkdir()
    seat.keep(None, record(), is_round=True)
    assert protocol.screen == "rating"
    ratings = {"S1": 7, "S2": 8, "S3": 9}
    with pytest.raises(RecordNotWritten):
        protocol.act("rate", ratings)
    tables.rmdir()
    protocol.act("rate", ratings)
    assert (protocol.screen, protocol.content()["round"]) == ("instruction", 2)
    assert len(pd.read_csv(tables)) == 1


@pytest.mark.parametrize("path", ["seat", "hand"])
def test_a_message_beyond_all_bounds_ends_the_connection_with_the_reason(path: str, tmp_path: Path):
    with (
        served(server_of(tmp_path / "study")) as where,
        connect(f"ws://{where}/{path}", origin=f"http://{where}") as device,  # pyright: ignore[reportArgumentType]
    ):
        device.send("x" * 200_000)
        with pytest.raises(ConnectionClosed) as closed:
            told(device, "nothing")
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1009, "frame exceeds limit of 80000 bytes")


@pytest.mark.parametrize("code", [1000, 1012])
def test_a_server_that_has_gone_is_no_end_of_scripted_pilots(code: int):
    def close(connection: ServerConnection) -> None:
        connection.close(code=code)

    with serve(close, HOST, 0) as server:  # pyright: ignore[reportUnknownVariableType]
        thread = threading.Thread(target=server.serve_forever)  # pyright: ignore[reportUnknownArgumentType]
        thread.start()
        address = f"http://{HOST}:{server.socket.getsockname()[1]}/"
        try:
            with pytest.raises((PilotRefused, ConnectionClosed)):
                asyncio.run(play_sessions(address, PLAN, print))
        finally:
            server.shutdown()
            thread.join()


def test_a_plan_in_whose_rounds_nobody_can_lead_a_hand_is_told():
    plan = parse_plan(SHORT.replace('"flyer_robot_to_human"', '"flyer_two_robots"'))
    (rigid, compliant) = hand_faults(plan)
    assert rigid.startswith("tasks.robot_to_human, rigid: in flyer_two_robots nobody outside can lead a hand")
    assert compliant.startswith("tasks.robot_to_human, compliant: ")
