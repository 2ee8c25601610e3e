"""Messages of a page or a tracker as the server takes them: texts, of a bounded length, so many a second."""

import json
import time
from typing import Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.study.session.protocol import InvalidAction

LONGEST = 20_000
"""Characters of a message from the page at most."""
MOST_A_SECOND = 300
"""Messages a second that are taken from a page; further ones are refused."""
FLOOD = 3000
"""Messages a second at which a page or a tracker is put out of its seat."""
_MESSAGES = {"act", "hand", "ready", "drawn", "clock"}


class MessageRate:
    """Counts the messages of a connection in each second.

    Attributes:
        count: of the second that goes on, with the newest message.
    """

    def __init__(self) -> None:
        self._second, self.count = 0, 0

    def add(self) -> None:
        """Count a message."""
        second = int(time.monotonic())
        self._second, self.count = second, self.count + 1 if second == self._second else 1

    @property
    def is_flood(self) -> bool:
        """Whether whoever sends them is to be put out."""
        return self.count > FLOOD


async def received_text(connection: WebSocket) -> str | None:
    """Return the next message, None if it is no text but bytes.

    Raises:
        WebSocketDisconnect: the connection has ended.
    """
    message = await connection.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message.get("code", 1005), message.get("reason"))
    return message.get("text")


def parse_message(text: str | None) -> tuple[str, Any]:
    """Return the name and the value of a message from the page.

    Raises:
        InvalidAction: it is none.
    """
    if text is None:
        raise InvalidAction("a message is a text, and not bytes")
    if len(text) > LONGEST:
        raise InvalidAction(f"a message has {LONGEST} characters at most, this one {len(text)}")
    try:
        content: Any = json.loads(text)
    except (ValueError, RecursionError) as e:
        raise InvalidAction("it is not JSON") from e
    members = cast(dict[str, Any], content) if isinstance(content, dict) else {}
    if len(members) != 1 or not members.keys() <= _MESSAGES:
        raise InvalidAction(f"it is not an object with one of {', '.join(sorted(_MESSAGES))}")
    return next(iter(members.items()))
