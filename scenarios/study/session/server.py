"""Serves a study's page, one file with its scripts, style and words inside, one seat at a time, and nothing else.

On loopback, pages of other sites are kept away by the host that is asked for and by the origin of a connection. On
another address the page is below a token that only its own address holds.
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
from starlette.websockets import WebSocket

from handover.scenarios.live.connections import HEADERS, POLICY_VIOLATION, is_same_origin
from handover.scenarios.live.page_server import PageServer
from handover.scenarios.live.webcam import WEBCAM_SCRIPTS, WebcamFiles
from handover.scenarios.runs.reporting.html import json_html
from handover.scenarios.runs.reporting.page import asset, plain_page_html, template
from handover.scenarios.runs.reporting.replay_section import SCENE_SCRIPTS
from handover.scenarios.study.plan.plan import StudyPlan
from handover.scenarios.study.session.page_messages import LONGEST
from handover.scenarios.study.session.seat import StudySeat
from handover.scenarios.study.session.tracker import TrackerSeat

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
