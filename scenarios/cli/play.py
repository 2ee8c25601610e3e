"""The command `handover play`: a scenario in a browser, run anew whenever one of its parameters is changed there."""

import asyncio
import contextlib
import socket
import sys
from collections.abc import Coroutine, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handover.cosim.exceptions import counted
from handover.scenarios.cli.options import PATH, FiniteRange, HeadedCommand, scenario_options, stop_option
from handover.scenarios.cli.run import file_options
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import say
from handover.scenarios.runs.execution.request import RUNS, RunRequest
from handover.scenarios.runs.results.run_folder import RunFolder, dated_folder

if TYPE_CHECKING:
    from handover.scenarios.live.play_page import Session

_HELP = """Play with the parameters of a SCENARIO in a browser, which shows its runs while they go on.

The page has a field with a slider or a choice for each parameter, also of its units. Where one is changed, the run
under way is ended and another one begins; verdicts of all runs stand side by side. Each is a run as of `handover run`,
in a folder of its own, and the page shows that command; reports are written when the page asks for them.

FILE.ssp and FILE.fmu can be played with, too: their signals are plotted, and of an FMU the inputs have fields like
parameters, whose values they keep unless --input says others. Ctrl-C ends the session.
"""


@click.command("play", cls=HeadedCommand, help=_HELP, short_help="Play with a SCENARIO's parameters in a browser.")
@click.argument("scenario", metavar="SCENARIO|FILE.ssp|FILE.fmu")
@scenario_options
@stop_option
@file_options
@click.option(
    "--pace",
    type=FiniteRange(min=0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="Simulated seconds in one second of the wall clock, at first.",
)
@click.option(
    "--out",
    type=PATH,
    help="Folder in which the runs' folders are made.  [default: one of its own in runs/]",
)
@click.help_option("-h", "--help")
def play(
    scenario: str,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    start: Fraction | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    pace: float,
    out: Path | None,
) -> None:
    """Play with the parameters of a SCENARIO, an SSP or an FMU."""
    if sys.platform == "win32":
        raise UsageError("handover play: not on Windows yet; `handover run` makes single runs")
    require_extra("reports", "handover play")
    require_extra("live", "handover play")
    with contextlib.ExitStack() as made:
        with Interruption(), one_line_errors(), contextlib.ExitStack() as opened:
            request = RunRequest(
                subject=scenario,
                parameters=parameters,
                seed=seed,
                units=replaced,
                start=start,
                stop=stop,
                step=step,
                inputs=inputs,
                presented=False,
            )
            request.check_options()
            subject = request.open(opened)
            asked = subject.experiment
            for line in request.system(subject, seed, request.fmus(asked)).remarks:
                say(line)
            folder = RunFolder(out or made.enter_context(dated_folder(RUNS, f"{Path(asked.name).stem}_play")))
            options = _options(replaced, {"--start": start, "--stop": stop, "--step": step, "--input": inputs})
            session = _session(request, asked, subject.parameters, options, folder.claim(made).shown, pace)
            served = _serve(session, made)
        asyncio.run(served)


def _options(replaced: Sequence[str], others: Mapping[str, object]) -> list[str]:
    """Return the options of `handover run` that all runs of a session have."""
    given = [part for text in replaced for part in ("--unit", text)]
    return given + [part for name, value in others.items() if value is not None for part in (name, str(value))]


def _session(
    request: RunRequest, asked: Experiment[Any], parameters: Any, options: Sequence[str], folder: Path, pace: float
) -> "Session":  # fmt: skip
    from handover.scenarios.live.parameter_fields import field_groups
    from handover.scenarios.live.play_page import Session  # of the extra `live`, as below

    return Session(
        title=f"{asked.name}: {asked.title}",
        request=request,
        groups=field_groups(request),
        headline=asked.headline,
        seeded=asked.is_seeded,
        pushable=bool(asked.pushes(parameters)),
        options=options,
        folder=folder,
        pace=pace,
    )


def _serve(session: "Session", made: contextlib.ExitStack) -> Coroutine[Any, Any, None]:
    """Return what serves a session's page until it ends; `made` closes its port. What takes long is done before."""
    from handover.scenarios.live.page_server import ended_by_signals
    from handover.scenarios.live.play_page import PlayPage
    from handover.scenarios.live.process import HOST
    from handover.scenarios.live.server import serve

    listening = made.enter_context(socket.create_server((HOST, 0)))

    async def served() -> None:
        page = PlayPage(session)
        with ended_by_signals(page.end):
            say(f"play: http://{HOST}:{listening.getsockname()[1]}/  (Ctrl-C ends the session)")
            await serve(page, page.work(), listening)
        runs = counted(page.runs, "run")
        say(f"{runs} in {session.folder}" if page.runs else "no run was begun")

    return served()
