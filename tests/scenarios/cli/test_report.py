"""`handover report`: a page of what a folder has; if something is missing, one line says so, and nothing is written."""

import errno
import json
import os
import re
import shutil
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support.campaigns import campaign_metadata, carried_out, folder_of, short_plan, table_of
from support.commands import call
from support.kept_runs import copied_run, kept_run
from support.wording import Wording

FILES = {"figures", "report.html", "run.json", "signals.parquet", "summary.json"}


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of a run's folder, without page and figures."""
    return copied_run(tmp_path / "run", "run", "ir_grasp", "--no-report")


def report(*arguments: object) -> tuple[int, str]:
    """Return status and output, without what the command says it is doing."""
    done = call("report", *arguments)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, re.sub("^(drawing|writing) .*\n", "", done.output, flags=re.MULTILINE)


def page_of(folder: Path) -> str:
    assert report(folder) == (0, f"report: {folder / 'report.html'}\n")
    return (folder / "report.html").read_text(encoding="utf-8")


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


def test_a_run_of_another_version_has_a_page_and_says_what_is_left_out(copy: Path):
    unknown = dict.fromkeys(("title", "headline", "told_parameters", "system", "versions", "units"), ...)
    change(copy / "run.json", **unknown, parameters={"colour": "red"})
    change(copy / "summary.json", units=..., wall_seconds=...)
    page = page_of(copy)
    assert "ir_grasp has no parameter &#39;colour&#39;" in page
    assert [f'id="{part}"' in page for part in ("signals", "parameters", "replay")] == [True, True, False]
    status, value = report(copy, "--figures")
    assert (status, "another version of ir_grasp" in value) == (2, True)


def test_a_run_that_was_killed_with_all_that_watched_it_has_a_page(copy: Path):
    (copy / "summary.json").unlink()
    lead = page_of(copy).partition("<main>")[0]
    assert "<b>Not ended</b>: it has no summary" in lead
    assert "ir_grasp: not ended</h1>" in lead
    assert not (copy / "summary.json").exists()


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("run.json", "{"),
        ("run.json", '{"scenario": 3}'),
        ("summary.json", '{"metrics": 3}'),
        ("signals.parquet", "PAR1"),
    ],
    ids=["syntax", "type", "summary", "signals"],
)
def test_what_is_damaged_is_reported_in_a_line(copy: Path, file: str, content: str, wording: Wording):
    (copy / file).write_text(content)
    status, printed = report(copy)
    assert (status, printed.count("\n")) == (2, 1)
    wording.check(printed)
    assert not (copy / "report.html").exists()


def test_what_cannot_be_written_is_reported(copy: Path, monkeypatch: pytest.MonkeyPatch):
    def refusing(number: int) -> Any:
        def refuse(*given: Any, **_options: Any) -> None:
            raise OSError(number, os.strerror(number), str(given[0]))

        return refuse

    text = f"Error: {copy / 'report.html'} cannot be written: "
    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", refusing(errno.ENOSPC))
        assert report(copy) == (3, f"{text}No space left on device\n")
    assert {p.name for p in copy.iterdir()} == FILES - {"report.html", "figures"}
    monkeypatch.setattr(Path, "write_text", refusing(errno.EACCES))
    monkeypatch.setattr(Path, "mkdir", refusing(errno.EACCES))
    assert report(copy) == (3, f"{text}Permission denied\n")
    status, value = report(copy, "--figures")
    assert (status, value.count("\n")) == (3, 1)
    assert "cannot be written: Permission denied" in value


@pytest.mark.usefixtures("empty_figures")
def test_of_a_campaign_page_and_figures_are_written_where_they_are_asked_for(tmp_path: Path):
    points = [{"strategy": "reflex"}, {"strategy": "blind"}]
    campaign = folder_of(tmp_path / "c", campaign_metadata("ir_grasp", points), table_of(points))
    before, page = sorted(os.listdir(campaign.path)), tmp_path / "page.html"
    assert report(campaign.path, "--out", page) == (0, f"report: {page}\n")
    assert sorted(os.listdir(campaign.path)) == before
    assert report(campaign.path, "--figures")[0] == 0
    assert {p.name for p in campaign.figures.iterdir()} == {f"success_by_point.{end}" for end in ("png", "svg", "pdf")}


def test_pages_of_a_campaigns_runs_are_written_and_linked_if_they_are_asked_for(tmp_path: Path):
    done, lost = (run.name for run in short_plan().runs())
    campaign = carried_out(short_plan(), tmp_path / "c", lost=[lost])
    assert "handover report c --runs" in page_of(campaign.path)
    assert report(campaign.path, "--runs") == (0, f"report: {campaign.report}\n")
    run = campaign.runs / done
    assert "mass" in (run / "report.html").read_text(encoding="utf-8")
    page = campaign.report.read_text(encoding="utf-8")
    assert f"<a href='runs/{quote(run.name)}/report.html'>" in page
    assert quote(lost) not in page
    status, reported = report(run, "--runs")
    assert (status, "--runs is for that of a campaign" in reported) == (2, True)
