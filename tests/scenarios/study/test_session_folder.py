"""What a session keeps: tables that pandas reads by the codebook, rounds that outlive a kill, and refusals."""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.kept_runs import kept_run
from support.processes import with_path
from support.scenarios.sample_study import PLAN, read_by_codebook, record, same, session, write_study
from support.wording import Wording

from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.study.folder.codebook import questionnaire_columns, write_csv
from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.plan.order import rounds_of
from handover.scenarios.study.plan.plan import default_plan, parse_plan
from handover.scenarios.study.session.trial import failed_by_rule

csv_of: Any = pd.read_csv  # type: ignore
"""Returns frames, whose types are open."""


def test_pandas_reads_every_table_by_the_codebook(tmp_path: Path):
    study = write_study(tmp_path / "out", 2, lambda n, r, s: 1 + (n + r.number + int(s[1])) % 9, lambda n, _: n == 2)
    folder = study.session(2)
    rounds = read_by_codebook(study.path, "rounds", folder.path / "rounds.csv")
    assert list(rounds["round"]) == list(range(1, 13))
    assert not rounds["success"].any()
    assert rounds["failed_by_rule"].all()
    assert list(rounds["seed"]) == [r.seed for r in rounds_of(PLAN, 2)]
    assert set(rounds["participant"]) == {"P02"}
    assert not rounds["marked_over_limit"].any()
    answers = read_by_codebook(study.path, "answers", folder.path / "answers.csv")
    assert len(answers) == 36
    assert answers.set_index(["round", "statement"]).loc[(5, "S3"), "value"] == 1 + (2 + 5 + 3) % 9
    asked = read_by_codebook(study.path, "questionnaire", folder.path / "questionnaire.csv")
    assert asked["comments"][0] == 'a "quoted", text\n2'
    assert asked["age_group"][0] == "21-30"


@pytest.mark.parametrize("typed", ["=HYPERLINK(1)", "+1", "- nothing", " @you", "'so'", "fine = good"])
def test_what_a_person_typed_is_no_formula_of_a_spreadsheet(tmp_path: Path, typed: str):
    columns = questionnaire_columns(PLAN)
    assert [c.name for c in columns if c.free] == [q.name for q in PLAN.questions if not q.choices]
    assert any("apostrophe" in c.meaning for c in columns)
    write_csv(tmp_path / "asked.csv", columns, [{"comments": typed, "age_group": "-20"}])
    written = csv_of(tmp_path / "asked.csv", dtype=str)
    assert written["comments"][0] == (f"'{typed}" if typed[0] in "=+- " else typed)
    assert written["age_group"][0] == "-20"


def test_codebook_and_parquet_tell_every_column_with_its_unit(tmp_path: Path):
    study = write_study(tmp_path / "out", 1, same)
    codebook = csv_of(study.path / "codebook.csv", keep_default_na=False).set_index(["table", "column"])
    assert codebook.loc[("rounds", "latency_p95_ms"), "unit"] == "ms"
    assert PLAN.texts["en"].statements["S2"] in codebook.loc[("answers", "statement"), "meaning"]
    assert (codebook["meaning"].str.len() > 10).all()
    assert set(codebook[codebook["type"].isin(["whole number", "number"])]["unit"]) == {"1", "ms"}
    in_words = (study.path / "codebook.md").read_text(encoding="utf-8")
    assert all(f"| `{column}` |" in in_words for _, column in codebook.index)
    folder = study.session(1).path
    table, rounds = pq.read_table(folder / "rounds.parquet"), csv_of(folder / "rounds.csv")
    assert table.num_rows == 12
    for name in ("round", "seed", "latency_p95_ms", "success", "task"):
        assert table.column(name).to_pylist() == rounds[name].to_list()
    assert (table.schema.field("latency_max_ms").metadata or {})[b"unit"] == b"ms"


def test_a_round_over_the_limit_is_marked_and_one_that_was_not_measured_is_neither(tmp_path: Path):
    folder = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1))
    folder.record_round(1, record(latency=100.0))
    folder.record_round(2, record(latency=100.1))
    folder.record_round(3, replace(record(), latency_p95_ms=float("nan"), missed_deadlines=None))
    rounds = read_by_codebook(tmp_path / "out", "rounds", folder.path / "rounds.csv")
    assert [bool(x) for x in rounds["marked_over_limit"][:2]] == [False, True]
    assert rounds["marked_over_limit"].isna()[2]
    assert rounds["missed_deadlines"].isna()[2]


def test_rounds_come_in_turn_and_want_ratings_unless_void(tmp_path: Path, wording: Wording):
    folder = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(3))
    assert folder.next_round == rounds_of(PLAN, 3)[0]

    def refused(act: Callable[[], object]) -> None:
        with pytest.raises(ValueError) as e:  # noqa: PT011
            act()
        wording.check(e.value)

    refused(lambda: folder.record_round(2, record()))
    folder.record_round(1, record(void=True))
    assert folder.unrated_round is None
    folder.record_round(2, record())
    assert folder.unrated_round == rounds_of(PLAN, 3)[1]
    refused(lambda: folder.record_answers(2, {"S1": 10, "S3": 1, "S4": 2}))
    folder.record_answers(2, {"S1": 9, "S2": 1, "S3": 5})
    assert folder.unrated_round is None
    assert folder.answers == {2: {"S1": 9, "S2": 1, "S3": 5}}
    refused(lambda: folder.record_questionnaire({"age_group": "200"}))
    assert not folder.is_complete


_PLAYS = """
import sys
from pathlib import Path
from support.scenarios.sample_study import PLAN, record, session
from handover.scenarios.study.folder.study_folder import StudyFolder
folder = StudyFolder.opened(Path(sys.argv[1]), PLAN).begin(session(1))
for planned in folder.rounds:
    folder.record_round(planned.number, record())
    folder.record_answers(planned.number, dict.fromkeys(PLAN.statements, 5))
    print(planned.number, flush=True)
"""


def test_a_kill_in_the_middle_keeps_the_rounds_before_and_the_study_goes_on(tmp_path: Path):
    command = [sys.executable, "-c", _PLAYS, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=with_path()) as process:
        assert process.stdout is not None
        reported = 0
        while reported < 4:
            reported = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    folder = StudyFolder.opened(tmp_path / "out", PLAN).session(1)
    finished = sorted(folder.records)
    assert finished == list(range(1, len(finished) + 1))
    assert 4 <= len(finished) <= 12
    folder.write_tables()
    rounds = read_by_codebook(tmp_path / "out", "rounds", folder.path / "rounds.csv")
    assert list(rounds["round"]) == finished
    assert (folder.next_round is None) == (len(finished) == 12)


def test_a_run_that_was_killed_is_put_aside_and_one_that_ended_is_not(tmp_path: Path):
    folder = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1))
    for _ in range(2):
        folder.run_folder(1).mkdir()
        assert folder.clear_unfinished(1) is not None
    assert not folder.run_folder(1).exists()
    assert (folder.path / "rounds" / "01_unfinished_2").is_dir()
    folder.run_folder(1).mkdir()
    folder.record_round(1, record())
    assert folder.clear_unfinished(1) is None
    assert folder.run_folder(1).exists()


def test_who_may_not_take_part_leaves_nothing(tmp_path: Path, wording: Wording):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    may_not: dict[str, Any] = {"consent": False, "eligibility": [True, False, True], "device": "script"}
    for who in (replace(session(1), **may_not), replace(session(1), pilot=True)):
        with pytest.raises(InvalidRunFolder) as refused:
            study.begin(who)
        wording.check(refused.value)
    assert study.numbers == []
    assert not list(study.participants.iterdir())


def test_a_folder_of_another_plan_or_of_something_else_is_refused(tmp_path: Path, wording: Wording):
    out = tmp_path / "out"
    StudyFolder.opened(out, PLAN).begin(session(1))
    other = parse_plan(default_plan().replace("seed = 2020", "seed = 2021"))
    wrong: list[Callable[[], object]] = [
        lambda: StudyFolder.opened(out, other),
        lambda: StudyFolder.read(tmp_path),
        lambda: StudyFolder.opened(tmp_path, PLAN),
        lambda: StudyFolder.read(out).begin(session(1)),
        lambda: StudyFolder.read(out).session(2),
    ]
    for act in wrong:
        with pytest.raises(InvalidRunFolder) as refused:
            act()
        wording.check(refused.value)
    assert StudyFolder.read(out).next_number == 2


@pytest.mark.parametrize(("name", "value"), [("language", "xx"), ("device", "feather"), ("consent", False)])
def test_a_session_that_the_plan_does_not_allow_is_refused(name: str, value: object, tmp_path: Path):
    file = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1)).path / "session.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), name: value}))
    with pytest.raises(InvalidRunFolder, match="does not fit the plan"):
        StudyFolder.read(tmp_path / "out").session(1)


@pytest.mark.parametrize(
    ("file", "entries"),
    [
        ("rounds/01.json", {"answers": {"S1": 55, "S2": 5, "S3": 5}}),
        ("rounds/01.json", {"answers": {"S1": 5, "S2": 5}}),
        ("rounds/01.json", {"answers": {"S1": 5, "S2": 5, "S3": 5, "S4": 5}}),
        ("questionnaire.json", {"age_group": "200"}),
        ("questionnaire.json", {"height": "tall"}),
    ],
)
def test_answers_that_the_plan_does_not_allow_are_in_no_table(file: str, entries: dict[str, object], tmp_path: Path):
    study = write_study(tmp_path / "out", 1, same)
    place = study.session(1).path / file
    place.write_text(json.dumps({**json.loads(place.read_text()), **entries}))
    with pytest.raises(InvalidRunFolder, match="does not fit the plan"):
        study.write_tables()
    assert study.withdraw(1, "2026-11-30", delete=True).deleted


def test_no_session_begins_in_a_folder_that_was_removed_meanwhile(tmp_path: Path):
    study = StudyFolder.opened(tmp_path / "out", PLAN)
    shutil.rmtree(study.path)
    with pytest.raises(InvalidRunFolder):
        study.begin(session(1))
    assert not study.path.exists()


@pytest.mark.parametrize("linked", ["participants", "participants/P01", "participants/P01/rounds"])
def test_sessions_that_lie_elsewhere_are_not_written_to(linked: str, tmp_path: Path, wording: Wording):
    StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1))
    (tmp_path / "out" / linked).rename(tmp_path / "elsewhere")
    (tmp_path / "out" / linked).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InvalidRunFolder) as refused:
        StudyFolder.read(tmp_path / "out")
    wording.check(refused.value)


def test_a_damaged_file_is_reported_by_its_name(tmp_path: Path, wording: Wording):
    folder = StudyFolder.opened(tmp_path / "out", PLAN).begin(session(1))
    folder.record_round(1, record())
    too_large = json.dumps({"record": asdict(record()), "answers": {"S1": 2**63}})
    damages: list[tuple[str, str, Callable[[], object]]] = [
        ("rounds/01.json", '{"record": {"success": true}}', lambda: folder.records),
        ("rounds/01.json", too_large, folder.write_tables),
        ("session.json", "{", lambda: SessionFolder.read(folder.path, PLAN)),
    ]
    for name, text, read in damages:
        (folder.path / name).write_text(text)
        with pytest.raises(InvalidRunFolder) as refused:
            read()
        wording.check(refused.value)


@pytest.mark.parametrize(
    ("scenario", "given", "failed"),
    [
        pytest.param("flyer_robot_to_human", (), False),
        pytest.param("flyer_collaborative", (), False, marks=pytest.mark.slow),
        pytest.param("flyer_robot_to_human", ("-p", "strength=0.1", "-p", "patience=5"), True, marks=pytest.mark.slow),
        pytest.param("flyer_impedance", (), None),  # its record does not say who held an object
    ],
)
def test_the_thesis_rule_by_who_held_the_object(scenario: str, given: tuple[str, ...], failed: bool | None):
    run = RunFolder.of_run(kept_run("run", scenario, *given, "--no-report"))
    assert failed is None or bool(run.read_summary()["success"]) is not failed
    assert failed_by_rule(run) is failed
