"""A mouse in a browser that takes part in a study: it goes where things are seen in the picture, and clicks.

It knows of a run what the page has been sent to draw. Where the hand is to go, and when to close, is what a scripted
pilot (`pilot.py`) does; how the hand gets there is a mouse's way: in the picture by the pointer, in depth by notches of
the wheel.
"""

import json
from collections.abc import Mapping
from typing import Any

from playwright.sync_api import Page

from handover.scenarios.study.session.pilot import ScriptedHand, SeenScene

NOTCH, PIXELS = 0.015, 100.0
"""What a notch of a wheel moves the hand by, m, and how many pixels it is."""
TURNS = {"+roll": "e", "-roll": "q", "+pitch": "w", "-pitch": "s", "+yaw": "a", "-yaw": "d"}
"""Keys that turn the hand as the practice asks."""
SEEN_AT = """places => {
    if (!study.play) return null;
    const camera = study.play.scene.camera, box = document.querySelector("#eye canvas").getBoundingClientRect();
    camera.updateMatrixWorld();
    const inside = (a, low, high) => Math.min(Math.max(a, low + 5), high - 5);
    return places.map(p => {
        const depth = camera.position.clone().set(...p).applyMatrix4(camera.matrixWorldInverse).z;
        const {x, y} = camera.position.clone().set(...p).project(camera);
        return [inside(box.left + (x + 1) / 2 * box.width, box.left, box.right),
            inside(box.top + (1 - y) / 2 * box.height, box.top, box.bottom), depth];
    });
}"""
"""Where points of W are seen from the person's eye, in pixels, and their depths towards it, m; null between runs."""


class _Run:
    """One run: what is seen of it, what is to be done, and what the mouse has done.

    Attributes:
        hand: what is to be done; None before anything is seen.
        closed, depth: to which the mouse has closed the hand, and led it, m; `depth` None before it has.
    """

    def __init__(self, scene: SeenScene) -> None:
        self.scene = scene
        self.hand: ScriptedHand | None = None
        self.closed = False
        self.depth: float | None = None

    def see(self, message: bytes, target: Mapping[str, Any] | None) -> None:
        """Take in a state of the run."""
        self.scene.take(message)
        if self.hand is None:
            self.hand = ScriptedHand(self.scene)
            self.closed = self.hand.closed
        self.hand.act(target)


class MouseHand:
    """Leads the hand of a study's page by its mouse and keys, through runs that begin one after the other.

    Args:
        page: the study's, not opened yet.
    """

    def __init__(self, page: Page) -> None:
        self._page = page
        self._run: _Run | None = None
        self._target: Mapping[str, Any] | None = None
        self._key = ""
        page.on("websocket", lambda connection: connection.on("framereceived", self._see))

    def _see(self, message: str | bytes) -> None:
        """Take in what the page is told to draw, and what is to be done about it."""
        if isinstance(message, bytes):
            if self._run is not None:
                self._run.see(message, self._target)
            return
        told = json.loads(message)
        if "scene" in told:
            self._run = _Run(SeenScene(told["scene"]))
        elif "target" in told:
            self._target = told["target"]
        elif "screen" in told and told["screen"]["screen"] != "practising":
            self._target = None

    def act(self) -> None:
        """Do for a moment what is called for."""
        run = self._run
        if run is not None and run.hand is not None:
            self._lead(run, run.hand)
        self._page.wait_for_timeout(15)

    def _lead(self, run: "_Run", hand: ScriptedHand) -> None:
        """Lead the hand to its place: by the pointer, and by as many notches as that is deeper than it was led."""
        places = [hand.place.tolist(), run.scene.place("hand").tolist()]
        seen: list[list[float]] | None = self._page.evaluate(SEEN_AT, places)
        if seen is None or run is not self._run:
            return
        (x, y, depth), (_, _, at_first) = seen
        run.depth = at_first if run.depth is None else run.depth
        if hand.closed != run.closed:
            self._page.mouse.down()
            self._page.mouse.up()
            run.closed = not run.closed
        self._turn(str((self._target or {}).get("name", "")))
        self._page.mouse.move(x, y)
        notches = round((depth - run.depth) / NOTCH)
        if notches:
            self._page.mouse.wheel(0, notches * PIXELS)
        run.depth += notches * NOTCH

    def _turn(self, name: str) -> None:
        """Hold the key that turns the hand as the practice asks, until it asks for something else."""
        key = TURNS.get(name, "")
        if key != self._key:
            if self._key:
                self._page.keyboard.up(self._key)
            if key:
                self._page.keyboard.down(key)
            self._key = key
