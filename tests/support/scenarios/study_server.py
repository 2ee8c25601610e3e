"""A study's server in a thread, and its page as a connection that is led through the protocol."""

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
import pytest
from websockets.sync.client import ClientConnection, connect

from handover.scenarios.live.hand_messages import HandStream, hand_sample
from handover.scenarios.live.webcam import WebcamFiles
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.led_hands import led_hand_of
from handover.scenarios.study.plan.plan import StudyPlan, default_plan, parse_plan
from handover.scenarios.study.session import seat as seat_module
from handover.scenarios.study.session.protocol import Protocol
from handover.scenarios.study.session.seat import StudySeat
from handover.scenarios.study.session.server import StudyServer, page_server
from handover.scenarios.study.session.trial import Frame, LatencyLog, TrialRequest

HOST = "127.0.0.1"
SHORT = default_plan().replace("practice = 600 ", "practice = 0 ") + "\n[parameters]\npatience = 30\n"
PLAN = parse_plan(SHORT)
HAND = {"p_WH": [-0.4, 0.1, -0.05], "q_WH": [1.0, 0.0, 0.0, 0.0], "closed": False}


def server_of(path: Path, host: str = HOST, plan: StudyPlan = PLAN, webcam: WebcamFiles | None = None) -> StudyServer:
    devices = ["mouse", "tracker"] if webcam is None else ["webcam"]
    return StudyServer(StudySeat(Protocol(StudyFolder.opened(path, plan), devices)), host, webcam)


class EndlessTrial:
    """A trial without a process, as its seat sees it: its states come as they are asked for, until it is closed."""

    scene, newest, hand = "a scene", None, HAND
    closing = 0.0
    """How long it takes to end, s."""

    def __init__(self, request: TrialRequest) -> None:
        request.out.mkdir(parents=True)
        self.latency, self.is_running, self._time = LatencyLog(), True, 0.0
        self._stream = HandStream(led_hand_of(request.scenario, request.parameters))

    @classmethod
    async def open(cls, request: TrialRequest) -> "EndlessTrial":
        return cls(request)

    def begin(self) -> None:
        pass

    def scene_content(self) -> dict[str, Any]:
        return {}

    def go(self) -> None:
        pass

    def lead(self, content: Any, arrival: float) -> None:
        self._stream.check(hand_sample(content), arrival)

    def frame(self, *, always: bool = False) -> Frame:
        self._time += 0.0 if always else 0.016
        return Frame(self._time, 0.0, np.zeros(0))

    def close(self) -> None:
        time.sleep(self.closing)
        self.is_running = False


@pytest.fixture
def without_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a seat's trials have no process of a run."""
    monkeypatch.setattr(seat_module, "Trial", EndlessTrial)


@contextmanager
def served(server: StudyServer) -> Generator[str, None, None]:
    """Serve a study in a thread; yield host and port. A run under way ends with it."""
    running = page_server(server)
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
    with connect(f"ws://{where}{path}seat", open_timeout=60.0, origin=own, max_size=None, max_queue=None) as page:  # type: ignore
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


def reported(page: ClientConnection, name: str) -> Any:
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
    while reported(page, "screen")["screen"] != "instruction":
        pass


def to_round(page: ClientConnection) -> None:
    to_instruction(page)
    act(page, "begin")
    reported(page, "scene")
    page.send('{"ready": true}')
