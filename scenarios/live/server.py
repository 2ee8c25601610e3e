"""Serves live pages on loopback: of one run beside it, or of a session of runs.

Requests need a loopback Host header; WebSockets also need an Origin equal to Host.
"""

import asyncio
import shutil
import socket
import threading
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.routing import Route, WebSocketRoute

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.page_server import PageServer
from handover.scenarios.live.process import CONTROL_FILE, HOST, wait_for_end_of_input
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.live.webcam import WebcamFiles

_GRACE = 3
"""Time for pages to take in that the server ends, s; a browser that is frozen never does."""


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
    server = PageServer(application, page.longest, _GRACE)
    serving = asyncio.create_task(server.serve(sockets=[listening]))
    await asyncio.wait([job, serving], return_when=asyncio.FIRST_COMPLETED)
    server.end()
    await serving
    await job


async def _watch(
    shown: ShownRun, listening: socket.socket, webcam: WebcamFiles | None, orphaned: threading.Event
) -> None:
    page = LivePage(webcam)
    await serve(page, page.show(shown, orphaned.is_set), listening)


def watch(folder: Path, controls: Path, listening: socket.socket, webcam: Path | None = None) -> None:
    """Serve the page of a run's folder; returns when the run has ended.

    Where the run's process ends without a verdict, as when it is killed, the standard input, a pipe from it, is closed:
    pages are notified, and the folder of the controls, which that process would have removed, is removed.

    Args:
        folder: the run's.
        controls: folder of its controls.
        listening: the socket on which browsers connect.
        webcam: folder of the files by which a webcam leads a hand; None where it is not offered.
    """
    files = None if webcam is None else WebcamFiles.read(webcam)
    control = LiveControl(controls / CONTROL_FILE)
    shown = ShownRun(WatchedRun(folder), control, controls, webcam={} if files is None else files.hashes())
    orphaned = threading.Event()

    def wait() -> None:
        wait_for_end_of_input()
        orphaned.set()

    threading.Thread(target=wait, daemon=True).start()
    asyncio.run(_watch(shown, listening, files, orphaned))
    if orphaned.is_set():
        shutil.rmtree(controls, ignore_errors=True)
