"""Films a run: frame after frame is drawn and encoded, at a pace of simulated seconds a second.

ffmpeg, which imageio-ffmpeg brings, encodes MP4 (H.264), WebM (VP9) or GIF.
"""

import subprocess
import tempfile
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from imageio_ffmpeg import get_ffmpeg_exe

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import RecordNotWritten, counted, one_line
from handover.cosim.files import give_name, scratch_folder
from handover.scenarios.pages.film import LARGEST
from handover.scenarios.pages.film.browser import open_camera, window_of
from handover.scenarios.pages.film.film_page import FilmContent, NotFilmed, film_html, most_plots
from handover.scenarios.runs.results.run_folder import disk_errors_reported, make_folder_of, unfinished_place

_CODECS: Mapping[str, Sequence[str]] = {
    ".mp4": ("-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"),
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "28", "-b:v", "0", "-row-mt", "1", "-cpu-used", "4",
              "-pix_fmt", "yuv420p", "-f", "webm"),
    ".gif": ("-c:v", "ffv1", "-pix_fmt", "bgr0", "-f", "matroska"),
}  # fmt: skip
"""Suffixes of films, and ffmpeg's options for them; a GIF is made of a lossless film, once its colours are known."""
_AS_ON_SCREENS = (
    "-vf", "scale=out_color_matrix=bt709:out_range=tv",
    "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv",
)  # fmt: skip


Film = Callable[[bytes], object]
"""A film in the making: takes a frame, a PNG; raises BrokenPipeError where `_film_to` then says why."""


@contextmanager
def _film_to(path: Path, fps: float, *, replace: bool) -> Generator[Film, None, None]:
    """Give what takes the frames of a film; it has its name when it is complete, and else it is not there.

    Args:
        path: one that ends with one of the `_CODECS`; it has the film in the end.
        fps: frames per second.
        replace: whether a file of that name is replaced.

    Raises:
        FileTaken: there is a file of that name, which is not to be replaced.
        RecordNotWritten: it cannot be written.
    """
    suffix, unfinished = path.suffix.lower(), unfinished_place(path)
    with scratch_folder("film") as folder:
        raw = folder / "film.mkv" if suffix == ".gif" else unfinished
        try:
            look = () if suffix == ".gif" else _AS_ON_SCREENS
            frames = ("-f", "image2pipe", "-c:v", "png", "-framerate", f"{fps:.6g}", "-i", "-")
            with _running(path, (*frames, *look, *_CODECS[suffix], str(raw))) as film:
                yield film
            if suffix == ".gif":
                _colour(path, raw, Path(folder) / "colours.png", unfinished)
            with disk_errors_reported(path):
                give_name(unfinished, path, replace=replace)
        finally:
            unfinished.unlink(missing_ok=True)


def _colour(path: Path, raw: Path, colours: Path, to: Path) -> None:
    """Make a GIF of a film by the 256 colours that show best what moves in it."""
    with _running(path, ("-i", str(raw), "-vf", "palettegen=stats_mode=diff", "-update", "1", str(colours))):
        pass
    dithered = "paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"
    with _running(path, ("-i", str(raw), "-i", str(colours), "-lavfi", dithered, "-f", "gif", str(to))):
        pass


@contextmanager
def _running(path: Path, arguments: Sequence[str]) -> Generator[Film, None, None]:
    """Run ffmpeg until its input ends.

    Raises:
        RecordNotWritten: it failed; the message has its last line.
    """
    with tempfile.TemporaryFile() as log:
        command = (_ffmpeg(path), "-hide_banner", "-loglevel", "error", "-y", *arguments)
        with disk_errors_reported(path):
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log)
        assert process.stdin is not None
        try:
            yield process.stdin.write
            process.stdin.close()
            failed = process.wait() != 0
        except BrokenPipeError:
            failed = process.wait() != 0
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        if failed:
            log.seek(0)
            lines = log.read().decode(errors="replace").strip().splitlines() or ["ffmpeg ended"]
            raise RecordNotWritten(path, lines[-1])


def _ffmpeg(path: Path) -> str:
    try:
        return get_ffmpeg_exe()
    except RuntimeError as e:  # it has none for this machine
        raise RecordNotWritten(path, one_line(e)) from e


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
        path: see `_film_to`.
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
        _film_to(path, settings.fps, replace=replace) as film,
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
