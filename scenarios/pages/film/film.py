"""Films a run: frame after frame is drawn and encoded, at a pace of simulated seconds a second."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.pages.film import LARGEST
from handover.scenarios.pages.film.browser import open_camera, window_of
from handover.scenarios.pages.film.encoder import film_to
from handover.scenarios.pages.film.film_page import FilmContent, NotFilmed, film_html, most_plots
from handover.scenarios.runs.results.run_folder import make_folder_of

_MOST_FRAMES = 200_000
"""Nearly two hours at 30 frames a second."""


@dataclass(frozen=True, kw_only=True)
class FilmSettings:
    """How a run is filmed.

    Attributes:
        size: width and height, px; even numbers.
        pace: simulated seconds in a second of the film.
        fps: frames per second.
        view: one of `VIEWS`.
        dark: whether the page has its dark colours.
    """

    size: tuple[int, int] = (1280, 720)
    pace: float = 1.0
    fps: float = 30.0
    view: str = "start"
    dark: bool = False


def frame_times(begin: float, end: float, settings: FilmSettings) -> Floats:
    """Return the simulated times of a film's frames, s: evenly spaced from the record's begin, and its end.

    Raises:
        NotFilmed: they are too many, or the record's time goes back.
    """
    if end < begin:
        raise NotFilmed(f"the record's time goes back, from {begin:g} to {end:g} s")
    steps = (end - begin) * settings.fps / settings.pace
    if not steps <= _MOST_FRAMES:
        faster = f"{1.05 * (end - begin) * settings.fps / _MOST_FRAMES:.2g}"  # two digits, none of them too small
        raise NotFilmed(
            f"{steps:.3g} frames are too many, at most {_MOST_FRAMES} are possible: --pace {faster}, or faster"
        )
    whole = int(steps * (1.0 + 1e-9))
    times: Floats = begin + np.arange(whole + 1, dtype=np.float64) * (settings.pace / settings.fps)
    return times if steps - whole < 1e-6 * max(steps, 1.0) else np.append(times, end)


def write_film(
    content: FilmContent,
    path: Path,
    settings: FilmSettings,
    report: Callable[[int, int], None],
    *,
    replace: bool,
) -> int:
    """Write a film; return how many frames it has.

    Args:
        content: what it shows.
        path: see `film_to`.
        settings: how it is filmed.
        report: is called with how many frames are done, and of how many.
        replace: whether a file of its name is replaced, when the film is complete.

    Raises:
        NotFilmed: its plots do not fit, its frames are too many, or its scene follows nothing.
        NoBrowser, BrowserFailed: it cannot be drawn.
        RecordNotWritten: it cannot be written. FileTaken: there is a file, which is not to be replaced.
    """
    _check_room(content, settings.size)
    times = frame_times(*content.span, settings)
    html = film_html(content, window_of(settings.size)[0], settings.view)
    make_folder_of(path)
    with (
        open_camera(html, settings.size, dark=settings.dark) as camera,
        film_to(path, settings.fps, replace=replace) as film,
    ):
        for k, t in enumerate(times.tolist()):
            report(k, len(times))
            film(camera(min(t, content.span[1])))
    return len(times)


def _check_room(content: FilmContent, size: tuple[int, int]) -> None:
    """Check that the plots fit into a film of a size, px.

    Raises:
        NotFilmed: they do not; the message names the height from which they do.
    """
    count, scene, (width, height) = len(content.plots), content.replay is not None, size
    most = most_plots(window_of(size)[0], scene=scene)
    if count <= most:
        return
    needed = _height_for(count, size, scene=scene)
    if needed is None:
        raise NotFilmed(
            f"{count} plots do not fit into {width} pixels of width at any height up to {LARGEST}; choose fewer by "
            "--plot"
        )
    cure = f"--size {width}x{needed} has room for {'it' if count == 1 else 'them'}"
    if most == 0:
        fault = counted(count, "plot does not", "plots do not")
        raise NotFilmed(f"{fault} fit into {width}x{height} pixels; {cure}, --no-plots shows the scene alone")
    raise NotFilmed(f"{count} plots do not fit into {width}x{height} pixels, {counted(most, 'does', 'do')}; {cure}")


def _height_for(count: int, size: tuple[int, int], *, scene: bool) -> int | None:
    """Return the least height with room for some plots, px, if the size's width and scale of letters are kept.

    None if no film is as high.
    """
    scale = window_of(size)[1]
    heights = range(size[1], LARGEST + 1, 2)  # a film's sizes are even
    windows = ((height, *window_of((size[0], height))) for height in heights)
    fitting = (h for h, window, its in windows if its >= scale and most_plots(window, scene=scene) >= count)
    return next(fitting, None)
