"""The hand of somebody who watches: it takes an object from a robot, by a mouse in a real browser, or by a tracker."""

import json
import time
from pathlib import Path
from typing import Any

import pytest
from live_runs import LIVE, TOLD, live_run, shown
from opened_page import wait_until
from playwright.sync_api import Browser, Page
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

import handover
from handover.cosim.record.reader import Record
from handover.scenarios.execution.selection import find_scenario
from handover.scenarios.experiment.parameters import parse_parameters

SCENARIO = "flyer_robot_to_human"
SAMPLE = {"p_WH": [-0.3, 0.1, 0.0], "q_WH": [1, 0, 0, 0], "closed": False}
PIXEL = """p => {
    const camera = live.scene.camera, box = document.querySelector(".replay-scene").getBoundingClientRect();
    camera.updateMatrixWorld();
    const {x, y} = new THREE.Vector3(...p).project(camera);
    return [box.left + (x + 1) / 2 * box.width, box.top + (1 - y) / 2 * box.height];
}"""


def move_hand(page: Page, to: list[float], steps: int = 1) -> None:
    """Move the mouse to where a point of the plane z = constant is seen, in steps of 30 ms."""
    page.mouse.move(*page.evaluate(PIXEL, to), steps=steps)
    page.wait_for_timeout(30)


def wanted(page: Page) -> list[float]:
    return page.evaluate("live.hand.pose().p_WH")


def phase(page: Page) -> str:
    return page.evaluate(TOLD).partition(", ")[2]


def take_object(page: Page) -> None:
    """Lead the hand to the object's end as the robot signals, close it, and pull until the robot opens its gripper."""
    wait_until(page, "live.hand")
    page.locator("[data-view=top]").click()
    page.wait_for_timeout(300)
    move_hand(page, [-0.15, 0.07, wanted(page)[2]])
    page.mouse.wheel(0, -wanted(page)[2] / 0.00015)
    page.wait_for_timeout(300)
    move_hand(page, [-0.15, 0.07, 0.0])
    assert wanted(page) == pytest.approx([-0.15, 0.07, 0.0], abs=0.002)
    wait_until(page, f"/signal|velocity/.test({TOLD})")
    for k in range(1, 11):
        move_hand(page, [-0.15 + 0.015 * k, 0.07, 0.0])
    page.wait_for_timeout(300)
    page.mouse.down()
    page.mouse.up()
    page.wait_for_timeout(300)
    for _ in range(10):
        for k in range(20):
            move_hand(page, [-0.015 * k, 0.07, 0.0])
        page.wait_for_timeout(1000)
        if "velocity" not in phase(page):
            return
        move_hand(page, [0.0, 0.07, 0.0], steps=10)


@pytest.mark.slow
def test_the_pages_hand_takes_the_object_and_its_record_is_played_back_byte_for_byte(browser: Browser, tmp_path: Path):
    given = ("-p", "hand=outside", "--pace", "4")
    with live_run(tmp_path / "led", *given, scenario=SCENARIO) as (address, run), shown(browser, address) as page:
        page.get_by_text("Once its signal light has flashed yellow, close your hand on the object").wait_for()
        take_object(page)
        wait_until(page, f"{LIVE}.dataset.ended")
        assert page.locator("#task").is_hidden()
        assert page.locator(".verdict").inner_text().startswith("Succeeded: ")
        run.wait(timeout=120)
        assert run.returncode == 0
    led = Record(tmp_path / "led" / "signals.parquet")
    assert led["person.closed_track"].any()
    told = json.loads((tmp_path / "led" / "inputs.json").read_text(encoding="utf-8"))
    assert told["samples"]["mouse"] > 100
    assert told["age_at_use"]["median"] < 0.2
    assert json.loads((tmp_path / "led" / "run.json").read_text(encoding="utf-8"))["inputs"] == {"from": "page"}
    again = handover.run(SCENARIO, hand="outside", inputs_from=tmp_path / "led", out=tmp_path / "again", progress=False)
    assert again.success
    a, b = ((tmp_path / name / "signals.parquet").read_bytes() for name in ("led", "again"))
    assert a == b


def answer(device: ClientConnection) -> dict[str, Any]:
    return json.loads(device.recv(timeout=60))


def sample(stamp: float, **other: Any) -> str:
    return json.dumps({**SAMPLE, "stamp": stamp, "device": "test", **other})


@pytest.mark.slow
def test_a_tracker_leads_the_hand_and_what_it_may_not_send_is_refused(tmp_path: Path):
    given = ("-p", "hand=outside", "--pace", "2", "--stop", "16")
    with live_run(tmp_path / "led", *given, scenario=SCENARIO) as (address, run):
        host = address.removeprefix("http://").rstrip("/")
        with pytest.raises(InvalidStatus, match="403"):
            connect(f"ws://{host}/hand", open_timeout=60.0, origin="http://elsewhere.example")  # type: ignore
        page = connect(f"ws://{host}/run", open_timeout=60.0, origin=f"http://{host}")  # type: ignore
        with page, connect(f"ws://{host}/hand", open_timeout=60.0) as tracker:
            start = answer(tracker)["hand"]
            assert start["p_WH"] == start["centre"] == [-0.4, 0.1, -0.05]
            assert not start["closed"]
            with connect(f"ws://{host}/hand", open_timeout=60.0) as other:
                assert "another page or tracker leads the hand" in answer(other)["refused"]
            wrong = {
                "{": "not JSON",
                sample(0.0, p_WH=[9, 9, 9]): "p_WH: 15.8 m from where the hand rests",
                sample(0.0, p_WH=[float("nan"), 0, 0]): "not JSON",
                " " * 3000: "2000 characters",
            }
            for text, why in wrong.items():
                tracker.send(text)
                assert why in answer(tracker)["refused"]
                time.sleep(0.6)  # one reason is told twice a second at most
            for k in range(150):
                tracker.send(sample(100.0 + 0.016 * k, closed=k > 100))
                time.sleep(0.016)
            tracker.send(sample(1.0))
            assert "stamp: 1 s is not after the one before" in answer(tracker)["refused"]
            for k in range(400):
                tracker.send(sample(200.0 + k))
            assert "250 samples a second" in answer(tracker)["refused"]
            run.wait(timeout=120)
    record = Record(tmp_path / "led" / "signals.parquet")
    assert record["person.p_WH"][-1] == pytest.approx([-0.3, 0.1, 0.0], abs=0.01)
    assert record["person.closed_track"].any()
    assert record["person.age"].min() < 0.2
    told = json.loads((tmp_path / "led" / "inputs.json").read_text(encoding="utf-8"))
    assert told["samples"]["test"] >= 150
    assert sum(told["refused"].values()) >= 6


@pytest.mark.parametrize(
    ("scenario", "given", "asked"),
    [
        ("flyer_robot_to_human", ("hand=outside",), "pull until the gripper opens"),
        ("flyer_human_to_robot", ("hand=outside",), "press it against the gripper until that closes"),
        ("flyer_failed_reception", ("hand=outside",), "it closes on nothing"),
        ("flyer_collaborative", ("hand=outside",), "Once its light has flashed again"),
        ("flyer_handover", ("hand=outside", "task=human_to_robot"), "press it against the gripper until that closes"),
        ("handover.scenarios.free_flyer.handover.hand_practice:HandPractice", (), "close it on the object"),
    ],
)
def test_who_leads_a_hand_is_told_what_to_do(scenario: str, given: tuple[str, ...], asked: str):
    kind = find_scenario(scenario)
    led = kind().led_hand(parse_parameters(kind, given))
    assert led is not None
    assert asked in led.task


def test_a_run_whose_hand_nobody_leads_from_outside_has_no_seat_for_one(tmp_path: Path):
    with live_run(tmp_path / "led", scenario="flyer_human_to_robot") as (address, _):
        host = address.removeprefix("http://").rstrip("/")
        with connect(f"ws://{host}/hand", open_timeout=60.0) as device:
            assert "hand=outside" in json.loads(device.recv())["refused"]
            with pytest.raises(ConnectionClosed) as closed:
                device.recv()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1008
