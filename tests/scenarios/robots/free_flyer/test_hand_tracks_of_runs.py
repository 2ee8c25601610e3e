"""Handovers whose hand is led by the track of another run."""

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from support.scenarios.flyer_runs import fmu, kept, metric, run
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.hand_track import HandPose, write_track
from handover.scenarios.cli.robots.flyer_track import flyer_track
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.free_flyer.handover.handovers import Collaborative, RobotToHuman
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause


def tracked(folder: Path, out: Path) -> Path:
    reported = CliRunner().invoke(flyer_track, [str(folder), "--out", str(out)])
    assert reported.exit_code == 0, reported.output
    return out


@pytest.mark.slow
def test_a_run_led_by_the_track_of_a_run_has_its_verdict(tmp_path: Path):
    person = kept("flyer_collaborative")
    track = tracked(person.folder, tmp_path / "new" / "track.csv")
    led = run(Collaborative, tmp_path / "led", f"hand_track={track}")
    assert led.outcome.success, led.outcome.reason
    assert metric(led, "transfer_time") == pytest.approx(person.metric("transfer_time"), abs=0.2)
    before, after = person.record, Record(tmp_path / "led" / "signals.parquet")
    n = min(len(before.time), len(after.time))
    np.testing.assert_allclose(after["person.p_WH_goal"][:n], before["person.p_WH_goal"][:n], atol=1e-12)
    assert np.max(np.abs(after["person.p_WH"][:n] - before["person.p_WH"][:n])) < 0.1


Change = Callable[[dict[str, str]], dict[str, str] | None]


def changed(track: Path, change: Change) -> Path:
    """Write a track's rows anew as `change` gives them, without those for which it gives None."""
    with track.open(newline="") as file:
        rows = list(csv.DictReader(file))
    out = track.with_name("changed.csv")
    with out.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(row for row in map(change, rows) if row is not None)
    return out


def early(row: dict[str, str]) -> dict[str, str] | None:
    t = float(row["t"])
    return row | {"closed": "1" if t > 4.5 else "0"} if t < 5.0 else None


def aside(row: dict[str, str], by: float = 0.5) -> dict[str, str]:
    return row | {"p_x": repr(float(row["p_x"]) + by)}


REFUSED: dict[str, Change] = {
    "one_row": lambda row: row if float(row["t"]) == 0.0 else None,
    "far_off": lambda row: aside(row, 2.0),
    "in_millimetres": lambda row: row | {f"p_{axis}": repr(1000.0 * float(row[f"p_{axis}"])) for axis in "xyz"},
    "by_the_clock": lambda row: row | {"t": repr(float(row["t"]) + 1.7e9)},
    "jumping": lambda row: row | {"p_x": "50.0"} if float(row["t"]) == 0.5 else row,
    "shifted": lambda row: aside(row, 1.2) if 0.65 < float(row["t"]) < 0.95 else row,
    "never_closed": lambda row: row | {"closed": "0"},
}


@pytest.mark.slow
def test_the_verdict_says_that_a_track_ended_too_early_and_the_run_ends_before_the_robot_s_patience(tmp_path: Path):
    track = changed(tracked(kept("flyer_robot_to_human").folder, tmp_path / "track.csv"), early)
    led = run(RobotToHuman, tmp_path / "led", f"hand_track={track}")
    words = r"signal of (\d+\.\d) s: .* ended at 5\.0 s, before the signal at \1 s"
    assert re.search(words, led.outcome.reason), led.outcome.reason
    assert metric(led, "decided_by") == Cause.NOT_TRIED
    assert led.summary["simulated_seconds"] < 50.0  # less than the patience of 60 s takes from the signal


def track_at_rest(out: Path) -> Path:
    pose = HandPose((-0.4, 0.1, -0.05), (1.0, 0.0, 0.0, 0.0), (0.0,) * 14, closed=False)
    write_track(out, [(0.1 * i, pose._replace(closed=i > 10)) for i in range(20)])
    return out


@pytest.mark.parametrize("case", REFUSED)
def test_a_track_of_which_no_handover_can_be_made_is_refused_at_once(tmp_path: Path, case: str, wording: Wording):
    track = changed(track_at_rest(tmp_path / "track.csv"), REFUSED[case])
    with pytest.raises(InvalidParameter) as refused:
        run(RobotToHuman, tmp_path / "led", f"hand_track={track}")
    wording.check(refused.value)
    assert not (tmp_path / "led").exists()


def test_what_only_a_simulated_person_has_is_refused_beside_a_track(tmp_path: Path, wording: Wording):
    led = f"hand_track={track_at_rest(tmp_path / 'track.csv')}"
    with pytest.raises(InvalidParameter) as refused:
        run(RobotToHuman, tmp_path / "led", led, "person.effort=3")
    wording.check(refused.value)


def test_a_track_that_cannot_be_followed_is_refused_before_the_run(tmp_path: Path, wording: Wording):
    (tmp_path / "t.csv").write_text("t\n0\n")
    parameters = parse_parameters(RobotToHuman, [f"hand_track={tmp_path / 't.csv'}"])
    with pytest.raises(InvalidParameter) as refused:
        RobotToHuman().build(parameters, 0, lambda name: fmu(RobotToHuman.units[name]))
    wording.check(refused.value)


def test_what_has_no_hand_has_no_track_and_none_goes_where_nothing_can_be_written(tmp_path: Path, wording: Wording):
    (tmp_path / "file").write_text("")
    for folder, out in (
        (kept("flyer_impedance").folder, "t.csv"),
        (tmp_path, "t.csv"),
        (kept("flyer_robot_to_human").folder, "file/t.csv"),
    ):
        reported = CliRunner().invoke(flyer_track, [str(folder), "--out", str(tmp_path / out)])
        assert reported.exit_code == 2
        wording.check(reported.output.replace(str(tmp_path), "TMP").replace(str(folder), "FOLDER"))
        assert not (tmp_path / out).exists()
