"""Handovers whose hand is led by the track of another run."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from flyer_runs import metric, run

from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.cli.flyer_track import flyer_track
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.free_flyer.handovers import (
    Collaborative,
    FailedReception,
    FlyerHandover,
    HumanToRobot,
    RobotToHuman,
)


def tracked(folder: Path, out: Path) -> Path:
    told = CliRunner().invoke(flyer_track, [str(folder), "--out", str(out)])
    assert told.exit_code == 0, told.output
    return out


@pytest.mark.slow
@pytest.mark.parametrize("scenario", [RobotToHuman, HumanToRobot, FailedReception, Collaborative])
def test_a_run_led_by_the_track_of_a_run_has_its_verdict(tmp_path: Path, scenario: type[FlyerHandover]):
    person = run(scenario, tmp_path / "person", seed=1)
    track = tracked(tmp_path / "person", tmp_path / "track.csv")
    led = run(scenario, tmp_path / "led", f"hand_track={track}", seed=1)
    assert person.outcome.success, person.outcome.reason
    assert led.outcome.success, led.outcome.reason
    assert metric(led, "transfer_time") == pytest.approx(metric(person, "transfer_time"), abs=0.2)
    before, after = (Record(tmp_path / name / "signals.parquet") for name in ("person", "led"))
    n = min(len(before.time), len(after.time))
    np.testing.assert_allclose(after["person.p_WH_goal"][:n], before["person.p_WH_goal"][:n], atol=1e-12)
    assert np.max(np.abs(after["person.p_WH"][:n] - before["person.p_WH"][:n])) < 0.1


def test_a_track_that_cannot_be_followed_is_refused_before_the_run(tmp_path: Path):
    (tmp_path / "t.csv").write_text("t\n0\n")
    parameters = parse_parameters(RobotToHuman, [f"hand_track={tmp_path / 't.csv'}"])
    with pytest.raises(InvalidParameter, match=r"hand_track: track .*t\.csv: its first row must name"):
        RobotToHuman().build(parameters, 0, lambda name: cached(RobotToHuman.units[name], 3))


def test_a_folder_without_a_hand_has_no_track(tmp_path: Path):
    told = CliRunner().invoke(flyer_track, [str(tmp_path), "--out", str(tmp_path / "t.csv")])
    assert told.exit_code == 2
    assert "name the folder of a run" in told.output
