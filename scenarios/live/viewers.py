"""The pages that are open, what each of them shows, and what is sent to them: one that is too slow is disconnected."""

import asyncio
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.live.connections import PATIENCE, TRY_AGAIN_LATER, close

_THAWED = 60.0
"""How long a page that was too slow may take until it hears that, s; by then the server's pings have ended it."""


@dataclass
class Viewer:
    """What a page shows: signals that it chose, by number the plots that are seen in it, and whether it has a scene."""

    chosen: list[str] = field(default_factory=list[str])
    seen: set[int] = field(default_factory=set[int])
    ready: bool = False


class Viewers:
    """The pages that are open.

    Args:
        gone: is called with a page that is open no more.
        slowest: how long a page may take to receive a message, s; then its connection is closed, with the reason, so
            that it does not stand still as if nothing happened.
    """

    def __init__(self, gone: Callable[[WebSocket], None], slowest: float = PATIENCE) -> None:
        self._gone, self._slowest = gone, slowest
        self._pages: dict[WebSocket, Viewer] = {}
        self._closing: set[asyncio.Task[None]] = set()

    def add(self, page: WebSocket) -> None:
        """Take in a page that has connected."""
        self._pages[page] = Viewer()

    def remove(self, page: WebSocket) -> None:
        """Take in that a page is open no more."""
        self._pages.pop(page, None)
        self._gone(page)

    def of(self, page: WebSocket) -> Viewer:
        """Return what a page shows; nothing that counts if it is open no more."""
        return self._pages.get(page, Viewer())

    @property
    def pages(self) -> Sequence[WebSocket]:
        """All pages."""
        return list(self._pages)

    @property
    def ready(self) -> Sequence[WebSocket]:
        """Those that have a scene."""
        return [page for page, viewer in self._pages.items() if viewer.ready]

    async def tell(self, content: Any) -> None:
        """Send content to all pages, as JSON."""
        message = json.dumps(content)
        for page in self.pages:
            await self.send(page, message)

    async def send(self, page: WebSocket, message: str | bytes) -> None:
        """Send a message to a page."""
        sending = page.send_bytes(message) if isinstance(message, bytes) else page.send_text(message)
        try:
            await asyncio.wait_for(sending, self._slowest)
        except (WebSocketDisconnect, RuntimeError):
            self.remove(page)
        except (TimeoutError, asyncio.TimeoutError):  # type: ignore  # one class from Python 3.11 on
            self.remove(page)
            reason = f"the page took more than {self._slowest:g} s to receive a message"
            closing = asyncio.create_task(close(page, TRY_AGAIN_LATER, reason, _THAWED))
            self._closing.add(closing)
            closing.add_done_callback(self._closing.discard)
