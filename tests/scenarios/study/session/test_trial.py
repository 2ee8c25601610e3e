"""A trial that cannot begin leaves nothing behind, and one of which nothing can be seen says why."""

import sys
import tempfile
from pathlib import Path

import pytest

from handover.scenarios.study.plan.led_hands import NoHand
from handover.scenarios.study.session.trial import Trial, TrialFailed, TrialRequest

DARK = """
from handover.scenarios.robots.free_flyer.handover.hand_practice import HandPractice


class Dark(HandPractice):
    name = "dark"

    def replay(self, parameters, record):
        raise ValueError("the lamp is broken")
"""


def test_a_trial_that_cannot_begin_leaves_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(NoHand):
        Trial(TrialRequest("flyer_two_robots", [], 0, tmp_path / "out", {}))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nowhere" / "python"))
    with pytest.raises(FileNotFoundError):
        Trial(TrialRequest("flyer_robot_to_human", ["hand=outside"], 0, tmp_path / "out", {}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_scene_that_fails_is_reported_with_the_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dark_scene.py").write_text(DARK, encoding="utf-8")
    trial = Trial(TrialRequest("dark_scene:Dark", [], 0, tmp_path / "out", {}))
    try:
        trial.begin()
        with pytest.raises(TrialFailed, match=r"ValueError: the lamp is broken \(dark_scene.py, line 9\)"):
            trial.scene_content()
    finally:
        trial.close()
