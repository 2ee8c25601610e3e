"""What led a hand is written beside its run, also where the page ceases to show the run, or the disk is full."""

import asyncio
import contextlib
import json
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu
from support.live_pages import connected, reported
from support.served_live_page import served
from websockets.exceptions import ConnectionClosed

from handover.cosim.master.live_control import LiveControl
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.system import System
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.live.hand_messages import HandSample
from handover.scenarios.live.hand_seat import HandSeat
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.live_scene import RecordedScene
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.watched_run import WatchedRun

LED = LedHand("person", (-0.4, 0.1, -0.05), 0.9)
AT_REST = HandSample.at_rest(LED)


class LedSeat(HandSeat):
    """A seat whose device has sent a sample."""

    def __init__(self, folder: Path) -> None:
        inputs = SharedInputs.create(folder / "hand", LED.inputs, [LED.age])
        inputs.set(AT_REST.entries(LED), time.monotonic())
        super().__init__(LED, inputs, lambda: AT_REST)
        self._samples["test"] += 1


class Told(LivePage):
    """A page that notes what it tells."""

    def __init__(self) -> None:
        super().__init__()
        self.reported: list[object] = []
        self.begins = asyncio.Event()

    async def begun(self) -> None:
        self.begins.set()

    async def tell(self, content: object) -> None:
        self.reported.append(content)


def shown_run(folder: Path) -> ShownRun:
    system = System()
    system.add("mass", native_fmu("mass", 3))
    with Master(system) as master, Recorder(folder / "signals.parquet") as recorder:
        master.run(Fraction(1, 10), [recorder])
    scene = RecordedScene(None, None, Record(folder / "signals.parquet"))
    return ShownRun(WatchedRun(folder / "run"), LiveControl.in_memory(1.0), folder, scene, seat=LedSeat(folder))


def test_a_run_whose_hand_nobody_leads_from_outside_has_no_seat_for_one(tmp_path: Path):
    page = LivePage()
    page.shown = replace(shown_run(tmp_path), seat=None)
    with served(page) as (address, _), connected(address, "hand") as device:
        assert "hand=outside" in reported(device, "refused")
        with pytest.raises(ConnectionClosed):
            device.recv(60.0)
        assert device.close_code == 1008


def test_the_report_is_written_where_showing_the_run_is_cancelled(tmp_path: Path):
    async def cancelled() -> None:
        page = Told()
        showing = asyncio.create_task(page.show(shown_run(tmp_path)))
        await page.begins.wait()
        showing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await showing

    (tmp_path / "run").mkdir()
    asyncio.run(cancelled())
    assert json.loads((tmp_path / "run" / "inputs.json").read_text(encoding="utf-8"))["samples"] == {"test": 1}


def test_the_end_is_reported_where_the_report_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    page = Told()
    asyncio.run(page.show(shown_run(tmp_path), lambda: True))  # whose folder is not there
    assert "ended" in str(page.reported[-1])
    assert "inputs.json" in capsys.readouterr().err
