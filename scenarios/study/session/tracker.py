"""A hand tracker beside a study's page: it connects to `ws://HOST:PORT/hand`, and sends what `hand_messages` says.

With a token the path is below it, as the page's is. One tracker at a time leads the hand, in sessions whose participant
has chosen it; its samples between two runs are passed over. At each run's start it is told where the hand is.
"""

import asyncio
import contextlib
import json
import time
from collections.abc import Mapping
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.plants.free_flyer.hand.hand_kinematics import STRAIGHT
from handover.scenarios.live.hand_messages import InvalidHandMessage
from handover.scenarios.study.plan.led_hands import led_hand_of, round_parameters
from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.page_messages import MessageRate, received_text
from handover.scenarios.study.session.seat import StudySeat

_SLOWEST = 2.0
"""How long a tracker may take to receive a message, s."""
_BETWEEN = 0.5
"""Time between two refusals that a tracker is told, s: who floods is not flooded."""


class TrackerSeat:
    """Gives the samples of one tracker to the trial of a seat.

    Args:
        seat: whose page shows it.
    """

    def __init__(self, seat: StudySeat) -> None:
        self._seat = seat
        self._tracker: WebSocket | None = None

    async def connection(self, tracker: WebSocket) -> None:
        """Serve one tracker until its connection ends."""
        origin = tracker.headers.get("origin")  # a tracker that is no browser gives none
        if origin is not None and origin.partition("://")[2] != tracker.headers.get("host"):
            await tracker.close(code=1008)
            return
        await tracker.accept()
        if self._tracker is not None:
            await self._tell(tracker, {"refused": "another tracker leads the hand; it is free when that one goes"})
            await tracker.close(code=1013)
            return
        self._tracker = tracker
        try:
            await self._tell(tracker, {"hand": self._at_rest()})
            self._seat.on_run = lambda hand: self._tell(tracker, {"hand": hand})
            await self._seat.tracker_came(there=True)
            await self._follow(tracker)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._tracker, self._seat.on_run = None, None
            await self._seat.tracker_came(there=False)

    async def _follow(self, tracker: WebSocket) -> None:
        rate, told = MessageRate(), 0.0
        while True:
            text = await received_text(tracker)
            rate.add()
            if rate.is_flood:
                fault = f"more than {page_messages.FLOOD} messages in a second"
                await self._tell(tracker, {"refused": fault})
                await tracker.close(code=1008, reason=fault)
                return
            try:
                if text is None:
                    raise InvalidHandMessage("a message is a text, and not bytes")
                self._seat.lead_by_tracker(text)
            except InvalidHandMessage as e:
                if time.monotonic() - told >= _BETWEEN:
                    told = time.monotonic()
                    await self._tell(tracker, {"refused": str(e)})

    def _at_rest(self) -> Mapping[str, Any]:
        """Return where a hand rests in the plan's first round, as `handInput` and trackers take it."""
        condition = self._seat.protocol.study.plan.conditions[0]
        led = led_hand_of(condition.scenario, round_parameters(condition))
        pose = {"p_WH": list(led.p_WH_0), "q_WH": [1.0, 0.0, 0.0, 0.0], "angles": list(STRAIGHT), "closed": False}
        return {**pose, "centre": list(led.p_WH_0), "radius": led.reach}

    @staticmethod
    async def _tell(tracker: WebSocket, content: Mapping[str, Any]) -> None:
        with contextlib.suppress(TimeoutError, asyncio.TimeoutError, WebSocketDisconnect, RuntimeError):
            await asyncio.wait_for(tracker.send_text(json.dumps(content)), _SLOWEST)
