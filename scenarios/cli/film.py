"""The command `handover film`: a run as a film, its scene beside plots with a cursor that moves."""

import re
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from handover.cosim.exceptions import counted
from handover.scenarios.cli.options import PATH, FiniteRange, check_new_file, refused_if_taken, trust_option
from handover.scenarios.pages.film import LARGEST, SMALLEST
from handover.scenarios.runs.campaign.folder import OF_NEITHER, CampaignFolder
from handover.scenarios.runs.execution.errors import FilmFailed, UsageError, one_line_errors, require_extra
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import doing, say, terminal_progress
from handover.scenarios.runs.results.run_folder import RunFolder

if TYPE_CHECKING:
    from handover.scenarios.pages.film.film import FilmSettings

_HELP = """Make a film of the run in DIR: its scene, and beside it plots over time with a cursor that moves.

The suffix of FILE says what it is: .mp4, .webm or .gif. It is drawn without a window in Chromium, by software, which
takes some seconds for each second of the film. On the report's page, "record a video" records the scene alone.
"""
_SUFFIXES = (".mp4", ".webm", ".gif")
_VIEWS = ("start", "front", "side", "top", "follow")
_GIF_FPS, _FPS, _FASTEST_GIF = 15.0, 30.0, 50.0


class Size(click.ParamType):  # type: ignore (generic in newer versions only)
    """Width and height in pixels, such as 1280x720."""

    name = "size"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Return width and height."""
        found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", str(value))
        size = (int(found[1]), int(found[2])) if found else (0, 0)
        if any(n % 2 or not SMALLEST <= n <= LARGEST for n in size):
            self.fail(
                f"{value!r} is not a size, such as 1280x720: two even numbers from {SMALLEST} to {LARGEST}", param, ctx
            )
        return size


@click.command("film", help=_HELP, short_help="Make a film of a run: its scene beside plots.")
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--out", "file", metavar="FILE", type=PATH, help="The film.  [default: DIR/film.mp4]")
@click.option("--force", is_flag=True, help="Replace FILE if it is there.")
@click.option(
    "--plot",
    "plots",
    multiple=True,
    metavar="TITLE|UNIT.PORT",
    help="One of the report's plots by its title, or a signal; UNIT.PORT[2] is an element. Several are shown below each"
    " other.  [default: the first one or two of the report's]",
)
@click.option("--no-plots", is_flag=True, help="Show the scene alone.")
@click.option(
    "--view", type=click.Choice(_VIEWS), default="start", show_default=True, help="From where the scene is seen."
)
@click.option("--size", type=Size(), default="1280x720", show_default=True, help="Width and height in pixels.")
@click.option(
    "--pace",
    type=FiniteRange(min=0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="FACTOR",
    help="Simulated seconds in one second of the film.",
)
@click.option(
    "--fps",
    type=FiniteRange(min=1, max=120),
    metavar="N",
    help=f"Frames per second.  [default: {_FPS:g}; of a GIF {_GIF_FPS:g}]",
)
@trust_option
@click.option("--dark", is_flag=True, help="In the report's dark colours.")
def film(
    folder: Path,
    file: Path | None,
    plots: Sequence[str],
    view: str,
    size: tuple[int, int],
    pace: float,
    fps: float | None,
    *,
    force: bool,
    no_plots: bool,
    dark: bool,
) -> None:
    """Make a film of a run."""
    with one_line_errors():
        if not folder.is_dir():
            raise UsageError(f"{folder} is not a folder; name that of a run")
        require_extra("film", "the film")
        run, path = _run(folder), file or folder / "film.mp4"
        _check(path, plots, fps, force=force, no_plots=no_plots)
        from handover.scenarios.pages.film.film import FilmSettings  # a browser's library takes long to load

        fps = fps or (_GIF_FPS if path.suffix.lower() == ".gif" else _FPS)
        settings = FilmSettings(size=size, pace=pace, fps=fps, view=view, dark=dark)
        with Interruption():
            frames = _film(run, path, None if no_plots else plots, settings, force=force)
    click.echo(f"film: {path}, {counted(frames, 'frame')}, {frames / fps:.1f} s at {fps:g} fps")


def _run(folder: Path) -> RunFolder:
    """Return the folder of a run.

    Raises:
        UsageError: it is none.
    """
    if CampaignFolder(folder).is_there:
        raise UsageError(f"{folder} is the folder of a campaign; name that of a run, as in {folder / 'runs'}")
    if not RunFolder.of_run(folder).is_there:
        raise UsageError(f"{folder} {OF_NEITHER}")
    return RunFolder.of_run(folder)


def _check(path: Path, plots: Sequence[str], fps: float | None, *, force: bool, no_plots: bool) -> None:
    """Refuse a film's file or options before anything starts.

    Raises:
        UsageError: they contradict each other, or the file cannot be written.
        InvalidRunFolder: its folder cannot be written to.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise UsageError(f"--out {path}: a film's name ends with {', '.join(_SUFFIXES[:-1])} or {_SUFFIXES[-1]}")
    if plots and no_plots:
        raise UsageError("--plot and --no-plots contradict each other")
    if suffix == ".gif" and fps and fps > _FASTEST_GIF:
        raise UsageError(f"--fps {fps:g}: viewers slow down a GIF of more than {_FASTEST_GIF:g} frames per second")
    check_new_file(f"--out {path}", path, force=force)


def _film(run: RunFolder, path: Path, plots: Sequence[str] | None, settings: "FilmSettings", *, force: bool) -> int:
    """Write the film; return how many frames it has.

    Raises:
        UsageError: there is no browser, nothing to be shown, or a file that is not to be replaced.
        FilmFailed: the browser failed.
    """
    from handover.scenarios.pages.film.browser import BrowserFailed, NoBrowser, window_of
    from handover.scenarios.pages.film.film import write_film
    from handover.scenarios.pages.film.film_page import NotFilmed, film_content
    from handover.scenarios.runs.execution.resume import complete_signals
    from handover.scenarios.runs.results.run_facts import RunFacts

    with run.held():
        RunFacts.read(run)  # before anything is completed: it may be no run's folder at all
        complete_signals(run)
    try:
        with doing("reading the record"):
            content = film_content(run, plots, window_of(settings.size)[0][1])
        for line in content.notes:
            say(line)
        with refused_if_taken(f"--out {path}"), _progress(sys.stderr) as report:
            return write_film(content, path, settings, report, replace=force)
    except (NotFilmed, NoBrowser) as e:
        raise UsageError(str(e)) from e
    except BrowserFailed as e:
        raise FilmFailed(str(e)) from e


@contextmanager
def _progress(stream: TextIO) -> Generator[Callable[[int, int], None], None, None]:
    """Show a bar where the stream is a terminal; give what takes how many frames are done, and of how many."""
    columns = (
        TextColumn("frame {task.completed:.0f} of {task.total:.0f}"),
        BarColumn(bar_width=30),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with terminal_progress(stream, *columns) as progress:
        task = progress.add_task("film", total=1.0)

        def report(done: int, of: int) -> None:
            progress.update(task, completed=done, total=of)

        yield report
