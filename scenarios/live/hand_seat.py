"""The seat of the one device that leads a run's hand: takes its samples, and tells it which it cannot take."""

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live.connections import (
    LONGEST_REASON,
    POLICY_VIOLATION,
    REFUSAL_PERIOD,
    TRY_AGAIN_LATER,
    BinaryMessage,
    MessageRate,
    close,
    is_same_origin,
    receive_text,
    send_json,
    too_many,
)
from handover.scenarios.live.hand_messages import HandSample, HandStream, InvalidHandMessage, hand_start
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.results.run_folder import write_whole

INPUTS_FILE = "inputs.json"
"""Name of the file in a run's folder that says which devices led a hand, and how old samples were at their use."""
_MOST_MESSAGES = 2000
"""Messages of a device within a second; many more are far from any tracker, and keep the server from the page."""


_IS_LED = 'another page or tracker leads the hand; a page leaves it to "a tracker of one\'s own" that is chosen there'


class HandSeat:
    """Takes the samples of one device at a time; others are told to wait.

    Args:
        led: the hand.
        inputs: what the run reads.
        now: returns where the hand is wanted as it stands.
        webcam: hashes of the files by which a webcam leads it, for the report; empty where it is not offered.
    """

    def __init__(
        self,
        led: LedHand,
        inputs: SharedInputs,
        now: Callable[[], HandSample],
        webcam: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._led, self._inputs, self._now, self._webcam = led, inputs, now, webcam
        self.task = led.task
        """What is asked of who leads it."""
        self._device: WebSocket | None = None
        self._samples: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()

    async def connection(self, device: WebSocket) -> None:
        """Serve one device until its connection ends."""
        if not await accept(device):
            return
        if self._device is not None:
            await refuse(device, _IS_LED)
            return
        self._device = device
        try:
            await send_json(device, {"hand": hand_start(self._led, self._now())})
            await self._follow(device)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._device = None

    async def _follow(self, device: WebSocket) -> None:
        stream, name, last_told, rate = HandStream(self._led), "", dict[str, float](), MessageRate()
        while True:
            try:
                fault, text = "", await receive_text(device)
            except BinaryMessage as e:
                fault, text = str(e), ""
            if rate.count() > _MOST_MESSAGES:
                reason = too_many(_MOST_MESSAGES)
                self._refused[reason] += 1
                await close(device, POLICY_VIOLATION, reason)
                return
            try:
                if fault:
                    raise InvalidHandMessage(fault)
                sample, stamp = stream.take(text)
            except InvalidHandMessage as e:
                reason, now = str(e), time.monotonic()
                kind = reason.partition(":")[0]
                self._refused[kind] += 1
                if now - last_told.get(kind, 0.0) >= REFUSAL_PERIOD:
                    last_told[kind] = now
                    await send_json(device, {"refused": reason})
                continue
            name = sample.device or name
            self._samples[name or "unnamed"] += 1
            self._inputs.set(sample.entries(self._led), stamp)

    def report(self) -> Mapping[str, Any]:
        """Return by which devices the hand was led, what was refused, and how old samples were at their use."""
        ages = self._inputs.ages()
        age = {"uses": len(ages)}
        if len(ages):
            of_ages = {"median": np.median(ages), "p95": np.percentile(ages, 95), "most": np.max(ages)}
            age |= {name: round(float(value), 6) for name, value in of_ages.items()}
        report = {"samples": dict(self._samples), "refused": dict(self._refused), "age_at_use": age}
        return {**report, "webcam": {"sha256": dict(self._webcam)}} if self._webcam else report

    def write_report(self, folder: Path) -> None:
        """Leave the report in the run's folder, if anything came."""
        if self._samples or self._refused:
            write_whole(folder / INPUTS_FILE, json.dumps(self.report(), indent=2) + "\n")


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
