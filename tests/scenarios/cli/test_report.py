"""`handover report`: a page of what a folder has; if something is missing, one line says so, and nothing is written."""

import errno
import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.kept_runs import copied_run, kept_run
from support.wording import Wording

from handover.scenarios.cli.command import main

FILES = {"figures", "report.html", "run.json", "signals.parquet", "summary.json"}


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of a run's folder, without page and figures."""
    return copied_run(tmp_path / "run", "run", "ir_grasp", "--no-report")


def report(*arguments: object) -> tuple[int, str]:
    """Return status and output, without what the command says it is doing."""
    done = CliRunner().invoke(main, ["report", *map(str, arguments)])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, "".join(
        t for t in done.output.splitlines(keepends=True) if not t.startswith(("drawing ", "writing "))
    )


def change(file: Path, **changes: Any) -> None:
    value = json.loads(file.read_text())
    file.write_text(json.dumps({k: v for k, v in {**value, **changes}.items() if v is not ...}))


@pytest.mark.slow
def test_page_and_figures_are_those_that_the_run_wrote(tmp_path: Path):
    grasp, copy = kept_run("run", "ir_grasp"), copied_run(tmp_path / "run", "run", "ir_grasp")
    shutil.rmtree(copy / "figures")
    (copy / "report.html").unlink()
    assert report(copy, "--figures") == (0, f"report: {copy / 'report.html'}\n")
    assert {p.name for p in copy.iterdir()} == FILES
    assert (copy / "report.html").read_bytes() == (grasp / "report.html").read_bytes()
    for figure in (grasp / "figures").iterdir():
        assert (copy / "figures" / figure.name).read_bytes() == figure.read_bytes()


def test_the_page_goes_where_it_is_asked_for(copy: Path, tmp_path: Path):
    assert report(copy, "--out", tmp_path / "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text()
    assert "ir_grasp: succeeded" in page
    linked = re.findall('<a href="([^#"]*)"><code>', page)
    assert "run.json" in {Path(link).name for link in linked}
    assert all((tmp_path / link).exists() for link in linked), linked
    assert "<code>handover run --config run.json</code>" in page
    assert not (copy / "report.html").exists()
    assert report(copy, "--out", tmp_path) == (2, f"Error: {tmp_path} is a folder; name a file for the page\n")


def test_a_run_of_which_an_older_version_said_less_has_a_page(copy: Path):
    unknown = dict.fromkeys(("title", "headline", "told_parameters", "system", "versions", "units"), ...)
    change(copy / "run.json", **unknown)
    change(copy / "summary.json", units=..., wall_seconds=...)
    assert report(copy)[0] == 0
    page = (copy / "report.html").read_text()
    assert 'id="signals"' in page
    assert 'id="parameters"' in page


def test_a_run_of_another_version_of_its_scenario_says_what_is_left_out(copy: Path):
    change(copy / "run.json", parameters={"colour": "red"})
    assert report(copy)[0] == 0
    page = (copy / "report.html").read_text()
    assert "ir_grasp has no parameter &#39;colour&#39;" in page
    assert 'id="replay"' not in page
    status, value = report(copy, "--figures")
    assert status == 2
    assert "another version of ir_grasp" in value


def test_a_run_that_was_killed_with_all_that_watched_it_has_a_page(copy: Path):
    (copy / "summary.json").unlink()
    assert report(copy)[0] == 0
    lead = (copy / "report.html").read_text().partition("<main>")[0]
    assert "<b>Not ended</b>: it has no summary" in lead
    assert "ir_grasp: not ended</h1>" in lead
    assert not (copy / "summary.json").exists()


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("run.json", None),
        ("run.json", "{"),
        ("run.json", '{"scenario": 3}'),
        ("summary.json", '{"metrics": 3}'),
        ("signals.parquet", "PAR1"),
    ],
    ids=["missing", "syntax", "type", "summary", "signals"],
)
def test_what_is_damaged_is_reported_in_a_line(copy: Path, file: str, content: str | None, wording: Wording):
    if content is None:
        (copy / file).unlink()
    else:
        (copy / file).write_text(content)
    status, printed = report(copy)
    assert (status, printed.count("\n")) == (2, 1)
    wording.check(printed)
    assert not (copy / "report.html").exists()


def test_no_folder_and_a_full_disk(copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    status, value = report(tmp_path / "nothing")
    assert (status, value) == (2, f"Error: {tmp_path / 'nothing'} is no folder; name that of a run or of a campaign\n")

    def refuse(source: Any, target: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source), str(target))

    monkeypatch.setattr(os, "replace", refuse)
    assert report(copy) == (3, f"Error: {copy / 'report.html'} cannot be written: No space left on device\n")
    assert {p.name for p in copy.iterdir()} == FILES - {"report.html", "figures"}


def test_a_folder_that_may_not_be_written_to(copy: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(file: Path, *_arguments: Any, **_options: Any) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(file))

    monkeypatch.setattr(Path, "write_text", refuse)
    monkeypatch.setattr(Path, "mkdir", refuse)
    assert report(copy) == (3, f"Error: {copy / 'report.html'} cannot be written: Permission denied\n")
    status, value = report(copy, "--figures")
    assert (status, value.count("\n")) == (3, 1)
    assert "cannot be written: Permission denied" in value


@pytest.mark.slow
def test_a_run_of_an_ssp_has_a_page_and_figures(tmp_path: Path):
    for call in (
        ["export", "ir_grasp", "--ssp", str(tmp_path / "x.ssp")],
        ["run", str(tmp_path / "x.ssp"), "--stop", "0.3", "--no-report", "--out", str(tmp_path / "run")],
    ):
        done = CliRunner().invoke(main, call)
        assert done.exit_code == 0, done.output
    assert {p.name for p in (tmp_path / "run").iterdir()} == FILES - {"report.html", "figures"}
    assert report(tmp_path / "run", "--figures") == (0, f"report: {tmp_path / 'run' / 'report.html'}\n")
    assert {p.suffix for p in (tmp_path / "run" / "figures").iterdir()} == {".png", ".svg"}
