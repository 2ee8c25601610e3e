"""Serves live pages on loopback: of one run beside it, or of a session of runs.

Who is not the page is refused: by the host that is asked for, which keeps pages of other sites away, and by the origin
of a connection.
"""

import asyncio
import contextlib
import socket
from collections.abc import Coroutine, Generator
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.routing import Route, WebSocketRoute

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.process import CONTROL_FILE, HOST
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.live.webcam import WebcamFiles


class _Server(uvicorn.Server):
    """A server that leaves signals to the run, or to the session: Ctrl-C ends that, and this with it."""

    @contextlib.contextmanager
    def capture_signals(self) -> Generator[None, None, None]:
        """Handle none."""
        yield


async def serve(page: LivePage, work: Coroutine[Any, Any, None], listening: socket.socket) -> None:
    """Serve a page while its work is done.

    Args:
        page: what is served.
        work: shows runs in it; where it returns, the server ends.
        listening: the socket on which browsers connect.
    """
    job = asyncio.create_task(work)
    application = Starlette(
        routes=[
            Route("/", page.page),
            WebSocketRoute("/run", page.connection),
            WebSocketRoute("/hand", page.hand),
            *page.routes(),
        ],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])],
    )
    config = uvicorn.Config(
        application, log_level="error", ws="websockets-sansio", ws_max_size=4 * page.longest, lifespan="off"
    )
    server = _Server(config)
    serving = asyncio.create_task(server.serve(sockets=[listening]))
    await asyncio.wait([job, serving], return_when=asyncio.FIRST_COMPLETED)
    server.should_exit = True
    await serving
    await job


async def _watch(shown: ShownRun, listening: socket.socket, webcam: WebcamFiles | None) -> None:
    page = LivePage(webcam)
    await serve(page, page.show(shown), listening)


def watch(folder: Path, controls: Path, listening: socket.socket, webcam: Path | None = None) -> None:
    """Serve the page of a run's folder; returns when the run has ended.

    Args:
        folder: the run's.
        controls: folder of its controls.
        listening: the socket on which browsers connect.
        webcam: folder of the files by which a webcam leads a hand; None where it is not offered.
    """
    files = None if webcam is None else WebcamFiles.read(webcam)
    control = LiveControl(controls / CONTROL_FILE)
    shown = ShownRun(WatchedRun(folder), control, controls, webcam={} if files is None else files.hashes())
    asyncio.run(_watch(shown, listening, files))
