"""Encodes frames as a film by ffmpeg, which imageio-ffmpeg brings: MP4 (H.264), WebM (VP9) or GIF."""

import subprocess
import tempfile
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from imageio_ffmpeg import get_ffmpeg_exe

from handover.cosim.exceptions import RecordNotWritten, one_line
from handover.cosim.files import give_name, scratch_folder
from handover.scenarios.runs.results.run_folder import disk_errors_reported, unfinished_place

CODECS: Mapping[str, Sequence[str]] = {
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
"""A film in the making: takes a frame, a PNG; raises BrokenPipeError where `film_to` then says why."""


@contextmanager
def film_to(path: Path, fps: float, *, replace: bool) -> Generator[Film, None, None]:
    """Give what takes the frames of a film; it has its name when it is complete, and else it is not there.

    Args:
        path: one that ends with one of the `CODECS`; it has the film in the end.
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
            with _running(path, (*frames, *look, *CODECS[suffix], str(raw))) as film:
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
