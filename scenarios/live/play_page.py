"""The page of `handover play`: fields for the parameters, a run begun anew when one changes, all runs side by side.

What is refused is shown beside its field, and the run under way goes on. A browser may ask for nothing but this page,
and for the report of one of the session's runs.
"""

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute, Route
from starlette.websockets import WebSocket

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.live.commands import COMMANDS, Command, choice_of, pace_of, run_number
from handover.scenarios.live.connections import HEADERS
from handover.scenarios.live.live_html import live_html
from handover.scenarios.live.live_page import LivePage
from handover.scenarios.live.parameter_fields import FieldGroup, faults_by_name, named_in, without_call
from handover.scenarios.live.played_run import Choice, PlayedRun
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.waiting_command import WaitingCommand
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.reporting.page import template

_PATIENCE = 15.0
"""How long a run may take to end after its step, s."""
_POLL = 0.05


@dataclass(frozen=True)
class Session:
    """What a session plays with.

    Attributes:
        title: the page's heading.
        request: what all its runs have in common; its parameters and its seed are the first run's.
        groups: fields of the parameters.
        headline: names of the metrics that are shown; all where there are none.
        seeded: whether runs have a seed.
        pushable: whether something can be pushed.
        options: those of `handover run` that all runs have.
        folder: in which the runs' folders are made.
        pace: simulated seconds per second at first.
    """

    title: str
    request: RunRequest
    groups: Sequence[FieldGroup]
    headline: Sequence[str]
    seeded: bool
    pushable: bool
    options: Sequence[str]
    folder: Path
    pace: float

    @property
    def names(self) -> list[str]:
        """Names of all parameters."""
        return [f.name for group in self.groups for f in group.fields]

    def first(self) -> Choice:
        """Return what the first run is asked to be."""
        given = [text.partition("=") for text in self.request.parameters]
        return Choice({name: value for name, _, value in given}, self.request.seed if self.seeded else None)


class PlayPage(LivePage):
    """The page of a session.

    Args:
        session: what is played with.
    """

    longest = 100_000
    commands = (*COMMANDS, "set", "show", "report")

    def __init__(self, session: Session) -> None:
        super().__init__()
        self._session, self._wanted = session, session.first()
        self._changed = asyncio.Event()
        self._runs: list[PlayedRun] = []
        self._waiting = WaitingCommand(str(session.request.subject))
        self._faults: dict[str, str] = {}
        self._pace = session.pace  # which the next run begins with
        self._task: asyncio.Task[None] | None = None  # shows a run
        self._changing = asyncio.Lock()  # held from the end of what is shown until something else is
        self._closing: set[asyncio.Task[None]] = set()  # of runs that have ended
        self.over = False
        """Whether the session is to end."""

    def routes(self) -> Sequence[BaseRoute]:
        """Return the way to the reports of runs."""
        return [Route("/report/{number:int}", self._report_page)]

    def html(self) -> str:
        """Return the page."""
        beside = Markup(template("live/play.html").render())
        return live_html(self._session.title, beside, scripts=["live/play.js"], styles=["live/play.css"])

    async def greet(self, page: WebSocket) -> None:
        """Tell a page that has connected what there is to set, and what is shown."""
        session = self._session
        fields = {
            "groups": [g.as_data() for g in session.groups],
            "seeded": session.seeded,
            "pushable": session.pushable,
        }
        await self.send(page, {"fields": fields})
        await self.send(page, self._about_choice())
        await self.send(page, {"runs": self._rows()})
        await super().greet(page)

    async def execute(self, page: WebSocket, command: Command) -> None:
        """Carry out a command."""
        name, value = command
        if name == "pace":
            self._pace = pace_of(value)
        if name == "set":
            self._wanted = choice_of(value, self._session.names, seeded=self._session.seeded)
            self._changed.set()
        elif name in ("show", "report"):
            number = run_number(value, [run.number for run in self._runs if run.watched.has_verdict])
            run = next(run for run in self._runs if run.number == number)
            await (self._write_report(page, run) if name == "report" else self._show_again(run))
        else:
            await super().execute(page, command)

    async def work(self) -> None:
        """Begin a run at first, and whenever another one is asked for, until the session is over."""
        self._changed.set()
        while not self.over:
            await self._changed.wait()
            self._changed.clear()
            if self.over:
                break
            wanted = self._wanted
            request = wanted.of(self._session.request)
            faults = await asyncio.to_thread(faults_by_name, request, self._session.names)
            if self._changed.is_set():
                continue
            self._faults = faults
            await self.tell(self._about_choice())
            if not faults:
                await self._begin(wanted)
        async with self._changing:
            await self._end_last()
        await asyncio.gather(*self._closing)
        for opened in (self._waiting, *self._runs):
            await asyncio.to_thread(opened.close)

    @property
    def runs(self) -> int:
        """How many runs were begun."""
        return len(self._runs)

    def end(self) -> None:
        """End the session; where it is ending already, without waiting for its run."""
        if self.over and self._runs:
            self._runs[-1].kill()
        self.over = True
        self._changed.set()

    async def _begin(self, wanted: Choice) -> None:
        async with self._changing:
            session, number = self._session, max((run.number for run in self._runs), default=0) + 1
            folder, subject = session.folder / f"{number:03d}", str(session.request.subject)
            run = PlayedRun(number, wanted, subject, session.options, folder, self._pace, self._waiting)
            self._waiting = WaitingCommand(subject)
            await self._end_last()
            run.control.pace = self._pace  # which may have been set meanwhile
            self._runs.append(run)
            self._task = asyncio.create_task(self._show_run(run))

    async def _end_last(self) -> None:
        """End the run under way, and cease to show it or another one."""
        if self._runs and not self._runs[-1].has_ended:
            run = self._runs[-1]
            run.superseded = True
            run.end()
            late = asyncio.get_running_loop().time() + _PATIENCE
            while not run.has_ended:
                if asyncio.get_running_loop().time() > late:
                    run.kill()
                await asyncio.sleep(_POLL)
        await self._cease()
        if self._runs:
            self._release(self._runs[-1])
        await self._tell_runs()

    def _release(self, run: PlayedRun) -> None:
        """Release what a run that has ended holds besides its folder, once its process has gone."""
        closing = asyncio.create_task(asyncio.to_thread(run.close))
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)

    async def _cease(self) -> None:
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None

    async def _show_run(self, run: PlayedRun) -> None:
        await self._tell_runs()
        await self.show(ShownRun(run.watched, run.control, run.controls), lambda: run.has_ended)
        while not run.has_ended:
            await asyncio.sleep(_POLL)
        if run.is_refused:
            # what is wrong with what was changed since then is shown besides
            self._faults = {named_in(run.error, self._session.names): without_call(run.error), **self._faults}
            self._runs.remove(run)
            await self.tell(self._about_choice())
        self._release(run)
        await self._tell_runs()

    async def _show_again(self, run: PlayedRun) -> None:
        """Show a run that is over once more, at the pace that the page sets; the one under way is ended."""
        async with self._changing:
            await self._end_last()
            if not self.over:
                self._task = asyncio.create_task(self._replay(run))

    async def _replay(self, run: PlayedRun) -> None:
        control = LiveControl.in_memory(self._pace)
        await self.show_past(ShownRun(run.watched, control, run.controls))

    async def _write_report(self, page: WebSocket, run: PlayedRun) -> None:
        if not run.has_report:
            fault = await asyncio.to_thread(run.write_report)
            if fault:
                await self.send(page, {"refused": fault})
        await self._tell_runs()

    async def _report_page(self, request: Request) -> Response:
        number = request.path_params["number"]
        runs = [run for run in self._runs if run.number == number and run.has_report]
        if not runs:
            return Response("There is no such report.", status_code=404)
        return HTMLResponse(runs[0].watched.folder.report.read_text(encoding="utf-8"), headers=HEADERS)

    def _about_choice(self) -> dict[str, Any]:
        wanted = self._wanted
        choice = {"parameters": dict(wanted.parameters), "seed": wanted.seed, "push": wanted.pushed}
        return {"choice": {**choice, "faults": self._faults}}

    def _rows(self) -> dict[str, Any]:
        seen = [run.number for run in self._runs if self.shown is not None and run.watched is self.shown.run]
        return {"rows": [run.row(self._session.headline) for run in self._runs], "seen": seen[0] if seen else None}

    async def begun(self) -> None:
        """Tell which run is shown."""
        await self._tell_runs()

    async def _tell_runs(self) -> None:
        await self.tell({"runs": self._rows()})
