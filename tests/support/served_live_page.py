"""A live page that this process serves, and connections to it."""

import asyncio
import json
import socket
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from websockets.asyncio.client import ClientConnection, connect

from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.server import serve

P = TypeVar("P", bound=LivePage)


def with_page(page: P, act: Callable[[P, str], Awaitable[None]]) -> None:
    """Serve a page on a free port while something is done with it, by its `host:port`."""

    async def work() -> None:
        with socket.create_server(("127.0.0.1", 0)) as listening:
            host = f"127.0.0.1:{listening.getsockname()[1]}"
            await serve(page, _acting(page, act, host), listening)

    asyncio.run(work())


async def _acting(page: P, act: Callable[[P, str], Awaitable[None]], host: str) -> None:
    await act(page, host)


def opened(host: str, path: str, **options: Any) -> connect:
    """Connect as the page does."""
    return connect(f"ws://{host}/{path}", open_timeout=60.0, origin=f"http://{host}", **options)  # type: ignore


async def answer(to: ClientConnection) -> dict[str, Any]:
    """Return the next message."""
    return json.loads(await asyncio.wait_for(to.recv(), 60.0))
