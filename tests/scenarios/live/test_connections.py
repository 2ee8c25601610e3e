"""What comes over the connections of a live page, and what is refused of it, on a real socket."""

import asyncio
import contextlib
import json
import socket
from collections.abc import Generator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from starlette.websockets import WebSocket
from support.live_pages import connected, reported, send
from support.processes import until
from support.served_live_page import answered, served
from websockets.exceptions import ConnectionClosed, InvalidStatus

from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live import connections, live_page
from handover.scenarios.live.connections import HEADERS, BoundedConnection, MessageRate, RefusalTimer
from handover.scenarios.live.hand_messages import HandSample
from handover.scenarios.live.hand_seat import HandSeat
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.shared_inputs import SharedInputs

LED = LedHand("person", (-0.4, 0.1, -0.05), 0.9)


class PageWithHand(LivePage):
    """A page whose hand can be led before there is a run."""

    longest = 100_000

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.inputs = SharedInputs.create(folder / "hand", LED.inputs, [LED.age])
        self.seat = HandSeat(LED, self.inputs, lambda: HandSample.at_rest(LED))

    async def hand(self, device: WebSocket) -> None:
        await self.seat.connection(device)


@pytest.fixture
def page(tmp_path: Path) -> PageWithHand:
    return PageWithHand(tmp_path)


@pytest.fixture
def address(page: PageWithHand) -> Generator[str, None, None]:
    with served(page) as (address, _):
        yield address


def sample(k: int) -> str:
    return json.dumps({"p_WH": LED.p_WH_0, "q_WH": [1, 0, 0, 0], "closed": False, "stamp": k, "device": f"d{k}"})


def test_a_page_is_not_framed_not_kept_and_alone_and_for_this_computer(address: str):
    got, _ = answered(address, "/")
    assert {name: got.headers[name] for name in HEADERS} == HEADERS
    assert HEADERS["X-Frame-Options"] == "DENY"
    assert answered(address, "/", Host="elsewhere.example")[0].status == 400
    for path in ("/etc/passwd", "/report/../../etc/passwd"):
        assert answered(address, path)[0].status == 404, path


def test_a_connection_of_another_sites_page_is_refused_and_a_tracker_without_a_site_is_not(address: str):
    for path, origin in (("run", "http://elsewhere.example"), ("hand", "http://elsewhere.example"), ("run", None)):
        with pytest.raises(InvalidStatus, match="403"), connected(address, path, origin=origin):
            pass
    with connected(address, "hand") as tracker:
        reported(tracker, "hand")
        with connected(address, "hand") as second:
            assert "another page or tracker" in reported(second, "refused")


def test_a_binary_message_and_deep_json_are_refused_and_the_connection_goes_on(page: PageWithHand, address: str):
    with connected(address) as browser, connected(address, "hand") as tracker:
        asked = (b"\x00", "not bytes"), ("[" * 50_000, "not JSON"), ('{"command": "fly"}', "no command 'fly'")
        for sent, why in asked:
            browser.send(sent)
            assert why in reported(browser, "refused")
        tracker.send(b"\x00")
        assert "not bytes" in reported(tracker, "refused")
        for k in range(40):
            tracker.send(sample(k))
        until(lambda: sum(page.seat.report()["samples"].values()) == 40)
    assert page.inputs.read() is not None
    assert len(page.seat.report()["samples"]) == 20, "devices of ever new names take no memory"


@pytest.mark.parametrize("path", ["run", "hand"])
def test_who_floods_or_sends_beyond_all_bounds_is_disconnected_with_the_reason(
    path: str, page: PageWithHand, address: str
):
    for sent, code, why in (
        (["{"] * 20_000, 1008, "messages in a second"),
        (["x" * (4 * page.longest + 1)], 1009, f"frame exceeds limit of {4 * page.longest} bytes"),
    ):
        with connected(address, path, max_queue=None) as flooding:
            with contextlib.suppress(ConnectionClosed):
                for message in sent:
                    flooding.send(message)
                while True:
                    flooding.recv(60.0)
            assert flooding.close_code == code
            assert why in str(flooding.close_reason)
    assert page.seat.report()["refused"].get("more than 2000 messages in a second", 0) == (path == "hand")


def test_a_page_that_is_too_slow_is_closed_with_the_reason(page: PageWithHand):
    async def tell() -> bool:
        """Tell the page much; return whether neither side's memory took more."""
        begun = asyncio.get_running_loop().time()
        await page.tell({"much": "x" * 1_000_000})
        return asyncio.get_running_loop().time() - begun > 1.9

    with served(page) as (address, loop), connected(address, max_queue=1, compression=None) as slow:
        while not asyncio.run_coroutine_threadsafe(tell(), loop).result():
            pass
        with contextlib.suppress(ConnectionClosed):
            while True:
                slow.recv(30.0)
        assert slow.close_code == 1013
        assert "more than 2 s to receive a message" in str(slow.close_reason)


def test_of_more_pages_than_a_run_is_shown_in_the_last_one_is_refused(address: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(live_page, "MOST_PAGES", 1)
    with connected(address) as first, connected(address) as second:
        send(first, "fly")
        reported(first, "refused")
        with contextlib.suppress(ConnectionClosed):
            second.recv(60.0)
        assert (second.close_code, second.close_reason) == (1013, "1 pages are open already")


def test_messages_are_counted_within_the_last_second_and_two_refusals_of_a_kind_a_second_are_reported():
    now = [3.0]
    timer, rate = RefusalTimer(lambda: now[0]), MessageRate(lambda: now[0])
    reported: list[tuple[float, str]] = []
    counts: list[int] = []
    for k in range(20):
        now[0] = 3.0 + 0.125 * k
        counts.append(rate.count())
        reported += [(0.125 * k, kind) for kind in ("stamp", "p_WH")[: 1 + (k % 3 == 2)] if timer.is_due(kind)]
    assert counts == [*range(1, 9), *[8] * 12]
    assert [t for t, kind in reported if kind == "stamp"] == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert [t for t, kind in reported if kind == "p_WH"] == [0.25, 1.0, 1.75]


def read_to_end(connection: socket.socket) -> bytes:
    got = b""
    with contextlib.suppress(ConnectionResetError):
        while block := connection.recv(1 << 16):
            got += block
    return got


def test_connections_that_ask_for_nothing_are_closed_and_those_beyond_the_most_at_once(
    page: PageWithHand, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 3)
    with served(page) as (address, _), monkeypatch.context() as impatient, contextlib.ExitStack() as opened:
        impatient.setattr(BoundedConnection, "longest_wait", 1.0)
        place = urlsplit(address)
        assert place.hostname is not None
        started = [b"GET / HT", b"", b"GET /no HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET /"]
        idle = [opened.enter_context(socket.create_connection((place.hostname, place.port), 10)) for _ in started]
        for connection, text in zip(idle, started, strict=True):
            connection.sendall(text)
        with socket.create_connection((place.hostname, place.port), 10) as beyond:
            assert not read_to_end(beyond)
        assert idle[2].recv(12) == b"HTTP/1.1 404"
        for connection in idle:
            read_to_end(connection)
        impatient.undo()  # a reader that has no processor for a while is none that asks for nothing
        assert answered(address, "/")[0].status == 200
    assert "Traceback" not in capfd.readouterr().err
