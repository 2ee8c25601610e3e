"""The page and the tables of a study, of people and of scripted pilots, complete, broken off, and too small."""

import re
import shutil
from html import unescape
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from support.kept_runs import copied_run
from support.scenarios.sample_study import (
    PILOT_PLAN,
    PLAN,
    compliant_fails,
    never,
    read_by_codebook,
    record,
    rigid_is_better,
    session,
    write_study,
)
from support.wording import Wording

from handover.scenarios.cli.command import main
from handover.scenarios.study.folder.codebook import PILOT
from handover.scenarios.study.folder.session_notes import VoidAttempt
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.report.result_tables import write_results
from handover.scenarios.study.statistics.analysis import StudyAnalysis

csv_of: Any = pd.read_csv  # type: ignore


def study(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["study", *map(str, arguments)])


def report_of(folder: Path) -> str:
    done = study("report", folder)
    assert done.exit_code == 0, done.output
    return (folder / "report.html").read_text(encoding="utf-8")


def text_of(page: str) -> str:
    """Return what a reader sees of a page, in one line."""
    shown = re.sub(r"<(script|style)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", shown)))


@pytest.fixture(scope="module")
def reported(twelve: StudyFolder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the study of twelve people with its page, tables and results."""
    folder = shutil.copytree(twelve.path, tmp_path_factory.mktemp("study") / "reported")
    report_of(folder)
    assert study("export", folder).exit_code == 0
    return folder


@pytest.mark.slow
def test_the_page_has_all_results_with_their_origin(reported: Path):
    page = (reported / "report.html").read_text(encoding="utf-8")
    text = text_of(page)
    for part in (
        "12 participants : 18 are planned; 144 of 144 rounds that were played count.",
        "The orders of 12 complete sessions are balanced: each of the square's 6 rows was played twice.",
        "Human to robot compliant 12 24 50 % (29 to 71 %) 12",
        "Human to robot compliant 2 of 20, 10 % 12 of 24, 50 %",
        "Human to robot 12 -50 % 0.00049 0.0015 0.031",
        "S1 Collaborative task 12 6.50 4.50 +2.00 (+2.00 to +2.00) 0.00049 0.0044",
        "S1 Human to robot 0.0132 0.00049",
        "corrected over the 9 tests that were made, of 9",
        "[Pratt1959]",
    ):
        assert part in text
    assert page.count('class="plot"') == 4
    assert "default-src 'none'" in unescape(page)
    assert not re.search(r'(?:src|href)="https?:', re.sub(r"<script\b.*?</script>", "", page, flags=re.DOTALL))
    assert PILOT not in text.lower()


def test_scripted_pilots_are_reported_in_every_section_and_file(tmp_path: Path):
    write_study(tmp_path / "out", 2, rigid_is_better, compliant_fails, PILOT_PLAN)
    page = report_of(tmp_path / "out")
    assert "<title>Object handover between people and a free-flying robot (scripted pilot)</title>" in page
    sections = re.findall(r"<section id=.*?</section>", page, flags=re.DOTALL)
    assert len(sections) == 10
    assert all("Scripted pilot: no person took part." in s for s in sections)
    assert "task behaviour published scripted pilot" in text_of(page)
    assert " ours " not in text_of(page)
    tables = [f for f in (tmp_path / "out").rglob("*.csv") if f.name != "codebook.csv"]
    assert len(tables) == 5 + 6 + 4 * 2
    for file in tables:
        assert set(csv_of(file)["kind"]) <= {PILOT}, file  # no attempt was void
    for file in (tmp_path / "out").rglob("codebook.md"):
        assert "no person took part" in file.read_text(encoding="utf-8")


@pytest.mark.slow
def test_pandas_reads_all_tables_by_their_codebooks(reported: Path):
    """Those of a session: test_session_folder.py."""
    sessions = read_by_codebook(reported, "sessions", reported / "sessions.csv")
    assert (len(sessions), sessions["failures"].sum()) == (12, 12)
    answers = read_by_codebook(reported, "answers", reported / "answers.csv")
    means = answers[answers["statement"] == "S1"].groupby("behaviour")["value"].mean()
    assert means["rigid"] - means["compliant"] == pytest.approx(2.0)
    assert pq.read_table(reported / "answers.parquet").num_rows == len(answers) == 432
    for name in ("failures", "failure_tests", "rating_means", "rating_tests", "order_effects", "mixed_model"):
        assert len(read_by_codebook(reported / "results", name, reported / "results" / f"{name}.csv")) > 2
    tests = csv_of(reported / "results" / "rating_tests.csv").set_index(["statement", "task"])
    assert tests.loc[("S1", "collaborative"), "estimate"] == pytest.approx(2.0)
    assert tests.loc[("S1", "collaborative"), "p"] == pytest.approx(2 / 2**12)


@pytest.mark.parametrize("people", [0, 3])
def test_too_few_are_reported_and_nothing_is_computed(people: int, tmp_path: Path):
    write_study(tmp_path / "out", people, rigid_is_better, compliant_fails)
    text = text_of(report_of(tmp_path / "out"))
    tests = csv_of(tmp_path / "out" / "results" / "rating_tests.csv")
    assert tests[["p", "p_holm", "estimate", "low", "high"]].isna().all(axis=None)
    assert list(tests["participants"]) == [people] * 9
    assert "no exact test of signs can reject at 5 %, so that none is made" in text
    assert "no model, as fewer than 6 participants" in text
    assert "corrected over the 0 tests that were made, of 9" in text
    assert ("Fewer than 6 are too few for a test" in text) == (people == 3)


@pytest.mark.slow
def test_a_session_broken_off_and_void_rounds_are_reported(tmp_path: Path):
    study_folder = write_study(tmp_path / "out", 6, rigid_is_better)
    folder = study_folder.begin(session(7))
    for planned in folder.rounds[:5]:
        folder.record_round(planned.number, record(void=planned.number == 2, latency=140.0))
        if planned.number != 2:
            folder.record_answers(planned.number, dict.fromkeys(PLAN.statements, 5))
    crashed = "the simulation's process ended (killed by signal 6)"
    folder.record_void_attempt(VoidAttempt(3, 1, "2026-11-24T09:30:00", crashed, "03_unfinished_1"))
    text = text_of(report_of(tmp_path / "out"))
    for part in (
        "Attempts that were broken off, and whose rounds were played again: 1",
        crashed,
        "Not complete: P07.",
        "incomplete: 5 of 12 rounds",
        "tracking lost, hand out of view",
        "4 of 76 rounds that count are above 100 ms",
        "76 of 77 rounds that were played count",
        "Nobody has withdrawn.",
        "complete sessions, without void rounds and the first 6",
        "P07: the session is not complete; it enters ",
    ):
        assert part in text


@pytest.mark.slow
def test_who_withdrew_is_reported_with_the_time_and_nothing_else_and_what_was_kept_is_deleted_if_asked(tmp_path: Path):
    out = tmp_path / "out"
    write_study(out, 7, rigid_is_better)
    assert study("export", out).exit_code == 0
    report_of(out)
    done = study("withdraw", out, "P03")
    assert done.exit_code == 0, done.output
    assert "P03 withdrew on 20" in done.output
    assert "not deleted" in done.output
    text = text_of((out / "report.html").read_text(encoding="utf-8"))
    when = StudyFolder.read(out).withdrawals[3].ended
    assert "6 participants : 18 are planned; 72 of 72 rounds that were played count. 1 participant withdrew" in text
    assert f"P03 {when} after it kept, and in no result" in text
    assert text.count("P03") == 1
    for file in [*out.glob("*.csv"), *(out / "results").glob("*.csv")]:
        assert "P03" not in file.read_text(encoding="utf-8")
    assert "P03" not in set(pq.read_table(out / "rounds.parquet").column("participant").to_pylist())
    refused = study("replay", out, "P03", "1")
    assert refused.exit_code == 2
    assert "nothing of theirs is shown" in refused.output
    done = study("withdraw", out, "3", "--delete")
    assert f"P03 withdrew on {when}: in no table and no test; what was kept is deleted on" in done.output
    assert [f.name for f in (out / "participants" / "P03").iterdir()] == ["withdrawn.json"]
    assert StudyFolder.read(out).next_number == 8
    assert study("withdraw", out, "P09").exit_code == 2


def test_a_plan_of_other_tasks_has_a_page_without_the_thesis(tmp_path: Path):
    text = default_plan().replace("repetitions = 2", "repetitions = 1").replace('title = "', 'title = "<b>bold</b> & ')
    for scenario in ("flyer_robot_to_human", "flyer_human_to_robot", "flyer_collaborative"):
        text = text.replace(f'scenario = "{scenario}"', 'scenario = "ir_grasp"')
    for behaviour, strategy in (("rigid", "blind"), ("compliant", "reflex")):
        text = text.replace(f'behaviour = "{behaviour}"', f'strategy = "{strategy}"')
    write_study(tmp_path / "out", 6, lambda n, r, s: 5 if s == "S1" else 1 + (n + r.number) % 9, plan=parse_plan(text))
    page = report_of(tmp_path / "out")
    assert "<h1>&lt;b&gt;bold&lt;/b&gt; &amp; Object" in page
    assert 'id="published"' not in page
    assert "S1: no model, as all ratings are the same." in text_of(page)
    effects = csv_of(tmp_path / "out" / "results" / "order_effects.csv")
    assert set(effects["effect"]) == {"round", "carry-over"}
    assert set(effects["participants"]) == {0}  # each condition comes once: within it nothing goes with the order


def test_what_is_no_study_is_reported(tmp_path: Path):
    for command in ("report", "export"):
        assert "is not a folder" in study(command, tmp_path / "none").output
        refused = study(command, tmp_path)
        assert refused.exit_code == 2
        assert "it is not the folder of a study" in refused.output
    assert not list(tmp_path.iterdir())


def test_results_are_not_written_through_a_link(tmp_path: Path):
    out, mine = tmp_path / "out", tmp_path / "mine"
    study_folder = StudyFolder.opened(out, PLAN)
    mine.mkdir()
    (out / "results").symlink_to(mine)
    write_results(StudyAnalysis(study_folder), out / "results")
    assert not list(mine.iterdir())
    assert (out / "results" / "failures.csv").is_file()


def test_a_round_is_shown_with_its_page(tmp_path: Path):
    folder = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1))
    planned = folder.rounds[0].condition
    folder.run_folder(1).parent.mkdir(exist_ok=True)
    copied_run(folder.run_folder(1), "run", planned.scenario, "--no-report")
    folder.record_round(1, record())
    folder.record_answers(1, {"S1": 9, "S2": 8, "S3": 7})
    shown = study("replay", tmp_path / "out", "p01", "1")
    assert shown.exit_code == 0, shown.output
    assert f"P01 (person), round 1: {planned.task}, {planned.behaviour}, period 1" in shown.output
    assert "ratings: S1 = 9, S2 = 8, S3 = 7" in shown.output
    assert "latency: median 40 ms, 95 % 60 ms" in shown.output
    page = folder.run_folder(1) / "report.html"
    assert f"page: {page}" in shown.output
    assert planned.scenario in page.read_text(encoding="utf-8")


def test_a_round_that_cannot_be_shown_is_refused(tmp_path: Path, wording: Wording):
    write_study(tmp_path / "out", 1, rigid_is_better, never)
    for who, number in (("P09", "1"), ("1", "13"), ("1", "3")):  # the third has no record
        shown = study("replay", tmp_path / "out", who, number)
        assert shown.exit_code == 2
        wording.check(shown.output)
