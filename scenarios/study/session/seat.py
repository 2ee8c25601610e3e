"""The one seat of a study: its page is shown the protocol's screens, leads the hand in a round, and sees the run.

Texts from the page are JSON objects with one member:

| member | value | |
|---|---|---|
| `act` | `{"action": NAME, "value": VALUE}` | what the person does on a screen, see `Protocol.act` |
| `hand` | see `hand_messages` | a sample of the hand, while a run goes on |
| `ready` | - | the scene is drawn, and the run may begin |
| `clock` | s | the page's clock, by which pictures of a tracker's samples are timed |
| `drawn` | list of ms | times from samples of the hand to the pictures that showed them |

Texts to the page are JSON objects with one of `screen`, `scene`, `target`, `again`, `tracker`, `wait`, `refused`,
`gone`; a state of the run is a message of 64-bit floats, see `Frame`, sixty a second.
"""

import asyncio
import contextlib
import math
import time
import traceback
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.fmu.heartbeat import PolledClock
from handover.cosim.typed_data import InvalidData, checked
from handover.scenarios.live.connections import (
    BinaryMessage,
    MessageRate,
    RefusalTimer,
    close,
    receive_text,
    send,
    send_json,
    too_many,
)
from handover.scenarios.live.hand_messages import DeviceClock, InvalidHandMessage, Stamp
from handover.scenarios.runs.results.run_folder import InvalidRunFolder
from handover.scenarios.study.folder.session_folder import RoundRecord
from handover.scenarios.study.plan.led_hands import round_parameters
from handover.scenarios.study.plan.order import Round
from handover.scenarios.study.plan.plan import TRACKER, WEBCAM
from handover.scenarios.study.session import page_messages
from handover.scenarios.study.session.page_messages import SEAT_TAKEN, TOO_MANY, parse_message
from handover.scenarios.study.session.practice import PRACTICE, Practice, is_lost
from handover.scenarios.study.session.protocol import InvalidAction, Protocol
from handover.scenarios.study.session.screen_content import VoidCause
from handover.scenarios.study.session.trial import Trial, TrialFailed, TrialRequest

PERIOD = 1.0 / 60.0
"""Time between two states of the run that the page gets, s."""
SILENCE = 3.0
"""How long a run may go on without a sample of the hand before its device is lost, and the round void, s (assumed)."""
_MAX_GAP = 0.25
"""Of the time between two states of a run, how much counts as silence at most, s: else the run or the server stood."""
_READY = 60.0
"""How long a page may take to draw the scene for the first time, s."""


@dataclass(frozen=True)
class _ClockMessage:
    clock: Stamp


class StudySeat:
    """One page at a time, and the trial that it plays.

    Args:
        protocol: what is shown.
        pace: simulated seconds per second of wall time, which is 1 but for scripted pilots.
        webcam: hashes of the files by which a webcam leads the hand, kept with each run that it leads.

    Attributes:
        on_run: is sent the hand's pose as a run begins; None without a tracker.
        on_round_end: is given each round that has ended, with its record or why it does not count; None: nobody is.
    """

    def __init__(self, protocol: Protocol, pace: float = 1.0, webcam: Mapping[str, str] = MappingProxyType({})) -> None:
        self.protocol, self._pace, self._webcam = protocol, pace, webcam
        self._page: WebSocket | None = None
        self._leaving = asyncio.Lock()  # held until the trial of a page that has gone is over
        self._trial: Trial | None = None
        self._closing: asyncio.Future[None] | None = None
        self._preparing: asyncio.Task[None] | None = None
        self._playing: asyncio.Task[None] | None = None
        self._page_ready, self._fault = asyncio.Event(), ""
        self._silence = PolledClock(_MAX_GAP)
        self._practice: Practice | None = None
        self._has_tracker, self._page_clock, self._page_offset = False, DeviceClock(), math.nan
        self.on_run: Callable[[Mapping[str, Any]], Awaitable[None]] | None = None
        self.on_round_end: Callable[[Round, RoundRecord | str], None] | None = None

    @property
    def practice(self) -> Practice:
        """What was practised in the session under way; another participant's begins at nothing."""
        session = self.protocol.session
        assert session is not None
        if self._practice is None or self._practice.session is not session:
            self._practice = Practice(session)
        return self._practice

    async def sit(self, page: WebSocket) -> None:
        """Let a page that was accepted have the seat until it goes; another one is refused."""
        if self._leaving.locked():
            await send_json(page, {"wait": "one_moment"})
        async with self._leaving:
            is_free = self._page is None
            if is_free:
                self._page, self._page_clock, self._page_offset = page, DeviceClock(), math.nan
        if not is_free:
            await send_json(page, {"gone": "seat_taken"})
            await close(page, SEAT_TAKEN)
            return
        try:
            await self._send({"tracker": self._has_tracker})
            await self._show()
            await self._listen(page)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            async with self._leaving:
                self._page = None
                await self._leave(VoidCause.PAGE_CLOSED.value)

    async def close(self) -> None:
        """End what is under way; a round that is not finished is played again."""
        async with self._leaving:
            await self._leave(VoidCause.SERVER_ENDED.value)

    async def _listen(self, page: WebSocket) -> None:
        rate, timer = MessageRate(), RefusalTimer()
        while True:
            try:
                fault, text = "", await receive_text(page)
            except BinaryMessage as e:
                fault, text = str(e), ""
            count = rate.count()
            if count > page_messages.FLOOD:
                await self._send({"gone": "flood"})
                await close(page, TOO_MANY)
                return
            if count > page_messages.MOST_A_SECOND:
                if timer.is_due("rate"):
                    await self._send({"refused": too_many(page_messages.MOST_A_SECOND)})
                continue
            try:
                if fault:
                    raise InvalidAction(fault)
                await self._take(text)
            except (RecordNotWritten, InvalidRunFolder, OSError) as e:
                await self._send({"refused": f"it could not be kept: {e}"})
            except (InvalidAction, ValueError) as e:
                await self._send({"refused": str(e)})

    async def _take(self, text: str) -> None:
        """Do what a message asks for.

        Raises:
            InvalidAction, ValueError: it is none, or not to be done.
        """
        name, value = parse_message(text)
        if name == "hand":
            self._lead(value)
        elif name == "drawn":
            if self._trial is not None:
                self._trial.latency.add(value)
        elif name == "clock":
            self._set_clock(value)
        elif name == "ready":
            self._page_ready.set()
        else:
            of = cast(dict[str, Any], value) if isinstance(value, dict) else {}
            self.protocol.act(str(of.get("action")), of.get("value"))
            if of.get("action") in ("withdraw", "other_device"):
                await self._drop_trial()
            await self._show()

    def _lead(self, value: Any) -> None:
        trial, session = self._trial, self.protocol.session
        if session is not None and session.session.device == TRACKER:
            raise InvalidAction("the tracker leads the hand in this session")
        if trial is None:
            return
        trial.lead(value, time.monotonic())
        self._silence.restart()

    def _set_clock(self, value: Any) -> None:
        try:
            seconds = checked({"clock": value}, _ClockMessage).clock
        except InvalidData as e:
            raise InvalidAction(f"clock takes a number of seconds: {e}") from e
        self._page_offset = self._page_clock.monotonic(seconds, time.monotonic()) - seconds

    def lead_by_tracker(self, text: str) -> None:
        """Lead the hand by a tracker's message, if a run goes on.

        Raises:
            InvalidHandMessage: it is none, cannot be used, or something else leads the hand in this session.
        """
        session, trial = self.protocol.session, self._trial
        if session is not None and session.session.device != TRACKER:
            raise InvalidHandMessage(f"in this session the hand is led by: {session.session.device}")
        if session is not None and trial is not None:
            trial.lead_by_tracker(text, self._page_offset)
            self._silence.restart()

    async def tracker_came(self, *, there: bool) -> None:
        """Tell the page whether a tracker is there."""
        self._has_tracker = there
        await self._send({"tracker": there})

    async def _show(self) -> None:
        """Show the protocol's screen, and see to the trial that it needs."""
        screen = self.protocol.screen
        await self._send({"screen": self.protocol.content()})
        if screen in ("instruction", "practice", "round", "practising") and self._preparing is None:
            self._preparing = asyncio.create_task(self._prepare())
        if screen in ("round", "practising") and self._playing is None:
            self._playing = asyncio.create_task(self._play())

    async def _prepare(self) -> None:
        """Let the next run stand at its start, while the person reads what is to be done."""
        self._fault = ""
        try:
            self._trial = trial = await Trial.open(self._next_request())
            await asyncio.to_thread(trial.begin)
        except (TrialFailed, RecordNotWritten, InvalidRunFolder) as e:
            self._fault = str(e)
        except Exception as e:
            traceback.print_exc()
            self._fault = f"{VoidCause.SERVER_FAILED.value}: {type(e).__name__}: {e}"

    def _next_request(self) -> TrialRequest:
        session, protocol = self.protocol.session, self.protocol
        assert session is not None
        led_by: dict[str, Any] = {"kind": session.session.kind, "device": session.session.device}
        if session.session.device == WEBCAM:
            led_by["webcam"] = {"sha256": dict(self._webcam)}
        if protocol.screen in ("practice", "practising"):
            out = _free_folder(session.path / "practice")
            return TrialRequest(PRACTICE, self.practice.parameters, 0, out, led_by, self._pace)
        planned = protocol.round
        assert planned is not None
        session.clear_unfinished(planned.number)
        c = planned.condition
        given = round_parameters(c)
        out = session.run_folder(planned.number)
        return TrialRequest(c.scenario, given, planned.seed, out, led_by, self._pace)

    async def _play(self) -> None:
        """Carry out the round, or the practice, that is shown, to its end."""
        is_round = self.protocol.screen == "round"
        assert self._preparing is not None
        fault: str | None = None
        while True:
            await self._preparing
            trial = self._trial
            fault = self._fault or (None if trial is None else await self._watched(trial))
            if is_round or fault or trial is None or not self._goes_on(trial):
                break
            await self._send({"again": True})
            await self._drop_trial(keep_playing=True)
            self._preparing = asyncio.create_task(self._prepare())
        await self._conclude(is_round, fault)

    async def _watched(self, trial: Trial) -> str | None:
        """Show a run to its end; return why it is void, None if it is not. Faults of ours make it void, too."""
        try:
            return await self._run(trial)
        except TrialFailed as e:
            return str(e)
        except Exception as e:
            traceback.print_exc()
            return f"{VoidCause.SERVER_FAILED.value}: {type(e).__name__}: {e}"

    async def _run(self, trial: Trial) -> str | None:
        """Show a run to its end; return why it is void, None if it is not."""
        scene = trial.scene
        assert scene is not None
        self._page_ready.clear()
        await self._send({"scene": trial.scene_content(), "hand": trial.hand})
        if self.on_run is not None:
            await self.on_run(trial.hand)
        await self._send_frame(trial, always=True)
        try:
            await asyncio.wait_for(self._page_ready.wait(), _READY)
        except (TimeoutError, asyncio.TimeoutError):  # type: ignore  # one class from Python 3.11 on
            return f"{VoidCause.NOT_DRAWN.value} within {_READY:.0f} s"
        if self.protocol.screen == "practising":
            await self._send({"target": self.practice.test.target})
        trial.go()
        self._silence.restart()
        while trial.is_running:
            if self._playing is not asyncio.current_task():  # wait_for of Python 3.11 may swallow its cancellation
                raise asyncio.CancelledError
            began = time.monotonic()
            went_on = await self._send_frame(trial)
            if went_on and self._silence.poll() > SILENCE:  # at its end the run still writes, and asks for no hand
                return f"{VoidCause.NO_SAMPLE.value} for {SILENCE:.0f} s: the device or the page was lost"
            await self._test_device(trial)
            if self.protocol.screen == "practising" and is_lost(trial):
                trial.stop()
            await asyncio.sleep(max(PERIOD - (time.monotonic() - began), 0.001))
        return None

    async def _test_device(self, trial: Trial) -> None:
        row = trial.newest
        if row is not None and self.protocol.screen == "practising" and self.practice.observe(row):
            await self._send({"target": self.practice.test.target})

    def _goes_on(self, trial: Trial) -> bool:
        """Count the practice that has ended; return whether there is time left for more."""
        self.practice.count(trial.newest)
        return self.practice.goes_on

    async def _conclude(self, is_round: bool, fault: str | None) -> None:
        """Keep what was played, and show what comes next."""
        trial, record = self._trial, None
        if fault is None and is_round and trial is not None:
            try:
                record = await asyncio.to_thread(trial.record)
            except TrialFailed as e:
                fault = str(e)
            except Exception as e:
                traceback.print_exc()
                fault = f"{VoidCause.SERVER_FAILED.value}: {type(e).__name__}: {e}"
        await self._drop_trial(keep_playing=True)
        self._playing = None
        self.keep(fault, record, is_round=is_round)
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._show()

    def keep(self, fault: str | None, record: RoundRecord | None = None, *, is_round: bool) -> None:
        """Keep a round's record, or what was practised, or why it does not count, and go on to what comes next.

        Where the disk is full or a file is damaged, the page says so, and it can be tried again.
        """
        protocol, planned, ended = self.protocol, self.protocol.round, fault or record or "the run has no record"
        if protocol.screen not in ("round", "practising"):  # who played it has withdrawn meanwhile
            return
        try:
            if not is_round:
                if fault is None:
                    protocol.end_practice(self.practice.shown)
                else:
                    protocol.break_off_practice(fault)
            elif isinstance(ended, str):
                protocol.void_round(ended)
            else:
                protocol.end_round(ended)
            if is_round and planned and self.on_round_end:
                self.on_round_end(planned, ended)
        except Exception as e:
            if not isinstance(e, (RecordNotWritten, InvalidRunFolder)):
                traceback.print_exc()
            protocol.break_off(f"{VoidCause.NOT_KEPT.value}: {e}" + (f" ({fault})" if fault else ""))

    async def _leave(self, reason: str) -> None:
        """End the trial under way, if any, since nobody sits there; its round is void."""
        under_way = self._playing is not None
        await self._drop_trial()
        if under_way and self.protocol.screen in ("round", "practising"):
            self.keep(reason, is_round=self.protocol.screen == "round")

    async def _drop_trial(self, *, keep_playing: bool = False) -> None:
        """End what plays or prepares a run, and then the run, which nobody may look at any more."""
        tasks = [self._preparing, None if keep_playing else self._playing]
        self._preparing = None
        if not keep_playing:
            self._playing = None
        trial, self._trial = self._trial, None
        for task in tasks:
            if task is not None and not task.done():
                task.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await task
        if trial is not None:
            self._closing = asyncio.ensure_future(asyncio.to_thread(trial.close))
        if self._closing is not None:  # of a task that was ended meanwhile, too: a folder is put aside after its run
            await asyncio.wait([self._closing])
            self._closing = None

    async def _send_frame(self, trial: Trial, *, always: bool = False) -> bool:
        """Send the state of a run, if it is another one than before; return whether it is."""
        frame = trial.frame(always=always)
        page = self._page
        if frame is not None and page is not None:
            await send(page, frame.packed())
        return frame is not None

    async def _send(self, message: dict[str, Any]) -> None:
        page = self._page
        if page is not None:
            await send_json(page, message)


def _free_folder(path: Path) -> Path:
    """Return a folder in another that is not there yet: 01, 02, ..."""
    k = 1
    while (free := path / f"{k:02d}").exists():
        k += 1
    return free
