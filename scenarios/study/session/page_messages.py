"""Messages of a study's page as the server takes them: texts, of a bounded length, so many a second."""

from typing import Any

from handover.cosim.typed_data import InvalidData, decoded
from handover.scenarios.study.session.protocol import InvalidAction

LONGEST = 20_000
"""Characters of a message from the page at most."""
MOST_A_SECOND = 300
"""Messages a second that are taken from a page; further ones are refused."""
FLOOD = 3000
"""Messages a second at which a page or a tracker is put out of its seat."""
SEAT_TAKEN, TOO_MANY = 4001, 4002
"""Codes of WebSocket, of those that are free for applications, with which a page's connection is closed."""
_MESSAGES = {"act", "hand", "ready", "drawn", "clock"}


def parse_message(text: str) -> tuple[str, Any]:
    """Return the name and the value of a message from the page.

    Raises:
        InvalidAction: it is none.
    """
    if len(text) > LONGEST:
        raise InvalidAction(f"a message has {LONGEST} characters at most, this one {len(text)}")
    try:
        members = decoded(text, dict[str, Any])
    except InvalidData as e:
        raise InvalidAction(f"expected an object: {e}") from e
    if len(members) != 1 or not members.keys() <= _MESSAGES:
        raise InvalidAction(f"it is not an object with one of {', '.join(sorted(_MESSAGES))}")
    return next(iter(members.items()))
