"""A tracker leads the hand of a study's round; what it may not send is refused."""

import contextlib
import json
import time
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.study_server import (
    HAND,
    act,
    page_at,
    reported,
    served,
    server_of,
    to_instruction,
    without_runs,  # noqa: F401
)
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.pilot import SeenScene


@pytest.mark.slow
def test_a_tracker_leads_the_hand_and_its_pictures_are_timed_by_the_pages_clock(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where, page_at(where) as page:
        assert reported(page, "tracker") is False
        to_instruction(page, "tracker")
        with connect(f"ws://{where}/hand", open_timeout=60.0) as tracker:
            rest = reported(tracker, "hand")
            assert reported(page, "tracker") is True
            assert len(rest["angles"]) == 14
            there = [rest["p_WH"][0] + 0.1, *rest["p_WH"][1:]]
            act(page, "begin")
            scene = SeenScene(reported(page, "scene"))
            assert reported(tracker, "hand")["p_WH"] == rest["p_WH"]
            ahead = 1000.0  # the page's clock goes before this computer's
            page.send(json.dumps({"clock": time.monotonic() + ahead}))
            page.send(json.dumps({"ready": True}))
            end = time.monotonic() + 300.0
            while not (np.linalg.norm(scene.place("hand") - there) < 0.02 and np.isfinite(scene.stamp)):
                assert time.monotonic() < end
                tracker.send(json.dumps({**HAND, "p_WH": there, "stamp": time.monotonic() - 500.0, "device": "leap"}))
                message = page.recv(timeout=60)
                if isinstance(message, bytes):
                    scene.take(message)
            assert 0.0 <= time.monotonic() + ahead - scene.stamp < 60.0
            page.send(json.dumps({"hand": {**HAND, "stamp": 1.0}}))
            assert "the tracker leads the hand" in reported(page, "refused")
        assert reported(page, "tracker") is False


@pytest.mark.usefixtures("without_runs")
def test_a_refused_tracker_gets_the_reason(tmp_path: Path):
    with served(server_of(tmp_path / "study")) as where, page_at(where) as page:
        with (
            pytest.raises(InvalidStatus),
            connect(f"ws://{where}/hand", open_timeout=60.0, origin="http://elsewhere.example"),  # type: ignore
        ):
            pass
        with connect(f"ws://{where}/hand", open_timeout=60.0) as tracker:
            reported(tracker, "hand")
            with connect(f"ws://{where}/hand", open_timeout=60.0) as second:
                assert "another tracker" in reported(second, "refused")
            to_instruction(page, "mouse")
            tracker.send(json.dumps({**HAND, "stamp": 1.0}))
            assert reported(tracker, "refused") == "in this session the hand is led by: mouse"


def test_what_is_no_sample_is_refused_and_a_tracker_that_floods_is_put_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(page_messages, "FLOOD", 20)
    with served(server_of(tmp_path / "study")) as where, connect(f"ws://{where}/hand", open_timeout=60.0) as tracker:
        tracker.send(b"\x00\xff")
        assert "a text, and not bytes" in reported(tracker, "refused")
        with contextlib.suppress(ConnectionClosed):
            for _ in range(1000):
                tracker.send("{}")
        with pytest.raises(ConnectionClosed) as closed:
            reported(tracker, "nothing")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.reason == "more than 20 messages in a second"
