"""The command `handover study serve`: carries out a study on this computer, in a browser."""

import asyncio
import sys
from pathlib import Path

import click

from handover.scenarios.cli.options import PATH, FiniteRange
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.progress import say

_HELP = """Carry out the study of PLAN.toml on this computer: a page, one participant after the other.

The page goes from consent to thanks; what comes of it is in DIR, a folder a participant. Ctrl-C ends it. The
same command goes on: where a session was broken off, the page first asks whether that participant goes on, or a new
one begins. No finished round is lost. `handover study withdraw` takes a session that was given up out of the choice.

The page is for this computer alone, unless --host names an address of it: then the page's address holds a token,
and who knows it may take part.

With a plan of scripted pilots (pilot = true) --pilot plays them, too: a script in the place of people, which leads
the hand by what the page shows.
"""


@click.command("serve", help=_HELP, short_help="Carry out a study: the page that people take part in.")
@click.argument("file", metavar="PLAN.toml", type=PATH)
@click.option("--out", required=True, type=PATH, metavar="DIR", help="Folder of the study.")
@click.option("--host", default="127.0.0.1", show_default=True, metavar="ADDRESS", help="Address that it listens on.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port.  [default: one that is free]")
@click.option(
    "--participant",
    type=click.IntRange(1, 999),
    metavar="N",
    help="Number of the first participant.  [default: the next; the page asks, if a session is not complete]",
)
@click.option(
    "--webcam",
    "webcam_folder",
    type=PATH,
    metavar="FOLDER",
    help="Offer the plan's device webcam, by MediaPipe: the unpacked npm package @mediapipe/tasks-vision with the model"
    " hand_landmarker.task in it.  [default: not offered]",
)
@click.option(
    "--photodiode",
    is_flag=True,
    help="Show a square that changes between black and white with each picture of a new sample of the hand: a"
    " photodiode there checks the latency that the page measures.",
)
@click.option("--pilot", is_flag=True, help="Let a script take part in the place of people, until all have.")
@click.option(
    "--pace",
    type=FiniteRange(0.1, 100.0),
    metavar="N",
    help="Of scripted pilots: simulated seconds per second.  [default: 1]",
)
@click.help_option("-h", "--help")
def serve(
    file: Path,
    out: Path,
    host: str,
    port: int,
    participant: int | None,
    webcam_folder: Path | None,
    *,
    photodiode: bool,
    pilot: bool,
    pace: float | None,
) -> None:
    """Carry out a study."""
    from handover.scenarios.cli.study.group import checked_plan

    if sys.platform == "win32":
        raise UsageError("handover study serve: not on Windows yet; `handover study plan` and `report` are")
    with one_line_errors():
        for extra in ("reports", "live"):
            require_extra(extra, "handover study serve")
        plan = checked_plan(file)
        if pilot and not plan.pilot:
            raise UsageError(f"--pilot: {file} is of people; a plan of scripted pilots has pilot = true")
        if pace is not None and not plan.pilot:
            raise UsageError(f"--pace: {file} is of people, who live at pace 1; of scripted pilots it may be another")
        if participant is not None and participant > plan.participants:
            raise UsageError(f"--participant: the plan has {plan.participants}, not {participant}")
        from handover.scenarios.live.webcam import InvalidWebcamFiles, WebcamFiles
        from handover.scenarios.study.plan.plan import WEBCAM
        from handover.scenarios.study.session.served_study import (  # uvicorn and starlette, of the extra
            NotServed,
            PilotsBrokenOff,
            serve_study,
        )

        if webcam_folder is not None and WEBCAM not in plan.devices:
            raise UsageError(f"--webcam: {file} has no device {WEBCAM!r}; it has {', '.join(plan.devices)}")
        try:
            webcam = None if webcam_folder is None else WebcamFiles.read(webcam_folder)
        except InvalidWebcamFiles as e:
            raise UsageError(f"--webcam: {e}") from e
        try:
            asyncio.run(
                serve_study(
                    plan,
                    out,
                    host=host,
                    port=port,
                    number=participant,
                    pace=pace or 1.0,
                    pilot=pilot,
                    webcam=webcam,
                    photodiode=photodiode,
                    tell=say,
                )
            )
        except NotServed as e:
            raise UsageError(str(e)) from e
        except PilotsBrokenOff as e:
            raise click.ClickException(str(e)) from e
