"""The command `handover run`: one run of a scenario, of an SSP or of an FMU."""

import contextlib
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.master.live_control import LiveControl
from handover.cosim.record.formats import RECORD_FORMATS
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Observer
from handover.scenarios.cli.config_file import ConfiguredCommand, config_option
from handover.scenarios.cli.console import reserve_stdout
from handover.scenarios.cli.master_options import coupling_of, master_options
from handover.scenarios.cli.options import (
    PATH,
    HeadedOption,
    Instant,
    Seconds,
    limit_options,
    limits,
    log_option,
    scenario_options,
    stop_option,
)
from handover.scenarios.cli.summaries.run import AS_JSON, RunEnding
from handover.scenarios.experiment.live_inputs import inputs_of_pushes
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.input_sources import played_back
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import logging_to_standard_error, progress_bar, say
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.task import InputSources, Task

_option = partial(click.option, cls=HeadedOption, heading="Of FILE.ssp and FILE.fmu")
_STEP = _option(
    "--step",
    type=Seconds(),
    metavar="SECONDS",
    help="Communication step of all units.  [default: what an SSP states, else what each FMU proposes, else a 500th of"
    " its default experiment]",
)
_START = _option(
    "--start",
    type=Instant(),
    metavar="SECONDS",
    help="When a run starts, such as 10 or -2.  [default: what the file's default experiment says, else 0]",
)
_INPUT = _option(
    "--input",
    "inputs",
    type=PATH,
    metavar="FILE.csv",
    help="Of an FMU: inputs over time, a column `time` and columns by input's name, in the inputs' units; continuous"
    " reals lie on lines between two times, all else is held.  [default: constant at their start values]",
)


def file_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--start`, `--step` and `--input`, which are for SSPs and FMUs."""
    return _START(_STEP(_INPUT(command)))


_HELP = """Run a SCENARIO once and write summary, signals, figures and a report into a folder.

FILE.ssp is a system from another tool (SSP 1.0 or 2.0), or from `handover export`: it runs until its stop time.
FILE.fmu is one unit, from any tool: it runs by itself, with its parameters set by -p and its inputs by --input.
Folders to which these were unpacked run, too, and a system by its FILE.ssd in one.

Ctrl-C ends the run after its step; what was recorded until then is kept. Ctrl-C again aborts.

The run is a process of its own: if a unit crashes it, the unit is named and the record completed. On Windows it
is not, and such a unit ends the command.
"""

_record_option = partial(click.option, cls=HeadedOption, heading="Record")
recorded_option = _record_option(
    "--record",
    "recorded",
    multiple=True,
    metavar="UNIT.NAME",
    help="Record a local variable or parameter of a unit, too; * and ? stand for any characters, as in 'arm.*'. May be"
    " given more than once.  [default: the outputs, or where there are none, the local variables]",
)
"""For commands that record runs."""


@click.command("run", cls=ConfiguredCommand, help=_HELP, context_settings={"show_default": True})
@click.argument("scenario", metavar="SCENARIO|FILE.ssp|FILE.fmu")
@config_option
@scenario_options
@stop_option
@log_option
@click.option("--out", type=PATH, help="Folder for the results.  [default: one of its own in runs/]")
@click.option("--no-report", is_flag=True, help="Write neither figures nor a report: `handover report` can, later.")
@click.option(
    "--strict",
    is_flag=True,
    help="Refuse units whose description is not as it should be, even where they can be run nonetheless: it breaks the"
    " standard, or proposes no step; see `handover check`.  [default: warn]",
)
@click.option(
    "--live",
    is_flag=True,
    help="Show the run in a browser while it goes on, at real time or --pace; it begins once the page is open.",
)
@click.option(
    "--push",
    is_flag=True,
    help="Let the page of --live push bodies that the scenario says; the record then has forces and points, and with"
    " --inputs-from and --push the same run is made once more.",
)
@click.option(
    "--webcam",
    type=PATH,
    metavar="FOLDER",
    help="Let a webcam lead the hand in the page of --live, by MediaPipe: the unpacked npm package"
    " @mediapipe/tasks-vision with the model hand_landmarker.task in it.  [default: not offered]",
)
@click.option("--controls", type=PATH, hidden=True, help="Folder of a process that controls it.")
@click.option(
    "--inputs-from",
    type=PATH,
    metavar="RUN",
    help="Folder of a run whose inputs from outside, such as a hand's, are played back: the same run once more, or"
    " another robot that meets the same hand.",
)
@click.option(AS_JSON, "as_json", is_flag=True, help="Print the summary as JSON, with the run's folder.")
@click.help_option("-h", "--help")
@file_options
@_record_option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(RECORD_FORMATS)),
    help="Format of the record; may be given more than once. Parquet is always written.  [default: parquet]",
)
@recorded_option
@_record_option(
    "--checkpoint",
    "every",
    type=Seconds(),
    metavar="SECONDS",
    help="Write a checkpoint every so many simulated seconds, for `handover resume`.",
)
@master_options
@limit_options
def run(
    scenario: str,
    parameters: Sequence[str],
    seed: int,
    replaced: Sequence[str],
    out: Path | None,
    start: Fraction | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    formats: Sequence[str],
    recorded: Sequence[str],
    every: Fraction | None,
    no_report: bool,
    live: bool,
    push: bool,
    webcam: Path | None,
    controls: Path | None,
    inputs_from: Path | None,
    as_json: bool,
    log_level: str | None,
    strict: bool,
    call_limit: float,
    pace: float | None,
    **coupling: Any,
) -> None:
    """Run a SCENARIO, an SSP or an FMU once."""
    json_to = reserve_stdout() if as_json else None
    with (
        Interruption() as interruption,
        one_line_errors(),
        logging_to_standard_error(log_level),
        contextlib.ExitStack() as opened,
    ):
        if not no_report:
            require_extra("reports", "report and figures", "--no-report")
        if live:
            if sys.platform == "win32":
                raise UsageError("--live: not on Windows yet; `handover report` shows a run that has ended")
            require_extra("reports", "--live")
            require_extra("live", "--live")
        if webcam is not None:
            _check_webcam(webcam, live=live)
        if push and not (live or controls or inputs_from):
            raise UsageError(
                "--push: it is the page of --live that pushes; --inputs-from makes a run that was pushed once more"
            )
        request = RunRequest(
            subject=scenario,
            parameters=parameters,
            seed=seed,
            units=replaced,
            out=out,
            start=start,
            stop=stop,
            step=step,
            inputs=inputs,
            sources=None if inputs_from is None else played_back(inputs_from),
            formats=tuple(dict.fromkeys(formats)),
            recorded=recorded,
            every=every,
            presented=not no_report,
            pushed=push,
        )
        request.check_options()
        options = MasterOptions(**coupling_of(coupling), **limits(call_limit, pace), strict=strict)
        task = replace(request, options=options).task(opened)
        control: LiveControl | None = None
        observer: Observer | None = None
        if live or controls:
            task, control, observer = opened.enter_context(_live(task, pace, controls, webcam))
        elif task.sources is None and task.experiment.led_hand(task.parameters) is not None:
            say("no hand input: the hand stays at its start: --live lets a page lead it")
        with contextlib.ExitStack() as bar:
            progress, ending = bar.enter_context(progress_bar(sys.stderr)), RunEnding(task, bar, json_to)
            result = run_task(task, progress, interruption, None, control, observer, ending.concluded)
        if request.sources is not None:
            _tell_end_of_inputs(task.folder, float(request.sources.origin["until"]))
    ending.exit(result)


def _tell_end_of_inputs(folder: RunFolder, until: float) -> None:
    """Say so if a run went on after the end of the inputs that it was given, at `until`, s."""
    record = whole_record_of(folder)
    if record is not None and len(record.time) and float(record.time[-1]) > until:
        say(
            f"the recorded inputs end at {until:.6g} s, and the run went on until {float(record.time[-1]):.6g} s: "
            "from then on they stayed as they were"
        )


def _check_webcam(folder: Path, *, live: bool) -> None:
    """Refuse a webcam that no page can offer, before anything starts."""
    if not live:
        raise UsageError("--webcam: it is the page of --live in which a webcam leads the hand")
    from handover.scenarios.live.webcam import InvalidWebcamFiles, WebcamFiles  # of the extra `live`

    try:
        WebcamFiles.read(folder)
    except InvalidWebcamFiles as e:
        raise UsageError(f"--webcam: {e}") from e


@contextlib.contextmanager
def _live(
    task: Task, pace: float | None, controls: Path | None, webcam: Path | None
) -> Generator[tuple[Task, LiveControl, Observer | None], None, None]:
    """Serve the run's page while it goes on, and a moment longer; or take another process's controls of the run.

    Yields:
        The task, whose inputs from outside the page gives if nobody else does, the run's controls, and what shows its
        camera pictures.
    """
    from handover.scenarios.live.process import controlled_from, live_page

    scenario, free = task.experiment, task.sources is None
    pushes: Mapping[str, int] = inputs_of_pushes(scenario.pushes(task.parameters)) if task.pushed and free else {}
    if task.pushed and free and not pushes:
        raise UsageError(f"--push: nothing can be pushed in {scenario.name}")
    hand = scenario.led_hand(task.parameters) if free else None
    if webcam is not None and hand is None:
        raise UsageError(
            f"--webcam: nobody leads a hand in this run of {scenario.name}; in a handover, -p hand=outside lets one"
        )
    with contextlib.ExitStack() as opened:
        if controls is not None:
            control, inputs = opened.enter_context(controlled_from(controls, pushes, hand))
        else:
            address, control, inputs = opened.enter_context(
                live_page(task.folder.path, pace or 1.0, pushes, hand, webcam, task.source.get("scenario", ""))
            )
            say(f"live: {address}  (the run begins once the page is open)")
        if sources := inputs.sources():
            task = replace(task, sources=InputSources(sources, {"from": "page"}))
        yield task, control, inputs.pictures
