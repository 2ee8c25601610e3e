"""What all connections to pages on this computer have in common: whom they let in, and what they do not take.

Loopback alone keeps nobody of this computer out; the Host header, checked by the server, and the Origin of a WebSocket
keep out the pages of other sites that a browser has open.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable

from starlette.websockets import WebSocket, WebSocketDisconnect

HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Of the pages themselves: they are not kept, not framed by another site's page, and taken for HTML alone."""
POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013
"""Codes of WebSocket with which a connection is closed."""
_SLOWEST = 2.0
"""How long the other end may take to be told why its connection is closed, s."""


class NoText(ValueError):
    """A binary message came where texts are taken."""


def same_origin(socket: WebSocket, *, browsers_only: bool = True) -> bool:
    """Return whether a connection is from a page of this server, by its Origin header, which browsers always give.

    Args:
        socket: the connection.
        browsers_only: whether one without an Origin is refused; a tracker that is no browser gives none.
    """
    origin = socket.headers.get("origin")
    if origin is None:
        return not browsers_only
    return origin.partition("://")[2] == socket.headers.get("host")


async def next_text(socket: WebSocket) -> str:
    """Return the next message of a connection.

    Raises:
        NoText: it is binary.
        WebSocketDisconnect: the connection has ended.
    """
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1000), message.get("reason"))
    text = message.get("text")
    if text is None:
        raise NoText("it is binary: texts of JSON are taken")
    return str(text)


async def close(socket: WebSocket, code: int, reason: str, patience: float = _SLOWEST) -> None:
    """Close a connection with a reason of at most 123 bytes; one that has ended already stays so.

    Args:
        socket: the connection.
        code: of WebSocket.
        reason: as the other end is told.
        patience: how long the other end may take to receive what was sent before, s.
    """
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError, asyncio.TimeoutError):
        await asyncio.wait_for(socket.close(code, reason), patience)


class FloodGuard:
    """Tells when more messages come within a second than anybody sends who means it.

    Args:
        most: messages within a second.
        clock: s.
    """

    def __init__(self, most: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._arrivals: deque[float] = deque(maxlen=most)
        self._clock = clock
        self.reason = f"more than {most} messages in a second"
        """Why a connection is closed that floods."""

    def floods(self) -> bool:
        """Take in a message that has come; return whether it is one too many."""
        now, seen = self._clock(), self._arrivals
        flooded = len(seen) == seen.maxlen and now - seen[0] < 1.0
        seen.append(now)
        return flooded
