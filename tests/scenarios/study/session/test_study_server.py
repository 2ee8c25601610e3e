"""Who is not a study's page is refused, and what a page sends that it should not."""

import asyncio
import contextlib
import os
import signal
import socket
import threading
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from support.processes import until
from support.scenarios.study_server import (
    HOST,
    PLAN,
    act,
    page_at,
    page_of,
    reported,
    served,
    server_of,
    status,
)
from support.wording import Wording
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection, serve

from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.pilot import PilotRefused, play_sessions
from handover.scenarios.study.session.served_study import address_of, serve_study


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
        for origin in ("http://elsewhere.example", "null"):
            with pytest.raises(InvalidStatus, match="403"), page_at(where, origin=origin):
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
            assert reported(page, "screen")["screen"] == "language"


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
def test_a_server_on_all_addresses_names_one_that_others_can_open(family: socket.AddressFamily, tmp_path: Path):
    server = server_of(tmp_path / "study", host="0.0.0.0")
    with socket.socket(family) as unbound:
        address = urlsplit(address_of(unbound, server))
    assert address.hostname not in (None, "", "0.0.0.0", "::")
    assert address.path == server.path


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_it_from_the_moment_on_that_its_address_is_printed(number: signal.Signals, tmp_path: Path):
    reported, before = list[str](), signal.signal(number, signal.default_int_handler)  # under nohup one is ignored

    def tell(line: str) -> None:
        reported.append(line)
        os.kill(os.getpid(), number)

    served = serve_study(
        PLAN, tmp_path / "out", host=HOST, port=0, number=None, pace=1.0, pilot=False, webcam=None, photodiode=False,
        tell=tell,
    )  # fmt: skip
    try:
        asyncio.run(served)  # no KeyboardInterrupt
    finally:
        signal.signal(number, before)
    assert "Ctrl-C ends it" in reported[0]


def test_a_second_page_is_informed_that_the_seat_is_taken_and_the_first_stays(tmp_path: Path):
    server = server_of(tmp_path / "study")
    with served(server) as where:
        with page_at(where) as first:
            assert reported(first, "screen")["screen"] == "language"
            with page_at(where) as second:
                assert reported(second, "gone") == "seat_taken"
            act(first, "language", "de")
            assert reported(first, "screen")["screen"] == "consent"
        until(lambda: server.seat._page is None)  # type: ignore
        with page_at(where) as third:
            assert reported(third, "screen")["screen"] == "consent"


def test_what_is_no_message_of_the_page_is_refused_with_the_reason(tmp_path: Path, wording: Wording):
    with page_of(server_of(tmp_path / "study")) as page:
        for text in (
            "{",
            "[]",
            '{"act": 1, "hand": 2}',
            '{"run": "rm"}',
            '{"act": 3}',
            '{"act": {"action": "consent", "value": true}}',  # of another screen
            '{"act": {"action": "language", "value": "../.."}}',
            '{"act": {"action": "language", "value": []}}',
            '{"clock": 1' + "0" * 400 + "}",
            b"\x00\xff",
            " " * 30_000,
            "[" * 5000,
        ):
            page.send(text)
            wording.check(reported(page, "refused"))
        act(page, "language", "en")
        assert reported(page, "screen")["screen"] == "consent"


def test_a_page_that_floods_is_refused_and_at_last_put_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(page_messages, "MOST_A_SECOND", 20)
    monkeypatch.setattr(page_messages, "FLOOD", 200)
    with page_of(server_of(tmp_path / "study")) as page:
        with contextlib.suppress(ConnectionClosed):
            for _ in range(1000):
                page.send('{"drawn": []}')
        assert "more than 20 messages in a second" in reported(page, "refused")
        assert reported(page, "gone") == "flood"


def test_a_message_beyond_all_bounds_ends_the_connection_with_the_reason(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where:
        for path in ("seat", "hand"):
            with connect(f"ws://{where}/{path}", open_timeout=60.0, origin=f"http://{where}") as device:  # type: ignore
                device.send("x" * 200_000)
                with pytest.raises(ConnectionClosed) as closed:
                    reported(device, "nothing")
                assert closed.value.rcvd is not None
                assert closed.value.rcvd.reason == "frame exceeds limit of 80000 bytes"
                assert closed.value.rcvd.code == 1009


@pytest.mark.parametrize("code", [1000, 1012])
def test_a_server_that_has_gone_is_no_end_of_scripted_pilots(code: int):
    def close(connection: ServerConnection) -> None:
        connection.close(code=code)

    with serve(close, HOST, 0) as server:  # type: ignore
        thread = threading.Thread(target=server.serve_forever)  # type: ignore
        thread.start()
        address = f"http://{HOST}:{server.socket.getsockname()[1]}/"
        try:
            with pytest.raises((PilotRefused, ConnectionClosed)):
                asyncio.run(play_sessions(address, PLAN, print))
        finally:
            server.shutdown()
            thread.join()
