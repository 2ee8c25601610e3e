"""Serves a study's page, one file with its scripts, style and words inside, one seat at a time, and nothing else.

On loopback, pages of other sites are kept away by the host that is asked for and by the origin of a connection. On
another address the page is below a token that only its own address holds. A hand tracker connects to
`ws://HOST:PORT/hand`, with a token below it as the page is, and sends what `hand_messages` says. One tracker at a time
leads the hand, in sessions whose participant has chosen it; its samples between two runs are passed over. At each run's
start it is sent the hand's pose.
"""

import contextlib
import secrets
import socket
from collections.abc import AsyncGenerator
from importlib import resources
from typing import Any

import tomli
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.live.connections import (
    HEADERS,
    POLICY_VIOLATION,
    BinaryMessage,
    MessageRate,
    RefusalTimer,
    accept,
    is_same_origin,
    receive_text,
    refuse,
    send_json,
    too_many,
)
from handover.scenarios.live.hand_messages import HandSample, InvalidHandMessage, hand_start
from handover.scenarios.live.page_server import PageServer
from handover.scenarios.live.webcam import WEBCAM_SCRIPTS, WebcamFiles
from handover.scenarios.runs.reporting.html import json_html
from handover.scenarios.runs.reporting.page import asset, plain_page_html, template
from handover.scenarios.runs.reporting.replay_section import SCENE_SCRIPTS
from handover.scenarios.study.plan.led_hands import led_hand_of, round_parameters
from handover.scenarios.study.plan.plan import StudyPlan
from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.page_messages import LONGEST
from handover.scenarios.study.session.seat import StudySeat


class TrackerSeat:
    """Gives the samples of one tracker to the trial of a seat.

    Args:
        seat: whose page shows it.
    """

    def __init__(self, seat: StudySeat) -> None:
        self._seat = seat
        self._tracker: WebSocket | None = None

    async def connection(self, tracker: WebSocket) -> None:
        """Serve one tracker until its connection ends."""
        if not await accept(tracker):
            return
        if self._tracker is not None:
            await refuse(tracker, "another tracker leads the hand; it is free when that one goes")
            return
        self._tracker = tracker
        condition = self._seat.protocol.study.plan.conditions[0]
        led = led_hand_of(condition.scenario, round_parameters(condition))
        try:
            await send_json(tracker, {"hand": hand_start(led, HandSample.at_rest(led))})
            self._seat.on_run = lambda hand: send_json(tracker, {"hand": hand})
            await self._seat.tracker_came(there=True)
            await self._follow(tracker)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._tracker, self._seat.on_run = None, None
            await self._seat.tracker_came(there=False)

    async def _follow(self, tracker: WebSocket) -> None:
        rate, timer = MessageRate(), RefusalTimer()
        while True:
            try:
                fault, text = "", await receive_text(tracker)
            except BinaryMessage as e:
                fault, text = str(e), ""
            if rate.count() > page_messages.FLOOD:
                await refuse(tracker, too_many(page_messages.FLOOD), POLICY_VIOLATION)
                return
            try:
                if fault:
                    raise InvalidHandMessage(fault)
                self._seat.lead_by_tracker(text)
            except InvalidHandMessage as e:
                if timer.is_due(str(e).partition(":")[0]):
                    await send_json(tracker, {"refused": str(e)})


_GRACE = 30
"""Time for a run under way to end when the server does, s."""
LOOPBACK = ("127.0.0.1", "localhost")
_SCRIPTS = ("page.js", *SCENE_SCRIPTS, "hand/hand_input.js", "study/study_scene.js")
_PILOT = "Pilot"
"""What heads the page in a plan of pilots: a script opens no page, so that whoever sees it is a person."""
_FALLBACK = "en"
"""Language of buttons where the page has no words of its own."""


def page_words() -> dict[str, dict[str, Any]]:
    """Return the words of the page's own buttons and lines, by language."""
    text = resources.files("handover.scenarios.study.session").joinpath("page_words.toml").read_text(encoding="utf-8")
    return tomli.loads(text)


def study_html(plan: StudyPlan, *, webcam: bool = False, photodiode: bool = False) -> str:
    """Return the page; in a language that it has no words of its own for, buttons are in English.

    Args:
        plan: the study's.
        webcam: whether one is offered to lead the hand.
        photodiode: whether a square turns from black to white, or back, with each picture that shows a new sample of
            the hand: a photodiode before it checks the latency that the page measures.
    """
    words = page_words()
    content = {
        "words": {name: {**words[_FALLBACK], **words.get(name, {})} for name in plan.texts},
    }
    pilot = _PILOT if plan.pilot else ""
    html = template("study/study.html").render(
        data=json_html(content), pilot=pilot, webcam=webcam, photodiode=photodiode
    )
    styles = (asset("page.css"), asset("scene/replay.css"), asset("study/study.css"))
    scripts = (*_SCRIPTS, *(WEBCAM_SCRIPTS if webcam else ()), "study/study.js")
    return plain_page_html(plan.title, html, styles, scripts, works=webcam)


class StudyServer:
    """The server of one study.

    Args:
        seat: that pages may take.
        host: the address on which it listens; on loopback no token is needed.
        webcam: files by which a webcam leads the hand; None where it is not offered.
        photodiode: see `study_html`.

    Attributes:
        token: part of the page's address; "" on loopback.
    """

    def __init__(
        self, seat: StudySeat, host: str = LOOPBACK[0], webcam: WebcamFiles | None = None, *, photodiode: bool = False
    ) -> None:
        self.seat, self.host, self._webcam, self._photodiode = seat, host, webcam, photodiode
        self._tracker = TrackerSeat(seat)
        self.token = "" if host in LOOPBACK else secrets.token_urlsafe(16)

    @property
    def path(self) -> str:
        """The page's path."""
        return f"/{self.token}/" if self.token else "/"

    def application(self) -> Starlette:
        """Return the application."""
        hosts = [*LOOPBACK] if not self.token else ["*"]  # who knows the token knows the address, by whatever name
        return Starlette(
            routes=[
                Route(self.path, self._page),
                WebSocketRoute(f"{self.path}seat", self._connection),
                WebSocketRoute(f"{self.path}hand", self._tracker.connection),
                *(() if self._webcam is None else self._webcam.routes(self.path)),
            ],
            middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=hosts)],
            lifespan=self._lifespan,
        )

    @contextlib.asynccontextmanager
    async def _lifespan(self, _app: Starlette) -> AsyncGenerator[None, None]:
        yield
        await self.seat.close()

    async def _page(self, _request: Request) -> Response:
        plan = self.seat.protocol.study.plan
        html = study_html(plan, webcam=self._webcam is not None, photodiode=self._photodiode)
        return HTMLResponse(html, headers=HEADERS)

    async def _connection(self, page: WebSocket) -> None:
        if not is_same_origin(page):
            await page.close(POLICY_VIOLATION)
            return
        await page.accept()
        await self.seat.sit(page)


def listening_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens on an address; port 0 is any that is free.

    Raises:
        OSError: it cannot, as where the port is taken.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family)


def page_server(server: StudyServer) -> PageServer:
    """Return what serves a study's page on a socket, by `serve(sockets=[...])`."""
    return PageServer(server.application(), LONGEST, _GRACE)
