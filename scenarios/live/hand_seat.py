"""The seat of the one device that leads a run's hand: takes its samples, and tells it which it cannot take."""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live.connections import (
    POLICY_VIOLATION,
    BinaryMessage,
    MessageRate,
    RefusalTimer,
    accept,
    close,
    receive_text,
    refuse,
    send_json,
    too_many,
)
from handover.scenarios.live.hand_messages import HandSample, HandStream, InvalidHandMessage, hand_start
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.runs.results.run_folder import write_whole

INPUTS_FILE = "inputs.json"
"""Name of the file in a run's folder that says which devices led a hand, and how old samples were at their use."""
_MOST_MESSAGES = 2000
"""Messages of a device within a second; many more are far from any tracker, and keep the server from the page."""
_MOST_NAMES = 20
"""Devices that are distinguished; samples of further ones are counted with those before."""
_IS_LED = 'another page or tracker leads the hand; a page leaves it to "a tracker of one\'s own" that is chosen there'
"""Why another device has to wait."""


class HandSeat:
    """Takes the samples of one device at a time; others have to wait.

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
        stream, name, timer, rate = HandStream(self._led), "", RefusalTimer(), MessageRate()
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
                kind = str(e).partition(":")[0]
                self._refused[kind] += 1
                if timer.is_due(kind):
                    await send_json(device, {"refused": str(e)})
                continue
            if len(self._samples) < _MOST_NAMES or sample.device in self._samples:
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
