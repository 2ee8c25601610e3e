"""A mouse in a browser that takes part in a study: it goes where things are seen in the picture, and clicks.

It knows of a run what the page has been sent to draw. Where the hand is to go, and when to close, is what a scripted
pilot (`pilot.py`) does; how the hand gets there is a mouse's way: in the picture by the pointer, in depth by notches of
the wheel.
"""

import json
import math
from collections.abc import Mapping
from typing import Any

from playwright.sync_api import Page

from handover.cosim.blocks.ports import Floats
from handover.scenarios.study.session.pilot import ScriptedHand, SeenScene

NOTCH, PIXELS = 0.015, 100.0
"""What a notch of a wheel moves the hand by, m, and how many pixels it is."""
TURNS = {"+roll": "e", "-roll": "q", "+pitch": "w", "-pitch": "s", "+yaw": "a", "-yaw": "d"}
"""Keys that turn the hand as the practice asks."""
SEEN_AT = """p => {
    const camera = study.play.scene.camera, box = document.querySelector("#eye canvas").getBoundingClientRect();
    camera.updateMatrixWorld();
    const far = camera.position.clone().set(...p).applyMatrix4(camera.matrixWorldInverse).z;
    const {x, y} = camera.position.clone().set(...p).project(camera);
    const inside = (a, low, high) => Math.min(Math.max(a, low + 5), high - 5);
    return [inside(box.left + (x + 1) / 2 * box.width, box.left, box.right),
        inside(box.top + (1 - y) / 2 * box.height, box.top, box.bottom), far];
}"""
"""Where a point of W is seen in the view from the person's eye, in pixels of the page, and its depth towards the eye, m."""


class MouseHand:
    """Leads the hand of a study's page by its mouse and keys, through runs that begin one after the other.

    Args:
        page: the study's, not opened yet.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._scene: SeenScene | None = None
        self._hand: ScriptedHand | None = None
        self._target: Mapping[str, Any] | None = None
        self._depth: float | None = None  # at which it has led the hand, since a run has begun
        self._closed, self._key = False, ""
        page.on("websocket", lambda connection: connection.on("framereceived", self._see))

    def _see(self, message: str | bytes) -> None:
        """Take in what the page is told to draw, and what is to be done about it."""
        if isinstance(message, bytes):
            if self._scene is not None:
                self._scene.take(message)
                self._hand = self._hand or ScriptedHand(self._scene)
                self._hand.act(self._target)
            return
        told = json.loads(message)
        if "scene" in told:
            self._scene, self._hand, self._depth = SeenScene(told["scene"]), None, None
        elif "target" in told:
            self._target = told["target"]
        elif "screen" in told and told["screen"]["screen"] != "practising":
            self._target = None

    def act(self) -> None:
        """Do for a moment what is called for."""
        scene, hand = self._scene, self._hand
        if scene is not None and hand is not None and self._page.evaluate("study.play !== null"):
            if self._depth is None:
                self._closed, self._depth = hand.closed, self._seen_at(scene.place("hand"))[1]
            self._turn(str((self._target or {}).get("name", "")))
            self._depth = self._go(hand.place, self._depth)
            if hand.closed != self._closed:
                self._page.mouse.down()
                self._page.mouse.up()
                self._closed = not self._closed
        self._page.wait_for_timeout(15)

    def _seen_at(self, p: Floats) -> tuple[tuple[float, float], float]:
        x, y, far = self._page.evaluate(SEEN_AT, p.tolist())
        return (x, y), far

    def _go(self, place: Floats, depth: float) -> float:
        """Lead the hand from a depth, m, to a place; return at which depth it then is."""
        pixel, there = self._seen_at(place)
        self._page.mouse.move(*pixel)
        notches = round((there - depth) / NOTCH)
        for _ in range(abs(notches)):
            self._page.mouse.wheel(0, math.copysign(PIXELS, notches))
        return depth + notches * NOTCH

    def _turn(self, name: str) -> None:
        """Hold the key that turns the hand as the practice asks, until it asks for something else."""
        key = TURNS.get(name, "")
        if key != self._key:
            if self._key:
                self._page.keyboard.up(self._key)
            if key:
                self._page.keyboard.down(key)
            self._key = key
