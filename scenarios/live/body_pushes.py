"""Pushes that pages hold: whose force acts on a body, until the page lets go or is silent."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from handover.scenarios.live.commands import Push

SILENCE = 0.5
"""How long a page may be silent before its push is released, s; it sends a push every 33 ms."""
_BUSY = 0.05
"""By how much a timer comes late where the server was busy, s: what pages have sent meanwhile is yet to be read."""


@dataclass
class _Held:
    push: Push
    apply: Callable[[Push], None]
    timer: asyncio.TimerHandle


class BodyPushes:
    """The pushes of all pages, one each; of two on one body the last one acts.

    Args:
        silence: how long a page may be silent before its push is released, s.
    """

    def __init__(self, silence: float = SILENCE) -> None:
        self._silence = silence
        self._held: dict[object, _Held] = {}  # in the order in which they came

    def __contains__(self, page: object) -> bool:
        """Return whether a page pushes."""
        return page in self._held

    def hold(self, page: object, push: Push, apply: Callable[[Push], None]) -> None:
        """Let a page push, in place of what it has pushed.

        Args:
            page: whose push it is.
            push: the body, the force and its point.
            apply: gives a push, also of no force, to the run.
        """
        before = self._held.get(page)
        if before is not None and before.push.body != push.body:
            self.release(page)
        elif before is not None:
            before.timer.cancel()
            del self._held[page]
        loop = asyncio.get_running_loop()
        due = loop.time() + self._silence
        self._held[page] = _Held(push, apply, loop.call_at(due, self._release_silent, page, due))
        apply(push)

    def _release_silent(self, page: object, due: float) -> None:
        """Release a push whose page was silent; once later where the server was busy, after it has read on."""
        loop = asyncio.get_running_loop()
        if loop.time() - due > _BUSY:
            self._held[page].timer = loop.call_later(_BUSY, self.release, page)
        else:
            self.release(page)

    def release(self, page: object) -> None:
        """Release what a page pushes; a push of another page on that body acts again."""
        held = self._held.pop(page, None)
        if held is None:
            return
        held.timer.cancel()
        left = [other.push for other in self._held.values() if other.push.body == held.push.body]
        held.apply(left[-1] if left else Push(held.push.body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))

    def release_all(self) -> None:
        """Release what all pages push, as when another run is shown."""
        for page in list(self._held):
            self.release(page)
