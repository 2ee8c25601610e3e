"""The page of a run under way: passes the page's commands to the run's controls, and to the page what is to be seen.

The page gets the scene of a run once and then, some thirty times a second, where everything is; its plots once a
second.
"""

import asyncio
import json
import math
import sys
import time
from collections.abc import Callable, Collection, Sequence
from typing import Any, TypeVar

import pyarrow.dataset  # type: ignore # noqa: F401  imports pandas, see `_figures`
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import RecordNotWritten, nearest
from handover.scenarios.experiment.time_plot import TimePlot
from handover.scenarios.live.body_pushes import BodyPushes
from handover.scenarios.live.commands import (
    COMMANDS,
    LONGEST,
    Command,
    InvalidCommand,
    control_run,
    parse_command,
    plot_numbers,
    push_of,
    signal_names,
)
from handover.scenarios.live.connections import (
    HEADERS,
    POLICY_VIOLATION,
    TRY_AGAIN_LATER,
    BinaryMessage,
    MessageRate,
    close,
    is_same_origin,
    receive_text,
    too_many,
)
from handover.scenarios.live.hand_seat import accept, refuse
from handover.scenarios.live.live_html import begun_content, figure_json, hint_content, live_html
from handover.scenarios.live.live_scene import LiveScene
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.viewers import Viewers
from handover.scenarios.live.webcam import WebcamFiles
from handover.scenarios.runs.reporting.html import packed_json
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

T = TypeVar("T")

FRAME_PERIOD, PLOT_PERIOD = 1.0 / 30.0, 1.0
"""Time between two frames, and between two states of the plots, s."""
_PICTURE_PERIOD = 0.1
"""How often camera pictures are looked for, s."""
MOST_PAGES = 32
"""Pages that are shown a run at most: each costs its process time for every frame."""
_MOST_MESSAGES = 500
"""Messages of a page within a second; it sends some thirty as it pushes."""
_EARLY = 8.0
"""How long a device that leads a hand may come before the run's first row, s."""
_NO_RUN = "no run has begun yet whose hand could be led"
_NO_HAND = "nobody outside leads a hand in this run; -p hand=outside lets one, where the scenario has that parameter"
_POLL = 0.02
"""How often a folder is looked at until its run has begun, s."""


class LivePage:
    """A page for up to `MOST_PAGES` browsers that shows one run after the other.

    Args:
        webcam: files by which a webcam leads a hand; None where it is not offered.
    """

    longest = LONGEST
    """Characters; no command of a page is longer."""
    commands: Sequence[str] = COMMANDS

    def __init__(self, webcam: WebcamFiles | None = None) -> None:
        self._webcam = webcam
        self.shown: ShownRun | None = None
        self._viewers = Viewers(self.forget)
        self._pushes = BodyPushes()
        self._size: int | None = None  # how many numbers a frame has
        self._ended: ShownRun | None = None  # whose end was sent to pages

    def routes(self) -> Sequence[BaseRoute]:
        """Return what is served besides the page and its connection: what a webcam needs, where it is offered."""
        return () if self._webcam is None else self._webcam.routes()

    def html(self) -> str:
        """Return the page."""
        return live_html(self.shown.run.title if self.shown is not None else "", webcam=self._webcam is not None)

    async def page(self, _request: Request) -> Response:
        """Answer with the page."""
        return HTMLResponse(self.html(), headers=HEADERS)

    async def connection(self, page: WebSocket) -> None:
        """Serve one page until it is closed."""
        if not is_same_origin(page):
            await page.close(POLICY_VIOLATION)
            return
        await page.accept()
        if len(self._viewers.pages) >= MOST_PAGES:
            await close(page, TRY_AGAIN_LATER, f"{MOST_PAGES} pages are open already")
            return
        self._viewers.add(page)
        try:
            await self.greet(page)
            await self._listen(page)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._viewers.remove(page)

    async def _listen(self, page: WebSocket) -> None:
        """Carry out a page's commands, until it is closed or floods."""
        rate = MessageRate()
        while True:
            try:
                text = await receive_text(page)
            except BinaryMessage as e:
                text = None
                await self.send(page, {"refused": str(e)})
            if rate.count() > _MOST_MESSAGES:
                await close(page, POLICY_VIOLATION, too_many(_MOST_MESSAGES))
                return
            if text is not None:
                await self._execute(page, text)

    async def hand(self, device: WebSocket) -> None:
        """Serve a device that leads the hand of the run that is shown, which another one than the page may be."""
        late = time.monotonic() + _EARLY
        while (self.shown is None or self.shown.scene is None) and time.monotonic() < late:
            await asyncio.sleep(_POLL)
        if self.shown is not None and self.shown.seat is not None:
            await self.shown.seat.connection(device)
        elif await accept(device):
            if self.shown is not None and self.shown.scene is not None:
                await refuse(device, _NO_HAND, POLICY_VIOLATION)
            else:
                await refuse(device, _NO_RUN)

    async def greet(self, page: WebSocket) -> None:
        """Tell a page that has connected what is shown."""
        await self._tell_scene(page)
        await self._tell_state(page)
        if self.shown is not None and self._ended is self.shown:
            if self.shown.scene is not None:
                await self._send_frame()
                await self._send_plots(page)
            await self.send(page, {"ended": self.shown.run.verdict})

    def _push(self, page: WebSocket, value: Any) -> None:
        """Let a page push, or let go of what it has pushed."""
        shown = self.shown
        asked = push_of(value, () if shown is None else shown.pushes)
        if asked is None:
            self.forget(page)
        elif shown is not None:
            self._pushes.hold(page, asked, shown.push)

    def forget(self, page: WebSocket) -> None:
        """Release what this page pushes."""
        self._pushes.release(page)

    async def _execute(self, page: WebSocket, text: str) -> None:
        """Carry out a command; tell the page what is wrong with one that is none."""
        try:
            command = parse_command(text, self.longest)
            await self.execute(page, command)
        except InvalidCommand as e:
            await self.send(page, {"refused": str(e)})
            return
        if command.name != "push":  # which comes thirty times a second, and changes nothing that is sent
            await self._tell_states()

    async def execute(self, page: WebSocket, command: Command) -> None:
        """Carry out a command.

        Raises:
            InvalidCommand: it is none, or its value is not right.
        """
        name, value = command
        if name == "push":
            self._push(page, value)
            return
        if name not in self.commands:
            raise InvalidCommand(f"no command {name!r}: {nearest(name, self.commands)}")
        if name in ("choose", "see"):
            viewer = self._viewers.of(page)
            if name == "choose":
                scene = self.shown.scene if self.shown is not None else None
                viewer.chosen = signal_names(value, () if scene is None else scene.signals)
            else:
                viewer.seen = plot_numbers(value)
            await self._send_plots(page)
        elif self.shown is not None:
            control_run(self.shown.control, command)

    async def _tell_state(self, page: WebSocket) -> None:
        if self.shown is not None:
            control = self.shown.control
            pace = control.pace if math.isfinite(control.pace) else 0
            await self.send(page, {"state": {"pace": pace, "paused": control.paused}})

    async def show(self, shown: ShownRun, failed: Callable[[], bool] = lambda: False) -> None:
        """Show a run from its first row to its end; until its first row, the one before stays.

        Args:
            shown: the run.
            failed: says whether its process has ended.
        """
        self.shown = self.shown or shown
        while shown.scene is None and not shown.run.has_verdict and not failed():
            if scene := await asyncio.to_thread(shown.run.scene):
                shown.begin(scene)
            await asyncio.sleep(_POLL)
        try:
            if shown.scene is not None:
                await self._show_scene(shown, shown.scene)
                await self._follow(shown, shown.scene, failed)
            await self._end(shown)
        finally:  # not lost where this is cancelled, as another run is to be shown
            _leave_report(shown)

    async def _show_scene(self, shown: ShownRun, scene: LiveScene) -> None:
        """Show the scene of another run than before."""
        self._pushes.release_all()
        shown.scene, self.shown, self._size, self._ended = scene, shown, None, None
        await self._tell_scene(*self._viewers.pages)
        await self._tell_states()
        await self.begun()

    async def _follow(self, shown: ShownRun, scene: LiveScene, failed: Callable[[], bool]) -> None:
        loop = asyncio.get_running_loop()
        last_plots, last_pictures, started = 0.0, 0.0, False
        while not shown.run.has_verdict and not failed():
            began = loop.time()
            if self._viewers.ready and began - last_pictures >= _PICTURE_PERIOD:
                last_pictures = began
                if pictures := await asyncio.to_thread(shown.pictures):
                    await self.tell({"pictures": pictures})
            if self._viewers.pages and not started:
                started, shown.control.paused = True, False
                await self._tell_states()
            if self._viewers.pages and scene.refresh():
                await self._send_frame()
                if began - last_plots >= PLOT_PERIOD:
                    last_plots = began
                    await self._send_plots(*self._viewers.ready)
            await asyncio.sleep(max(FRAME_PERIOD - (loop.time() - began), 0.002))

    async def show_past(self, past: ShownRun) -> None:
        """Show a run that is over, from its record, at the pace that its controls say; these wait at its end."""
        scene, control = await self._read(past.run.recorded_scene), past.control
        if scene is None:
            return
        control.paused = control.stop = False
        await self._show_scene(past, scene)
        loop = asyncio.get_running_loop()
        t, before, last_plots = scene.begin, loop.time(), -math.inf
        while t < scene.end and not control.stop:
            await asyncio.sleep(FRAME_PERIOD)
            passed, before = loop.time() - before, loop.time()
            if control.take_step():
                t = scene.after(t)
            elif not control.paused:
                control.forget_steps()
                t = min(t + control.pace * passed, scene.end)
            scene.go_to(t)
            await self._send_frame()
            if before - last_plots >= PLOT_PERIOD:
                last_plots = before
                await self._send_plots(*self._viewers.ready)
        await self._tell_end(past)

    async def _read(self, read: Callable[[], T | None]) -> T | None:
        """Return what is read of a run's folder; None where somebody has damaged it since, of which pages are told."""
        try:
            return await asyncio.to_thread(read)
        except InvalidRunFolder as e:
            await self.tell({"refused": str(e)})
            return None

    async def _tell_states(self) -> None:
        for page in self._viewers.pages:
            await self._tell_state(page)

    async def begun(self) -> None:
        """Called when another run is shown."""

    async def _end(self, shown: ShownRun) -> None:
        if shown.scene is None and not shown.run.has_verdict:  # it never began: whoever began it says why
            return
        if shown.scene is not None:
            record = await self._read(lambda: whole_record_of(shown.run.folder))
            if record is not None:  # its last rows were never in the file of the newest ones
                shown.scene.complete(record)
            await self._send_frame()
        await self._tell_end(shown)  # before plots, which take long to draw
        await self._send_plots(*self._viewers.ready)
        await self._send_plots(*self._viewers.ready, unseen=True)

    async def _tell_end(self, shown: ShownRun) -> None:
        self._ended = shown
        await self.tell({"ended": shown.run.verdict})

    async def _tell_scene(self, *pages: WebSocket) -> None:
        """Send the scene of the run that is shown, where there is one."""
        if self.shown is None or self.shown.scene is None:
            return
        begun = packed_json({"begun": begun_content(self.shown)})
        for page in pages:
            await self._viewers.send(page, begun)
            self._viewers.of(page).ready = True

    async def _send_frame(self) -> None:
        assert self.shown is not None
        assert self.shown.scene is not None
        scene = self.shown.scene
        data = scene.places()
        if self._size not in (None, len(data)):  # other things are drawn than before
            await self._tell_scene(*self._viewers.pages)
        self._size = len(data)
        hint = None if self.shown.seat is None else scene.hand_hint
        head = json.dumps({"time": scene.time, "phase": scene.phase, "hint": hint and hint_content(hint)})
        for page in self._viewers.ready:
            await self._viewers.send(page, head)
            await self._viewers.send(page, data.astype("<f8").tobytes())

    async def _send_plots(self, *pages: WebSocket, unseen: bool = False) -> None:
        """Send plots to pages that have a scene; each is drawn once for all that chose the same signals.

        They are drawn in a thread: that takes long, and samples of a hand come meanwhile.

        Args:
            pages: these pages.
            unseen: whether those, too, that are not seen at present, as where no further ones come.
        """
        scene = self.shown.scene if self.shown is not None else None
        if scene is None:
            return
        seen: dict[tuple[str, ...], set[int]] = {}
        for viewer in map(self._viewers.of, pages):
            if viewer.ready:
                seen.setdefault(tuple(viewer.chosen), set()).update(viewer.seen)
        for chosen, numbers in seen.items():
            time_of_rows, plots = scene.history.time, scene.plots(chosen)
            numbers = set(range(len(plots))) if unseen else numbers
            figures = await asyncio.to_thread(_figures, plots, time_of_rows, frozenset(numbers))
            if self.shown is None or self.shown.scene is not scene:
                return
            for page in pages:
                viewer = self._viewers.of(page)
                if viewer.ready and tuple(viewer.chosen) == chosen:
                    content = [
                        {"title": plot.title, "figure": figures.get(i, "") if unseen or i in viewer.seen else ""}
                        for i, plot in enumerate(plots)
                    ]
                    await self.send(page, {"plots": content})

    async def tell(self, content: Any) -> None:
        """Send content to all pages."""
        await self._viewers.tell(content)

    async def send(self, page: WebSocket, content: Any) -> None:
        """Send content to a page, as JSON."""
        await self._viewers.send(page, json.dumps(content))


def _figures(plots: Sequence[TimePlot], time_of_rows: Floats, numbers: Collection[int]) -> dict[int, str]:
    """Return some of the plots as a page draws them, in JSON, by their numbers.

    Plotly uses pandas if it finds that among the modules; were it imported by the reading of a record meanwhile, in
    another thread, Plotly would find one half made.
    """
    return {i: figure_json(plot, time_of_rows) for i, plot in enumerate(plots) if i in numbers}


def _leave_report(shown: ShownRun) -> None:
    """Leave in the run's folder what led its hand; where the disk does not take it, the page goes on."""
    try:
        shown.end()
    except RecordNotWritten as e:
        print(f"the live page: {e}", file=sys.stderr)
