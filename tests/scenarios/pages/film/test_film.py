"""`handover film`: its frames show the run at their times, as asked for; what cannot be filmed is refused."""

import contextlib
import math
import os
import shutil
import signal
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from PIL import Image
from support.commands import Command
from support.kept_runs import copied_run
from support.processes import family, until
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.cli.command import main
from handover.scenarios.pages.film.browser import open_camera, window_of
from handover.scenarios.pages.film.film import FilmSettings, frame_times
from handover.scenarios.pages.film.film_page import NotFilmed, film_content, film_html
from handover.scenarios.runs.results.run_folder import RunFolder

Pixels = NDArray[np.uint8]
WIDE, HIGH = 640, 360


@pytest.fixture(scope="module", autouse=True)
def chromium() -> None:
    """Skip where there is no chromium; a film's browser is its own, as no other may be open in the tests' thread."""
    if shutil.which("chromium") is None:
        assert "CI" not in os.environ, "there is no chromium to draw films with"
        pytest.skip("there is no chromium to draw films with")


def film(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(main, ["film", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


def frames(file: Path) -> list[Pixels]:
    """Return a film's frames in shades of grey."""
    video = cv2.VideoCapture(str(file))
    found: list[Pixels] = []
    while True:
        there, frame = video.read()
        if not there:
            return found
        found.append(np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), np.uint8))


def cursor(picture: Pixels) -> float:
    """Return where the cursor stands, px from the left: the darkest of the columns right of the scene."""
    rows, left = slice(int(0.3 * HIGH), int(0.6 * HIGH)), int(0.66 * WIDE)
    return left + float(np.argmin(picture[rows, left:].astype(float).mean(axis=0)))


@pytest.mark.slow
def test_a_films_scene_and_cursor_move_with_the_times_of_its_frames(
    grasp: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
):
    temporary = tmp_path_factory.mktemp("temporary")
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    out, plot = tmp_path / "grasp.mp4", "cost of thumb and ring, [Luberto] eq. (4)"
    status, reported = film(grasp, "--out", out, "--size", f"{WIDE}x{HIGH}", "--pace", 10, "--fps", 4, "--plot", plot)
    assert status == 0, reported
    assert f"\nfilm: {out}, " in reported
    assert [p.name for p in tmp_path.iterdir()] == ["grasp.mp4"]
    assert list(temporary.iterdir()) == []
    time, shown = Record(grasp / "signals.parquet").time, frames(out)
    assert len(shown) == int((time[-1] - time[0]) / 10 * 4) + 2  # the first, each 2.5 s after it, and the last
    assert {p.shape for p in shown} == {(HIGH, WIDE)}
    assert cv2.VideoCapture(str(out)).get(cv2.CAP_PROP_FPS) == pytest.approx(4.0)
    scene = [p[60:300, 20:350].astype(float) for p in shown]
    assert np.abs(scene[len(scene) // 2] - scene[0]).max() > 60.0
    assert np.abs(scene[-1] - scene[0]).max() > 60.0
    places = np.array([cursor(p) for p in shown[1:-1]])
    order = np.arange(len(places))
    per_frame, first = np.polyfit(order, places, 1)
    np.testing.assert_allclose(places, first + per_frame * order, atol=2.0)
    assert per_frame * len(shown) > 0.2 * WIDE


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".gif", ".webm"])
def test_a_gif_and_a_webm_have_the_same_frames(grasp: Path, tmp_path: Path, suffix: str):
    out = tmp_path / f"film{suffix}"
    status, reported = film(
        grasp, "--out", out, "--size", "320x240", "--no-plots", "--pace", 10, "--fps", 4, "--view", "top"
    )
    assert status == 0, reported
    expected = len(
        frame_times(0.0, float(Record(grasp / "signals.parquet").time[-1]), FilmSettings(pace=10.0, fps=4.0))
    )
    if suffix == ".webm":
        assert [p.shape for p in frames(out)] == expected * [(240, 320)]
        return
    gif = Image.open(out)
    shown: list[Pixels] = []
    for k in range(expected):
        gif.seek(k)
        assert gif.info["duration"] == 250
        shown.append(np.asarray(gif.convert("L"), np.uint8))
    with pytest.raises(EOFError):
        gif.seek(expected)
    assert {p.shape for p in shown} == {(240, 320)}
    assert np.abs(shown[-1].astype(float) - shown[0]).max() > 60.0


@pytest.mark.slow
def test_a_frame_looks_the_same_whatever_was_shown_before(grasp: Path):
    content = film_content(RunFolder.of_run(grasp), (), 720)
    with open_camera(film_html(content, (1280, 720), "follow"), (1920, 1080), dark=True) as camera:
        first, other, again = (camera(t) for t in (3.0, 8.0, 3.0))
    assert first == again != other
    picture = np.asarray(cv2.imdecode(np.frombuffer(first, np.uint8), cv2.IMREAD_GRAYSCALE))
    assert picture.shape == (1080, 1920)
    assert picture.mean() < 80.0  # it is dark


def test_the_frames_times_are_even_and_end_with_the_run():
    settings = FilmSettings(pace=2.0, fps=10.0)
    np.testing.assert_allclose(frame_times(1.0, 2.0, settings), [1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    np.testing.assert_allclose(frame_times(1.0, 1.7, settings), [1.0, 1.2, 1.4, 1.6, 1.7])
    np.testing.assert_allclose(frame_times(0.0, 0.3, FilmSettings(pace=1.0, fps=10.0)), [0.0, 0.1, 0.2, 0.3])
    for end, pace in ((1e300, 1.0), (1.0, 1e-300), (math.inf, 1.0), (-0.1, 1.0)):
        with pytest.raises(NotFilmed):
            frame_times(0.0, end, FilmSettings(pace=pace))


@pytest.mark.parametrize("end", [6990.0, 7e3, 6.67e4, 1e5, 3.33e11])
def test_the_pace_that_is_named_for_a_film_of_too_many_frames_is_enough(end: float):
    with pytest.raises(NotFilmed) as refused:
        frame_times(0.0, end, FilmSettings())
    pace = str(refused.value).partition("--pace ")[2].partition(",")[0]
    frame_times(0.0, end, FilmSettings(pace=float(pace)))


def test_a_large_film_is_a_page_enlarged():
    assert window_of((1280, 720)) == ((1280, 720), 1.0)
    assert window_of((1920, 1080)) == ((1280, 720), 1.5)
    assert window_of((640, 360)) == ((640, 360), 1.0)
    assert window_of((1922, 1082)) == ((1922, 1082), 1.0)


@pytest.mark.slow
def test_a_run_without_a_scene_is_filmed_by_its_plots(tmp_path: Path):
    run = copied_run(tmp_path / "run", "run", str(cached("Push", 3)), "--stop", "0.2", "--no-report")
    status, reported = film(run, "--size", "480x320", "--fps", 10)
    assert status == 0, reported
    assert "has no scene: the film has plots only" in reported
    assert len(frames(run / "film.mp4")) == 4  # it ends a step after 0.2 s
    assert film(run, "--force", "--no-plots")[0] == 2


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(("--plot", "scene.p_WZ"), id="an unknown signal"),
        pytest.param(("--plot", "cost", "--plot", "scene.q[99]"), id="an element too many"),
        pytest.param(("--plot", "scene.q", "--no-plots"), id="plots and none"),
        pytest.param(("--size", "320x240", *(f"--plot=scene.q[{k}]" for k in (1, 2, 3))), id="room for one plot"),
        pytest.param(("--size", "240x240", "--plot=scene.q[1]"), id="room for no plot"),
        pytest.param(
            ("--size", "3840x2160", *(f"--plot=scene.{q}[{k}]" for q in ("q", "q_meas") for k in range(1, 9))),
            id="room for sixteen plots nowhere",
        ),
        pytest.param(("--size", "641x360"), id="an odd size"),
        pytest.param(("--size", "wide"), id="no size"),
        pytest.param(("--out", "x.avi"), id="another kind of film"),
        pytest.param(("--out", "x.gif", "--fps", "60"), id="a fast gif"),
        pytest.param(("--out", "folder.mp4"), id="a folder"),
        pytest.param(("--out", "there.mp4"), id="a film that is there"),
        pytest.param(("--out", "there.mp4/x.mp4"), id="within a film"),
        pytest.param(("--pace", "0"), id="no pace"),
    ],
)
def test_what_cannot_be_filmed_so_is_refused(
    grasp: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: Sequence[str], wording: Wording
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "there.mp4").touch()
    out = () if "--out" in arguments else ("--out", "x.mp4")
    status, output = film(grasp, *out, *arguments)
    assert status == 2
    wording.check(output)
    assert {p.name for p in tmp_path.iterdir()} == {"folder.mp4", "there.mp4"}


def test_a_scene_of_which_nothing_has_a_place_is_left_out(tmp_path: Path):
    folder = copied_run(tmp_path / "r", "run", "ir_grasp", "--no-report", "--stop", "0.5")
    table = pq.read_table(folder / "signals.parquet")
    pq.write_table(
        table.select([c for c in table.column_names if not c.startswith("scene.")]), folder / "signals.parquet"
    )
    content = film_content(RunFolder.of_run(folder), (), 720)
    assert content.scene is None
    assert content.plots
    assert any("scene" in line for line in content.notes)


def test_what_is_no_run_is_refused(tmp_path: Path, wording: Wording):
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "campaign.json").write_text("{}")
    for folder in ("none", "", "sweep"):
        status, output = film(tmp_path / folder)
        assert status == 2
        wording.check(output)


def test_without_a_browser_the_way_to_one_is_reported(grasp: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "none"))
    monkeypatch.setattr("handover.scenarios.pages.film.browser._NAMES", ("no-such-browser",))
    status, reported = film(grasp, "--out", tmp_path / "x.mp4")
    assert status == 2
    assert "there is no Chromium to draw the film. Cure: `python -m playwright install" in reported
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_film_that_cannot_be_written_leaves_nothing(grasp: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", shutil.which("false") or "")
    status, reported = film(grasp, "--out", tmp_path / "x.mp4", "--pace", 10, "--size", "320x240", "--no-plots")
    assert status == 3
    assert f"{tmp_path / 'x.mp4'} cannot be written: " in reported
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_ctrl_c_ends_a_film_and_leaves_nothing(grasp: Path, tmp_path: Path):
    going = Command("film", grasp, "--out", tmp_path / "x.mp4", "--pace", "0.1", "--size", "320x240")
    until(lambda: any(tmp_path.iterdir()), 120.0)
    for number in (going.pid, *family(going.pid)):  # as a terminal's Ctrl-C
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGINT)
    ended = going.wait()
    assert ended.status == 130
    assert ended.errors.splitlines()[-1] == "Aborted!"
    assert list(tmp_path.iterdir()) == []
