"""A live page that a thread of this process serves."""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Generator
from http.client import HTTPConnection, HTTPResponse

from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.server import serve


@contextlib.contextmanager
def served(page: LivePage) -> Generator[tuple[str, asyncio.AbstractEventLoop], None, None]:
    """Serve a page on a free port; yield its address, and the loop in which it is served."""
    loop, over = asyncio.new_event_loop(), asyncio.Event()

    async def wait() -> None:
        await over.wait()

    with socket.create_server(("127.0.0.1", 0)) as listening:
        serving = threading.Thread(target=loop.run_until_complete, args=[serve(page, wait(), listening)])
        serving.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}/", loop
        finally:
            loop.call_soon_threadsafe(over.set)
            serving.join()
            loop.close()


def answered(address: str, path: str, **headers: str) -> tuple[HTTPResponse, bytes]:
    """Return what a server answers a path, as it is written, and its content."""
    with contextlib.closing(HTTPConnection(address[7:].rstrip("/"), timeout=60.0)) as asking:
        asking.request("GET", path, headers=headers)
        got = asking.getresponse()
        return got, got.read()
