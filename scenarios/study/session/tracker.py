"""A hand tracker beside a study's page: it connects to `ws://HOST:PORT/hand`, and sends what `hand_messages` says.

With a token the path is below it, as the page's is. One tracker at a time leads the hand, in sessions whose participant
has chosen it; its samples between two runs are passed over. At each run's start it is sent the hand's pose.
"""

from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.live.connections import (
    POLICY_VIOLATION,
    BinaryMessage,
    MessageRate,
    RefusalTimer,
    accept,
    receive_text,
    refuse,
    send_json,
    too_many,
)
from handover.scenarios.live.hand_messages import HandSample, InvalidHandMessage, hand_start
from handover.scenarios.study.plan.led_hands import led_hand_of, round_parameters
from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.seat import StudySeat


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
        if not await accept(tracker):
            return
        if self._tracker is not None:
            await refuse(tracker, "another tracker leads the hand; it is free when that one goes")
            return
        self._tracker = tracker
        condition = self._seat.protocol.study.plan.conditions[0]
        led = led_hand_of(condition.scenario, round_parameters(condition))
        try:
            await send_json(tracker, {"hand": hand_start(led, HandSample.at_rest(led))})
            self._seat.on_run = lambda hand: send_json(tracker, {"hand": hand})
            await self._seat.tracker_came(there=True)
            await self._follow(tracker)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._tracker, self._seat.on_run = None, None
            await self._seat.tracker_came(there=False)

    async def _follow(self, tracker: WebSocket) -> None:
        rate, timer = MessageRate(), RefusalTimer()
        while True:
            try:
                fault, text = "", await receive_text(tracker)
            except BinaryMessage as e:
                fault, text = str(e), ""
            if rate.count() > page_messages.FLOOD:
                await refuse(tracker, too_many(page_messages.FLOOD), POLICY_VIOLATION)
                return
            try:
                if fault:
                    raise InvalidHandMessage(fault)
                self._seat.lead_by_tracker(text)
            except InvalidHandMessage as e:
                if timer.is_due(str(e).partition(":")[0]):
                    await send_json(tracker, {"refused": str(e)})
