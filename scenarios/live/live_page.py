"""The page of a run under way: passes the page's commands to the run's controls, and to the page what is to be seen.

The page gets the scene of a run once and then, some thirty times a second, where everything is; its plots once a
second.
"""

import asyncio
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.experiment.time_plot import TimePlot
from handover.scenarios.live.commands import (
    COMMANDS,
    LONGEST,
    Command,
    InvalidCommand,
    Push,
    pace_of,
    parse_command,
    plot_numbers,
    push_of,
    signal_names,
)
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.stage import Stage
from handover.scenarios.live.webcam import WEBCAM_SCRIPTS, WebcamFiles
from handover.scenarios.reporting.html import packed_json
from handover.scenarios.reporting.page import Section, asset, page_html, template
from handover.scenarios.reporting.replay_section import FILM_HTML, SCENE_SCRIPTS, STAGE_HTML
from handover.scenarios.reporting.time_plots import time_figure
from handover.scenarios.results.run_facts import whole_record_of

FRAME_PERIOD, PLOT_PERIOD = 1.0 / 30.0, 1.0
"""Time between two frames, and between two states of the plots, s."""
_PICTURE_PERIOD = 0.1
"""How often camera pictures are looked for, s."""
_SLOWEST = 2.0
"""How long a page may take to receive a message, s; it gets no more after that."""
_PATIENCE = 120.0
"""How long a run may take until its first row, s."""
_EARLY = 8.0
"""How long a device that leads a hand may come before the run's first row, s."""
_POLL = 0.02
"""How often a folder is looked at until its run has begun, s."""


@dataclass
class _Viewer:
    """What a page shows: signals that it chose, by number the plots that are seen in it, and whether it has a scene."""

    chosen: list[str] = field(default_factory=list[str])
    seen: set[int] = field(default_factory=set[int])
    ready: bool = False


class LivePage:
    """A page for any number of browsers that shows one run after the other.

    Args:
        webcam: files by which a webcam leads a hand; None where it is not offered.
    """

    longest = LONGEST
    """Bytes; no command of a page is longer."""
    commands: Sequence[str] = COMMANDS

    def __init__(self, webcam: WebcamFiles | None = None) -> None:
        self._webcam = webcam
        self.shown: ShownRun | None = None
        self._pages: dict[WebSocket, _Viewer] = {}
        self._size: int | None = None  # how many numbers a frame has
        self._pushing: WebSocket | None = None

    def routes(self) -> Sequence[BaseRoute]:
        """Return what is served besides the page and its connection: what a webcam needs, where it is offered."""
        return () if self._webcam is None else self._webcam.routes()

    def html(self) -> str:
        """Return the page."""
        return live_html(self.shown.run.title if self.shown is not None else "", webcam=self._webcam is not None)

    async def page(self, _request: Request) -> Response:
        """Answer with the page."""
        return HTMLResponse(self.html())

    async def connection(self, page: WebSocket) -> None:
        """Serve one page until it is closed."""
        origin = page.headers.get("origin", "")
        if origin.partition("://")[2] != page.headers.get("host"):
            await page.close(code=1008)
            return
        await page.accept()
        self._pages[page] = _Viewer()
        await self.greet(page)
        try:
            while True:
                await self._execute(page, await page.receive_text())
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages.pop(page, None)
            self.forget(page)

    async def hand(self, device: WebSocket) -> None:
        """Serve a device that leads the hand of the run that is shown, which another one than the page may be."""
        late = time.monotonic() + _EARLY
        while (self.shown is None or self.shown.stage is None) and time.monotonic() < late:
            await asyncio.sleep(_POLL)
        if self.shown is None or self.shown.seat is None:
            await device.close(code=1008)
        else:
            await self.shown.seat.connection(device)

    async def greet(self, page: WebSocket) -> None:
        """Tell a page that has connected what is shown."""
        await self._tell_stage(page)
        await self._tell_state(page)

    def _push(self, page: WebSocket, value: Any) -> None:
        """Let a page push, or let go of what it has pushed."""
        shown = self.shown
        asked = push_of(value, () if shown is None else shown.pushes)
        if asked is None:
            self.forget(page)
        elif shown is not None:
            shown.push(asked)
            self._pushing = page

    def forget(self, page: WebSocket) -> None:
        """Take in that a page pushes no more, as when it was closed."""
        if self._pushing is page and self.shown is not None:
            self._pushing = None
            for body in self.shown.pushes:
                self.shown.push(Push(body, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))

    async def _execute(self, page: WebSocket, text: str) -> None:
        """Carry out a command; tell the page what is wrong with one that is none."""
        try:
            await self.execute(page, parse_command(text, self.longest))
        except InvalidCommand as e:
            await self.send(page, {"refused": str(e)})
            return
        if self._pushing is page:
            return
        for other in list(self._pages):
            await self._tell_state(other)

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
            raise InvalidCommand(f"no command {name!r}: {', '.join(self.commands)} are")
        if name in ("choose", "see"):
            viewer = self._pages[page]
            if name == "choose":
                stage = self.shown.stage if self.shown is not None else None
                viewer.chosen = signal_names(value, () if stage is None else stage.signals)
            else:
                viewer.seen = plot_numbers(value)
            await self._send_plots()
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
        late = time.monotonic() + _PATIENCE
        while shown.stage is None:
            if shown.run.is_over or failed() or time.monotonic() > late:
                break
            if stage := await asyncio.to_thread(shown.run.stage):
                shown.begin(stage)
            await asyncio.sleep(_POLL)
        if shown.stage is not None:
            self.shown, self._size = shown, None
            await self._tell_stage(*self._pages)
            await self.begun()
            await self._follow(shown, shown.stage, failed)
        await self._end(shown)

    async def _follow(self, shown: ShownRun, stage: Stage, failed: Callable[[], bool]) -> None:
        loop = asyncio.get_running_loop()
        last_plots, last_pictures, started = 0.0, 0.0, False
        while not shown.run.is_over and not failed():
            began = loop.time()
            if self._ready() and began - last_pictures >= _PICTURE_PERIOD:
                last_pictures = began
                if pictures := await asyncio.to_thread(shown.pictures):
                    await self.tell({"pictures": pictures})
            if self._pages and not started:
                started, shown.control.paused = True, False
                await self._tell_states()
            if self._pages and stage.refresh():
                await self._send_frame()
                if began - last_plots >= PLOT_PERIOD:
                    last_plots = began
                    await self._send_plots()
            await asyncio.sleep(max(FRAME_PERIOD - (loop.time() - began), 0.002))

    async def show_past(self, past: ShownRun) -> None:
        """Show a run that is over, from its record, at the pace that its controls say; these wait at its end."""
        stage, control = await asyncio.to_thread(past.run.past_stage), past.control
        if stage is None:
            return
        past.stage, self.shown, self._size = stage, past, None
        control.paused = control.stop = False
        await self._tell_stage(*self._pages)
        await self._tell_states()
        await self.begun()
        loop = asyncio.get_running_loop()
        t, before, last_plots = stage.begin, loop.time(), -math.inf
        while t < stage.end and not control.stop:
            await asyncio.sleep(FRAME_PERIOD)
            passed, before = loop.time() - before, loop.time()
            if control.take_step():
                t = stage.after(t)
            elif not control.paused:
                control.forget_steps()
                t = min(t + control.pace * passed, stage.end)
            stage.go_to(t)
            await self._send_frame()
            if before - last_plots >= PLOT_PERIOD:
                last_plots = before
                await self._send_plots()
        await self.tell({"ended": past.run.verdict})

    async def _tell_states(self) -> None:
        for page in list(self._pages):
            await self._tell_state(page)

    async def begun(self) -> None:
        """Take in that another run is shown."""

    async def _end(self, shown: ShownRun) -> None:
        if shown.stage is None and not shown.run.is_over:  # it never began: whoever began it says why
            return
        if shown.stage is not None:
            record = whole_record_of(shown.run.folder)
            if record is not None:  # its last rows were never in the file of the newest ones
                shown.stage.complete(record)
            await self._send_frame()
            await self._send_plots()
        shown.end()
        await self.tell({"ended": shown.run.verdict})

    async def _tell_stage(self, *pages: WebSocket) -> None:
        """Send the scene of the run that is shown, where there is one."""
        if self.shown is None or self.shown.stage is None:
            return
        begun = packed_json({"begun": stage_content(self.shown)})
        for page in pages:
            await self._send(page, begun)
            if page in self._pages:
                self._pages[page].ready = True

    async def _send_frame(self) -> None:
        assert self.shown is not None
        assert self.shown.stage is not None
        stage = self.shown.stage
        data = stage.places()
        if self._size not in (None, len(data)):  # other things are drawn than before
            await self._tell_stage(*self._pages)
        self._size = len(data)
        head = json.dumps({"time": stage.time, "phase": stage.phase})
        for page in self._ready():
            await self._send(page, head)
            await self._send(page, data.astype("<f8").tobytes())

    async def _send_plots(self) -> None:
        stage = self.shown.stage if self.shown is not None else None
        if stage is None:
            return
        for page in self._ready():
            viewer = self._pages.get(page, _Viewer())
            figures = [
                {"title": plot.title, "figure": figure_json(plot, stage) if i in viewer.seen else ""}
                for i, plot in enumerate(stage.plots(viewer.chosen))
            ]
            await self.send(page, {"plots": figures})

    def _ready(self) -> list[WebSocket]:
        return [page for page, viewer in self._pages.items() if viewer.ready]

    async def tell(self, content: Any) -> None:
        """Send content to all pages."""
        for page in list(self._pages):
            await self.send(page, content)

    async def send(self, page: WebSocket, content: Any) -> None:
        """Send content to a page, as JSON."""
        await self._send(page, json.dumps(content))

    async def _send(self, page: WebSocket, message: str | bytes) -> None:
        sending = page.send_bytes(message) if isinstance(message, bytes) else page.send_text(message)
        try:
            await asyncio.wait_for(sending, _SLOWEST)
        except (WebSocketDisconnect, RuntimeError, TimeoutError, asyncio.TimeoutError):
            self._pages.pop(page, None)


def control_run(control: LiveControl, command: Command) -> None:
    """Carry out a command that controls a run.

    Raises:
        InvalidCommand: its value is not right.
    """
    name, value = command
    if name == "pace":
        control.pace = pace_of(value)
    elif name == "pause":
        control.paused = True
    elif name == "go":
        control.paused = False
    elif name == "step":
        control.ask_for_step()
    elif name == "stop":
        control.stop, control.paused = True, False


def figure_json(plot: TimePlot, stage: Stage) -> str:
    """Return a plot of what was seen until now as the page draws it, in JSON."""
    return packed_json(time_figure(plot, stage.history.time).to_dict())


def stage_content(shown: ShownRun) -> dict[str, Any]:
    """Return what a page is told when a run begins."""
    stage = shown.stage
    assert stage is not None
    surroundings = {name: str(html) for name, html in stage.surroundings().items()}
    pushes = [{"bodies": push.labels, "greatest": push.greatest} for push in shown.pushes]
    told = {"title": shown.run.title, "scene": stage.scene(), "signals": list(stage.signals), "pushes": pushes}
    return {**told, **surroundings, "hand": shown.seat is not None}


def live_html(
    title: str,
    beside: Markup | None = None,
    scripts: Sequence[str] = (),
    styles: Sequence[str] = (),
    *,
    webcam: bool = False,
) -> str:
    """Return the page of runs under way, which draws what its connection tells.

    Args:
        title: the heading.
        beside: what stands beside the scene.
        scripts: names of further scripts.
        styles: names of further styles.
        webcam: whether one is offered to lead a hand.
    """
    hand = Markup(template("live_hand.html").render(webcam=webcam))
    html = template("live.html").render(stage=STAGE_HTML, film=FILM_HTML, hand=hand, beside=beside or Markup())
    style = Markup("<style>{}</style>").format(Markup("\n".join(map(asset, ("replay.css", "live.css", *styles)))))
    section = Section(
        anchor="live",
        title="Live",
        html=style + Markup(html),
        scripts=(
            *(*SCENE_SCRIPTS, "phases.js", "hand_input.js"),
            *(WEBCAM_SCRIPTS if webcam else ()),
            *("live_hand.js", "live.js", "push.js", *scripts),
        ),
    )
    return page_html(title, Markup(""), [section], connects=True, works=webcam)
