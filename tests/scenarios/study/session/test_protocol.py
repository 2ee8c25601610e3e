"""What a participant goes through: screens, what may be done on them, and what is kept."""

import re
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from support.scenarios.sample_study import PLAN, play, record, same, session
from support.wording import Wording

from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.runs.reporting.page import asset
from handover.scenarios.study.folder.study_folder import StudyFolder
from handover.scenarios.study.session.practice import DeviceTest
from handover.scenarios.study.session.protocol import MOST_ATTEMPTS, SCREENS, InvalidAction, Protocol
from handover.scenarios.study.session.screen_content import VoidCause
from handover.scenarios.study.session.server import page_words

PRACTISED = DeviceTest("mouse", LedHand("person", (0.0, 0.0, 0.0), 0.8)).shown
RATINGS = {"S1": 7, "S2": 8, "S3": 9}


def begun(path: Path) -> Protocol:
    """Return a protocol of which a participant has chosen the device."""
    protocol = Protocol(StudyFolder.opened(path, PLAN), PLAN.devices)
    protocol.act("language", "en")
    protocol.act("consent", True)
    protocol.act("eligibility", [True] * 3)
    protocol.act(
        "device", {"device": "mouse", "settings": {"gain": 2.0, "wrong": [1], "nan": float("nan"), "huge": 10**400}}
    )
    return protocol


def practised(path: Path) -> Protocol:
    protocol = begun(path)
    protocol.act("begin")
    protocol.end_practice(PRACTISED)
    return protocol


def test_a_session_goes_from_consent_to_thanks_and_all_of_it_is_kept(tmp_path: Path):
    protocol = begun(tmp_path / "study")
    seen = [protocol.screen]
    protocol.act("begin")
    seen.append(protocol.screen)
    protocol.end_practice(PRACTISED)
    for planned in list(protocol.study.session(1).rounds):
        seen.append(protocol.screen)
        assert protocol.content()["task"] == planned.condition.task
        assert planned.condition.behaviour not in str(protocol.content())
        protocol.act("begin")
        protocol.end_round(record())
        assert protocol.content()["statements"]["S2"] == "I was satisfied with the interaction."
        protocol.act("rate", RATINGS)
    protocol.act("answer", {"age_group": "21-30", "comments": "none"})
    assert [*dict.fromkeys(seen), protocol.screen] == ["practice", "practising", "instruction", "thanks"]
    session = protocol.study.session(1)
    assert session.is_complete
    assert session.session.device_settings == {"gain": 2.0}
    assert session.notes.practice is not None
    answers = pd.read_csv(session.path / "answers.csv")
    assert len(answers) == 36
    assert answers["value"].min() == 7
    assert answers["value"].max() == 9
    protocol.act("next")
    assert (protocol.number, protocol.screen) == (2, "language")


@pytest.mark.parametrize(("action", "value"), [("consent", False), ("eligibility", [True, True, False])])
def test_who_does_not_agree_or_may_not_take_part_leaves_nothing(action: str, value: object, tmp_path: Path):
    protocol = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices)
    protocol.act("language", "de")
    if action == "eligibility":
        protocol.act("consent", True)
    protocol.act(action, value)
    assert protocol.screen == "declined"
    assert list((tmp_path / "study" / "participants").iterdir()) == []
    protocol.act("next")
    assert (protocol.number, protocol.screen) == (1, "language")


def test_another_device_is_chosen_until_the_practice_begins(tmp_path: Path):
    protocol = begun(tmp_path / "study")
    assert protocol.screen == "practice"
    protocol.act("other_device")
    assert protocol.screen == "device"
    protocol.act("device", "gamepad")
    assert (protocol.screen, protocol.content()["device"]) == ("practice", "gamepad")
    again = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices, number=1)
    assert again.content()["device"] == "gamepad"
    again.act("other_device")
    again.act("device", "tracker")
    kept = StudyFolder.opened(tmp_path / "study", PLAN).session(1).session
    assert kept == replace(protocol.study.session(1).session, device="tracker")
    assert kept.eligibility == [True] * 3
    for go_on in (lambda: protocol.act("begin"), lambda: protocol.end_practice(PRACTISED)):
        go_on()
        with pytest.raises(InvalidAction, match="other_device"):
            protocol.act("other_device")


def test_a_session_that_was_broken_off_goes_on_at_what_was_not_finished(tmp_path: Path):
    protocol = practised(tmp_path / "study")
    protocol.act("begin")
    protocol.end_round(record())
    again = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices)
    again.act("continue", 1)
    assert (again.number, again.screen, again.content()["round"]) == (1, "rating", 1)
    again.act("rate", RATINGS)
    third = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices, number=1)
    assert (third.screen, third.content()["round"]) == ("instruction", 2)


def test_an_unfinished_session_is_not_another_persons(tmp_path: Path):
    practised(tmp_path / "study")
    protocol = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices)
    assert (protocol.screen, protocol.session) == ("who", None)
    shown = protocol.content()
    assert [of["participant"] for of in shown["unfinished"]] == ["P01"]
    assert (shown["participant"], shown["new"]) == (None, "P02")
    refused: list[object] = [2, True, "1", {}, None]
    for wrong in refused:
        with pytest.raises(InvalidAction, match=r": 1 \(P01\)$"):
            protocol.act("continue", wrong)
    protocol.act("new")
    assert (protocol.number, protocol.screen) == (2, "language")
    protocol.act("language", "en")
    protocol.act("consent", False)
    protocol.act("next")
    assert protocol.screen == "who"


def test_after_a_participant_who_was_named_it_is_asked_who_comes_next(tmp_path: Path):
    practised(tmp_path / "study")
    study = StudyFolder.opened(tmp_path / "study", PLAN)
    begun = study.begin(session(5))
    begun.notes.keep_practice(PRACTISED)
    play(begun, same)
    protocol = Protocol(study, PLAN.devices, number=5)
    assert protocol.screen == "thanks"
    protocol.act("next")
    assert (protocol.screen, protocol.content()["new"]) == ("who", "P06")
    study.withdraw(1, "2026-11-25T10:00:00", delete=False)
    protocol.act("new")
    assert (protocol.number, protocol.screen) == (6, "language")


def test_a_void_round_is_played_again_with_its_reason_and_at_last_kept_as_void(tmp_path: Path):
    protocol = practised(tmp_path / "study")
    session = protocol.study.session(1)
    for attempt in range(1, MOST_ATTEMPTS + 1):
        protocol.act("begin")
        session.run_folder(1).mkdir()
        protocol.void_round(f"the page was closed, {attempt}")
        assert protocol.content()["reason"] == f"the page was closed, {attempt}"
        protocol.act("next")
    assert protocol.content()["round"] == 2
    rounds = pd.read_csv(session.path / "rounds.csv")
    assert rounds["void"].tolist() == [True]
    assert rounds["void_reason"].tolist() == ["the page was closed, 3"]
    attempts = pd.read_csv(session.path / "void_attempts.csv")
    assert attempts["folder"].tolist() == ["01_unfinished_1", "01_unfinished_2"]
    assert attempts["reason"].tolist() == ["the page was closed, 1", "the page was closed, 2"]
    assert session.answers == {}


def test_why_a_round_is_void_is_reported_in_every_language_and_the_end_of_the_practice_once(tmp_path: Path):
    protocol = practised(tmp_path / "study")
    assert protocol.content()["practice_over"]
    protocol.act("begin")
    protocol.void_round(f"{VoidCause.NO_SAMPLE.value} for 3 s: the device or the page was lost")
    assert protocol.content()["cause"] == "no_sample"
    protocol.act("next")
    assert not protocol.content()["practice_over"]
    protocol.act("begin")
    protocol.void_round("another reason")
    assert protocol.content()["cause"] == ""
    for words in page_words().values():
        assert {f"void_{cause.name.lower()}" for cause in VoidCause} <= set(words)


def test_who_withdraws_is_not_asked_again_and_is_in_no_result(tmp_path: Path):
    protocol = practised(tmp_path / "study")
    protocol.act("begin")
    protocol.end_round(record())
    protocol.act("withdraw")
    assert protocol.screen == "withdrawn"
    assert len(protocol.study.session(1).records) == 1
    assert protocol.study.sessions == []
    withdrawal = protocol.study.withdrawals[1]
    assert withdrawal.during
    assert not withdrawal.deleted
    protocol.study.withdraw(1, "2026-11-25T10:00:00", delete=True)
    assert [f.name for f in (protocol.study.participants / "P01").iterdir()] == ["withdrawn.json"]
    assert protocol.study.withdrawals[1].ended == withdrawal.ended
    assert Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices).number == 2


@pytest.mark.parametrize(
    ("action", "value"),
    [
        pytest.param("rate", {"S1": 7, "S2": 8}, id="two of three ratings"),
        pytest.param("rate", {"S1": 7, "S2": 8, "S3": 10}, id="a rating too high"),
        pytest.param("rate", {"S1": 7, "S2": 8, "S3": "9"}, id="a text for a rating"),
        pytest.param("rate", [7, 8, 9], id="a list of ratings"),
        pytest.param("begin", None, id="an action of another screen"),
        pytest.param("fly", None, id="no action"),
    ],
)
def test_what_is_not_to_be_done_is_refused_and_changes_nothing(
    action: str, value: object, tmp_path: Path, wording: Wording
):
    protocol = practised(tmp_path / "study")
    protocol.act("begin")
    protocol.end_round(record())
    with pytest.raises(InvalidAction) as refused:
        protocol.act(action, value)
    wording.check(refused.value)
    assert protocol.screen == "rating"
    assert protocol.study.session(1).answers == {}


def test_the_page_draws_every_screen_and_says_when_all_participants_have_come(tmp_path: Path):
    protocol = Protocol(StudyFolder.opened(tmp_path / "study", PLAN), PLAN.devices, number=19)
    assert protocol.screen == "complete"
    script = asset("study/study.js")
    assert [name for name in SCREENS if not re.search(rf"^ {{4}}{name}(:|\(|,)", script, re.MULTILINE)] == []
