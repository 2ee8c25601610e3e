"""What comes over the connections of a live page, and what is refused of it, on a real socket."""

import asyncio
import contextlib
import json
import urllib.request
from http.client import HTTPConnection
from pathlib import Path

import pytest
from starlette.websockets import WebSocket
from support.served_live_page import answer, opened, with_page
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from handover.plants.free_flyer.hand.hand_kinematics import STRAIGHT
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live import live_page
from handover.scenarios.live.connections import HEADERS, MessageRate, RefusalTimer
from handover.scenarios.live.hand_messages import HandSample
from handover.scenarios.live.hand_seat import HandSeat
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.shared_inputs import SharedInputs

LED = LedHand("person", (-0.4, 0.1, -0.05), 0.9)
AT_REST = HandSample(LED.p_WH_0, (1.0, 0.0, 0.0, 0.0), STRAIGHT, closed=False, stamp=0.0)


class PageWithHand(LivePage):
    """A page whose hand can be led before there is a run."""

    longest = 100_000

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.inputs = SharedInputs.create(folder / "hand", LED.inputs, [LED.age])
        self.seat = HandSeat(LED, self.inputs, lambda: AT_REST)

    async def hand(self, device: WebSocket) -> None:
        await self.seat.connection(device)


def status(host: str, path: str, **headers: str) -> int:
    """Return the status by which a server answers a path."""
    with contextlib.closing(HTTPConnection(host, timeout=60.0)) as asking:
        asking.request("GET", path, headers=headers)
        return asking.getresponse().status


def test_a_page_is_not_framed_not_kept_and_alone_and_for_this_computer(tmp_path: Path):
    async def act(_page: PageWithHand, host: str) -> None:
        got = await asyncio.to_thread(urllib.request.urlopen, f"http://{host}/")
        assert {name: got.headers[name] for name in HEADERS} == HEADERS
        assert HEADERS["X-Frame-Options"] == "DENY"
        for path, headers, expected in (
            ("/", {"Host": "elsewhere.example"}, 400),
            ("/etc/passwd", {}, 404),
            ("/report/../../etc/passwd", {}, 404),
        ):
            assert await asyncio.to_thread(status, host, path, **headers) == expected, path

    with_page(PageWithHand(tmp_path), act)


def test_a_connection_of_another_sites_page_is_refused_and_a_tracker_without_a_site_is_not(tmp_path: Path):
    async def act(_page: PageWithHand, host: str) -> None:
        for path in ("run", "hand"):
            with pytest.raises(InvalidStatus, match="403"):
                await connect(f"ws://{host}/{path}", open_timeout=60.0, origin="http://elsewhere.example")  # type: ignore
        with pytest.raises(InvalidStatus, match="403"):
            await connect(f"ws://{host}/run", open_timeout=60.0)
        async with connect(f"ws://{host}/hand", open_timeout=60.0) as tracker:
            assert "hand" in await answer(tracker)
            async with connect(f"ws://{host}/hand", open_timeout=60.0) as second:
                assert "another page or tracker" in (await answer(second))["refused"]

    with_page(PageWithHand(tmp_path), act)


def test_a_binary_message_and_deep_json_are_refused_and_the_connection_goes_on(tmp_path: Path):
    async def act(page: PageWithHand, host: str) -> None:
        page.longest = 100_000
        async with opened(host, "run") as browser, opened(host, "hand") as tracker:
            await browser.send(b"\x00")
            assert "not bytes" in (await answer(browser))["refused"]
            await browser.send("[" * 50_000)
            assert "not JSON" in (await answer(browser))["refused"]
            await browser.send('{"command": "fly"}')
            assert "no command 'fly'" in (await answer(browser))["refused"]
            await answer(tracker)
            await tracker.send(b"\x00")
            assert "not bytes" in (await answer(tracker))["refused"]
            sample = {"p_WH": LED.p_WH_0, "q_WH": [1, 0, 0, 0], "closed": False, "stamp": 1.0}
            await tracker.send(json.dumps(sample))
            while page.inputs.read() is None:
                await asyncio.sleep(0.01)

    with_page(PageWithHand(tmp_path), act)


def test_who_floods_is_disconnected_with_the_reason(tmp_path: Path):
    async def act(page: PageWithHand, host: str) -> None:
        for path in ("run", "hand"):
            async with opened(host, path, max_queue=None) as flooding:
                with contextlib.suppress(ConnectionClosed):
                    for _ in range(20_000):
                        await flooding.send("{")
                await flooding.wait_closed()
                assert flooding.close_code == 1008
                assert "messages in a second" in str(flooding.close_reason)
        assert page.seat.report()["refused"]["more than 2000 messages in a second"] == 1

    with_page(PageWithHand(tmp_path), act)


def test_a_message_beyond_all_bounds_ends_the_connection_with_the_reason(tmp_path: Path):
    async def act(page: PageWithHand, host: str) -> None:
        for path in ("run", "hand"):
            async with opened(host, path, max_queue=None) as sending:
                await sending.send("x" * (4 * page.longest + 1))
                await sending.wait_closed()
                assert sending.close_code == 1009
                assert sending.close_reason == f"frame exceeds limit of {4 * page.longest} bytes"

    with_page(PageWithHand(tmp_path), act)


def test_a_page_that_is_too_slow_is_closed_with_the_reason(tmp_path: Path):
    async def act(page: PageWithHand, host: str) -> None:
        async with opened(host, "run", max_size=None, max_queue=1, compression=None) as slow:
            while True:  # until neither side's memory takes more, and 2 s more
                before = asyncio.get_running_loop().time()
                await page.tell({"much": "x" * 1_000_000})
                if asyncio.get_running_loop().time() - before > 1.9:
                    break
            with contextlib.suppress(ConnectionClosed):
                while True:
                    await asyncio.wait_for(slow.recv(), 30.0)
            assert slow.close_code == 1013
            assert "more than 2 s to receive a message" in str(slow.close_reason)

    with_page(PageWithHand(tmp_path), act)


def test_of_more_pages_than_a_run_is_shown_in_the_last_one_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(live_page, "MOST_PAGES", 1)

    async def act(_page: PageWithHand, host: str) -> None:
        async with opened(host, "run") as first:
            await first.send("{")
            await answer(first)
            async with opened(host, "run") as second:
                await second.wait_closed()
                assert (second.close_code, second.close_reason) == (1013, "1 pages are open already")
            await first.send("{")
            assert "refused" in await answer(first)

    with_page(PageWithHand(tmp_path), act)


def test_messages_are_counted_over_a_second():
    now = [0.0]
    rate = MessageRate(lambda: now[0])
    assert [rate.count() for _ in range(3)] == [1, 2, 3]
    now[0] = 0.5
    assert rate.count() == 4
    now[0] = 1.0
    assert rate.count() == 2


def test_of_refusals_of_one_kind_two_a_second_are_told_and_those_of_another_besides():
    now = [3.0]
    timer = RefusalTimer(lambda: now[0])
    told: list[tuple[float, str]] = []
    for k in range(20):
        now[0] = 3.0 + 0.1 * k
        told += [(round(0.1 * k, 1), kind) for kind in ("stamp", "p_WH")[: 1 + (k % 4 == 3)] if timer.is_due(kind)]
    assert [t for t, kind in told if kind == "stamp"] == [0.0, 0.5, 1.0, 1.5]
    assert [t for t, kind in told if kind == "p_WH"] == [0.3, 1.1, 1.9]


def test_devices_of_ever_new_names_take_no_memory(tmp_path: Path):
    async def act(page: PageWithHand, host: str) -> None:
        async with opened(host, "hand") as tracker:
            await answer(tracker)
            for k in range(40):
                sample = {"p_WH": LED.p_WH_0, "q_WH": [1, 0, 0, 0], "closed": False, "stamp": k, "device": f"d{k}"}
                await tracker.send(json.dumps(sample))
            while sum(page.seat.report()["samples"].values()) < 40:
                await asyncio.sleep(0.01)
        assert len(page.seat.report()["samples"]) == 20

    with_page(PageWithHand(tmp_path), act)
