"""Films a run: frame after frame is drawn and encoded, at a pace of simulated seconds a second."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.film.browser import open_camera, window_of
from handover.scenarios.film.encoder import film_to
from handover.scenarios.film.film_page import FilmContent, film_html


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
    """Return the simulated times of a film's frames, s: evenly spaced from the record's begin, and its end."""
    steps = (end - begin) * settings.fps / settings.pace
    whole = int(steps * (1.0 + 1e-9))
    times: Floats = begin + np.arange(whole + 1, dtype=np.float64) * (settings.pace / settings.fps)
    return times if steps - whole < 1e-6 * max(steps, 1.0) else np.append(times, end)


def write_film(content: FilmContent, path: Path, settings: FilmSettings, report: Callable[[int, int], None]) -> int:
    """Write a film; return how many frames it has. A file of its name is replaced when the film is complete.

    Args:
        content: what it shows.
        path: see `film_to`.
        settings: how it is filmed.
        report: is called with how many frames are done, and of how many.

    Raises:
        NotFilmed: what it shows does not fit.
        NoBrowser, BrowserFailed: it cannot be drawn.
        RecordNotWritten: it cannot be written.
    """
    times = frame_times(*content.span, settings)
    html = film_html(content, window_of(settings.size)[0], settings.view)
    with open_camera(html, settings.size, dark=settings.dark) as camera, film_to(path, settings.fps) as film:
        for k, t in enumerate(times.tolist()):
            report(k, len(times))
            film(camera(min(t, content.span[1])))
    return len(times)
