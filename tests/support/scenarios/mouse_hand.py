"""A mouse in a browser that takes part in a study: it goes where things are seen in the picture, and clicks.

It knows of a run what the page has been sent to draw. Where the hand is to go, and when to close, is what a scripted
pilot (`pilot.py`) does; how the hand gets there is a mouse's way: in the picture by the pointer, in depth by notches of
the wheel.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from playwright.sync_api import Page

from handover.cosim.blocks.ports import Floats
from handover.scenarios.study.session.pilot import ScriptedHand, SeenScene

NOTCH, PIXELS = 0.015, 100.0
"""What a notch of a wheel moves the hand by, m, and how many pixels it is."""
MARGIN = 5.0
"""How far the pointer stays within the picture, pixels."""
TURNS = {"+roll": "e", "-roll": "q", "+pitch": "w", "-pitch": "s", "+yaw": "a", "-yaw": "d"}
"""Keys that turn the hand as the practice asks."""
NOTE = """
    window.seen = {runs: 0};
    window.WebSocket = class extends WebSocket {
        constructor(...given) {
            super(...given);
            this.addEventListener("message", ({data}) => {
                const sent = typeof data === "string" ? JSON.parse(data) : {frame: data};
                if (sent.frame) seen.frame = sent.frame;
                if (sent.scene) Object.assign(seen, {scene: sent.scene, frame: null, runs: seen.runs + 1});
                if (sent.target) seen.target = sent.target;
                if (sent.screen && sent.screen.screen !== "practising") seen.target = null;
            });
        }
    };
"""
"""Notes in the page what it is asked to draw: asked for now and then, as a person looks, and not queued."""
LOOK = """() => {
    if (!study.play || !seen.frame) return null;
    const {camera} = study.play.scene, box = document.querySelector("#eye canvas").getBoundingClientRect();
    camera.updateMatrixWorld();
    return {
        run: seen.runs, frame: Array.from(new Float64Array(seen.frame)), target: seen.target ?? null,
        view: camera.matrixWorldInverse.elements, projection: camera.projectionMatrix.elements,
        box: [box.left, box.top, box.width, box.height],
    };
}"""


class MouseHand:
    """Leads the hand of a study's page by its mouse and keys, through runs that begin one after the other.

    Args:
        page: the study's, not opened yet.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._number = 0
        self._scene: SeenScene | None = None
        self._hand: ScriptedHand | None = None
        self._closed, self._depth, self._key = False, 0.0, ""
        page.add_init_script(NOTE)

    def act(self) -> None:
        """Look at the page, and do for a moment what is called for."""
        looked: dict[str, Any] | None = self._page.evaluate(LOOK)
        if looked is not None:
            if looked["run"] != self._number:
                self._scene, self._hand, self._number = (
                    SeenScene(self._page.evaluate("seen.scene")),
                    None,
                    looked["run"],
                )
            assert self._scene is not None
            frame: Floats = np.array(looked["frame"], dtype=np.float64)
            self._scene.take(frame.tobytes())
            if self._hand is None:
                self._hand = ScriptedHand(self._scene)
                self._closed, self._depth = self._hand.closed, seen_at(self._scene.place("hand"), looked)[2]
            self._hand.act(looked["target"])
            self._turn(str(looked["target"].get("name", "")) if looked["target"] else "")
            self._lead(self._hand, looked)
        self._page.wait_for_timeout(15)

    def _lead(self, hand: ScriptedHand, looked: Mapping[str, Any]) -> None:
        """Click, if the hand is to close or to open; then lead it to its place."""
        if hand.closed != self._closed:
            self._page.mouse.down()
            self._page.mouse.up()
            self._closed = hand.closed
        x, y, depth = seen_at(hand.place, looked)
        self._page.mouse.move(x, y)
        notches = round((depth - self._depth) / NOTCH)
        if notches:
            self._page.mouse.wheel(0, notches * PIXELS)
            self._depth += notches * NOTCH

    def _turn(self, name: str) -> None:
        """Hold the key that turns the hand as the practice asks, until it asks for something else."""
        key = TURNS.get(name, "")
        if key != self._key:
            if self._key:
                self._page.keyboard.up(self._key)
            if key:
                self._page.keyboard.down(key)
            self._key = key


def seen_at(p: Floats, looked: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return where a point of W is seen: pixels of the page, within the picture, and its depth towards the eye, m."""

    def matrix(name: str) -> Floats:
        rows: Floats = np.array(looked[name], dtype=np.float64).reshape(4, 4)
        return np.transpose(rows)

    in_view: Floats = matrix("view") @ np.array([*p, 1.0])
    clipped: Floats = matrix("projection") @ in_view
    x, y, _, w = (float(c) for c in clipped)
    left, top, width, height = map(float, looked["box"])
    pixel = np.array([left + 0.5 * (1.0 + x / w) * width, top + 0.5 * (1.0 - y / w) * height])
    pixel = np.clip(pixel, [left + MARGIN, top + MARGIN], [left + width - MARGIN, top + height - MARGIN])
    return float(pixel[0]), float(pixel[1]), float(in_view[2])
