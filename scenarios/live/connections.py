"""What all connections to pages on this computer have in common: whom they let in, and what they do not take.

Loopback alone keeps nobody of this computer out; the Host header, checked by the server, and the Origin of a WebSocket
keep out the pages of other sites that a browser has open.
"""

import asyncio
import contextlib
import json
import logging
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Of the pages themselves: they are not kept, not framed by another site's page, and taken for HTML alone."""
POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013
"""Codes of WebSocket with which a connection is closed."""
LONGEST_REASON = 123
"""Bytes that the reason has at most with which a connection is closed."""
PATIENCE = 2.0
"""How long the other end may take to receive a message, s."""
REFUSAL_PERIOD = 0.5
"""Time between two refusals for one reason that a device gets, s: a flood is not answered with another one."""
MOST_CONNECTIONS = 128
"""Connections at a time: where a process has no file left for one more, asyncio logs each attempt without end."""
BACKLOG = 32
"""Connections that are taken in at once, before any of them is counted."""
LONGEST_WAIT = 10.0
"""How long a connection may be open without a request that is whole, s."""


class BoundedConnection(H11Protocol):
    """A connection that is closed where it is one too many, or asks for nothing: opening some needs no token."""

    longest_wait = LONGEST_WAIT

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take in a connection."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self.loop.call_later(self.longest_wait, self._close_idle)

    def _close_idle(self) -> None:
        if self not in self.connections:  # it has ended, or is a WebSocket, which is another object
            return
        if self.cycle and not self.cycle.response_complete:
            self.loop.call_later(self.longest_wait, self._close_idle)
        else:
            self.transport.abort()


class _FaultsOfClients(logging.Filter):
    """Leaves out what the other end did wrong, which has ended its connection."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is of something else."""
        return not record.getMessage().startswith(("Invalid UTF-8", "ASGI callable returned without completing"))


logging.getLogger("uvicorn.error").addFilter(_FaultsOfClients())


class BinaryMessage(ValueError):
    """A message came that is bytes, where texts are taken."""


def is_same_origin(socket: WebSocket, *, browsers_only: bool = True) -> bool:
    """Return whether a connection is from a page of this server, by its Origin header, which browsers always give.

    Args:
        socket: the connection.
        browsers_only: whether one without an Origin is refused; a tracker that is not a browser gives none.
    """
    origin = socket.headers.get("origin")
    if origin is None:
        return not browsers_only
    return origin.partition("://")[2] == socket.headers.get("host")


async def receive_text(socket: WebSocket) -> str:
    """Return the next message of a connection.

    Raises:
        BinaryMessage: it is bytes.
        WebSocketDisconnect: the connection has ended.
    """
    message = await socket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005), message.get("reason"))
    text = message.get("text")
    if text is None:
        raise BinaryMessage("a message is a text, and not bytes")
    return str(text)


async def send(socket: WebSocket, message: str | bytes) -> None:
    """Send a message; a connection that has ended, or does not take it in time, goes without."""
    sending = socket.send_bytes(message) if isinstance(message, bytes) else socket.send_text(message)
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError, asyncio.TimeoutError):
        await asyncio.wait_for(sending, PATIENCE)


async def send_json(socket: WebSocket, content: Mapping[str, Any]) -> None:
    """Send content as JSON, see `send`."""
    await send(socket, json.dumps(content))


async def close(socket: WebSocket, code: int, reason: str = "", patience: float = PATIENCE) -> None:
    """Close a connection with a reason of at most `LONGEST_REASON` bytes; one that has ended already stays so.

    Args:
        socket: the connection.
        code: of WebSocket.
        reason: as the other end gets it.
        patience: how long the other end may take to receive what was sent before, s.
    """
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError, asyncio.TimeoutError):
        await asyncio.wait_for(socket.close(code, reason), patience)


class MessageRate:
    """Counts the messages of a connection within the last second.

    Args:
        clock: s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._arrivals: deque[float] = deque()
        self._clock = clock

    def count(self) -> int:
        """Take in a message that has come; return how many came within the second before, with it."""
        now, arrivals = self._clock(), self._arrivals
        arrivals.append(now)
        while now - arrivals[0] >= 1.0:
            arrivals.popleft()
        return len(arrivals)


class RefusalTimer:
    """Says which refusals a device gets: two a second at most of those for one reason.

    Args:
        clock: s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._last: dict[str, float] = {}
        self._clock = clock

    def is_due(self, kind: str) -> bool:
        """Return whether a refusal of this kind is sent now; it then counts as sent."""
        now = self._clock()
        if now - self._last.get(kind, -REFUSAL_PERIOD) < REFUSAL_PERIOD:
            return False
        self._last[kind] = now
        return True


async def accept(device: WebSocket) -> bool:
    """Accept a device's connection, but for that of another site's page; return whether it was accepted."""
    if not is_same_origin(device, browsers_only=False):
        await device.close(POLICY_VIOLATION)
        return False
    await device.accept()
    return True


async def refuse(device: WebSocket, reason: str, code: int = TRY_AGAIN_LATER) -> None:
    """Tell a device that was accepted why it cannot lead the hand, and close its connection."""
    await send_json(device, {"refused": reason})
    await close(device, code, reason if len(reason.encode()) <= LONGEST_REASON else "")


def too_many(most: int) -> str:
    """Return why messages are refused, or a connection is closed, that are more than `most` in a second."""
    return f"more than {most} messages in a second"
