"""The handover itself, through the command, on the built FMUs."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from terminal_units import described_unit, terminal_xml

from handover.cosim.exceptions import WiringError
from handover.cosim.record.reader import Record
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.helix.cameras import CameraPlaces
from handover.scenarios.helix.helix_handover import HelixHandover
from handover.scenarios.helix.helix_reflex_grasp import HelixReflexGrasp
from handover.scenarios.helix.parameters import Parameters


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-c", "from handover.scenarios.cli.command import main; main()", *map(str, arguments)]


def run(out: Path, *arguments: str) -> tuple[int, dict[str, Any]]:
    call = command("run", "helix_handover", *arguments, "--out", out)
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert (out / "summary.json").is_file(), done.stderr
    return done.returncode, json.loads((out / "summary.json").read_text())


def test_a_command_acts_in_the_step_that_follows_its_picture():
    system = HelixHandover().build(Parameters(), 0, lambda name: cached(HelixHandover.units[name], 3))
    schedule = Schedule(system)
    assert [s.unit for s in schedule.sampled] == ["camera", "vision", "servo"]
    assert [s.unit for s in schedule.continuous] == ["arm", "hand"]


def test_a_third_picture_is_wired_where_there_is_a_third_camera():
    for cameras in (CameraPlaces.BEHIND, CameraPlaces.THREE):
        system = HelixHandover().build(Parameters(cameras=cameras), 0, lambda n: cached(HelixHandover.units[n], 3))
        pairs = {(f"{c.source.unit}.{c.source.port}", f"{c.target.unit}.{c.target.port}") for c in system.connections}
        assert (("camera.third", "vision.third") in pairs) is (cameras is CameraPlaces.THREE)


HANDOVER = {
    **{f"camera.{name}": f"arm.{name}" for name in ("backbone", "p_WR", "q_WR", "p_WG", "q_WG", "grip")},
    **{f"camera.{name}": f"hand.{name}" for name in ("p_WO", "p_WH")},
    **{f"vision.{name}": f"camera.{name}" for name in ("left", "right")},
    **{f"servo.{what}_meas": f"vision.{what}_meas" for what in ("p_WO", "p_WR", "p_WG")},
    **{f"servo.{name}": f"vision.{name}" for name in ("cov_O", "cov_R", "cov_G", "seen_O", "seen_R")},
    **{f"arm.{name}": f"servo.{name}" for name in ("dl_t", "closure")},
    "arm.f_G": "hand.f_G",
    **{f"hand.{name}": f"arm.{name}" for name in ("p_WG", "q_WG", "grip")},
}
"""By input, the output that feeds it."""

WITH_REFLEX = {
    **HANDOVER,
    **{f"servo.{what}_meas": f"reflex.{what}" for what in ("p_WO", "p_WR", "p_WG")},
    **{f"servo.cov_{frame}": f"reflex.P_{frame}" for frame in "ORG"},
    **{f"servo.seen_{frame}": f"reflex.known_{frame}" for frame in "OR"},
    **{f"reflex.{what}_meas": f"vision.{what}_meas" for what in ("p_WO", "p_WR", "p_WG")},
    **{f"reflex.{name}": f"vision.{name}" for name in ("cov_O", "cov_R", "cov_G", "seen_O", "seen_R")},
    **{f"fingers.{name}": f"arm.{name}" for name in ("p_WG", "q_WG", "grip")},
    **{f"fingers.{name}": f"hand.{name}" for name in ("p_WO", "p_WH")},
    **{f"reflex.{name}": f"servo.{name}" for name in ("dl_t", "q_est")},
    "reflex.ticks": "fingers.ticks",
    "reflex.grip": "arm.grip",
}


@pytest.mark.parametrize(("scenario", "wanted"), [(HelixHandover(), HANDOVER), (HelixReflexGrasp(), WITH_REFLEX)])
def test_whole_units_are_wired_to_what_they_are_to_be(scenario: Experiment[Any], wanted: dict[str, str]):
    system = scenario.build(scenario.parameters_type(), 0, lambda name: cached(scenario.units[name], 3))
    system.check()
    assert sorted((str(c.target), str(c.source)) for c in system.connections) == sorted(wanted.items())


def wired_with(hand: Path, **others: Path) -> System:
    """Return the handover with another unit in the place of hand and ball, and others in theirs."""
    fmus = {name: cached(unit, 3) for name, unit in HelixHandover.units.items()} | {"hand": hand, **others}
    return HelixHandover().wire(Parameters(), 0, lambda name: fmus[name])


def test_more_outputs_of_a_unit_in_a_place_leave_the_scenarios_connections_as_they_are(tmp_path: Path):
    given = {"p_WO": "m 3", "p_WH": "m 3", "f_G": "N 3"}
    more = {"p_WR": "m 3", "q_WR": "1 4", "p_WG": "m 3", "dl_t": "m 9"}
    palm = terminal_xml("palm", "plug", "_handover_pose", p_WR="p_WR", q_WR="q_WR")
    plain = wired_with(described_unit(tmp_path / "plain.fmu", {}, given))
    system = wired_with(described_unit(tmp_path / "more.fmu", {}, given | more, palm))
    with pytest.raises(WiringError) as lacks:
        system.check()
    assert all("needs the" in fault for fault in lacks.value.faults)  # such as the ball's place, which it does not have
    assert system.connections == plain.connections
    assert ("camera.p_WR", "arm.p_WR") in {(str(c.target), str(c.source)) for c in system.connections}


def test_an_input_that_more_outputs_of_two_units_match_is_left_and_noted(tmp_path: Path):
    pushes = [described_unit(tmp_path / f"{name}.fmu", {}, {"f_P": "N 3"}) for name in ("hand", "servo")]
    system = wired_with(pushes[0], servo=pushes[1])
    with pytest.raises(WiringError) as lacks:
        system.check()
    assert not any("match" in fault for fault in lacks.value.faults)
    assert "f_P" not in system.fed_inputs("arm")
    assert any(note.startswith("arm.f_P: servo.f_P and hand.f_P match it") for note in system.notes)


def test_a_unit_in_a_place_need_not_match_what_is_optional_and_differs_nowhere(tmp_path: Path):
    given = {"p_WO": "m 3", "p_WH": "m 3"}
    without = wired_with(described_unit(tmp_path / "a.fmu", {}, given))
    with pytest.raises(WiringError) as lacks:
        without.check()
    assert all("needs the" in fault for fault in lacks.value.faults)  # the required ones alone
    assert any("no inputs p_WG, q_WG, grip" in note for note in without.notes)
    other = wired_with(described_unit(tmp_path / "b.fmu", {"p_WG": "m 2"}, given))
    with pytest.raises(WiringError, match=r"hand\.p_WG \(real \[2\] m\): it must be real \[3\] m, as that of Handover"):
        other.check()


@pytest.mark.slow
def test_three_cameras_take_the_ball_though_one_is_covered_for_ever(tmp_path: Path):
    options = ["-p", "cameras=three", "-p", "cover=left", "-p", "cover_from=0", "-p", "cover_for=100"]
    status, summary = run(tmp_path / "r", *options, "--unit", "arm=TendonArmFast", "--seed", "3")
    assert status == 0
    assert summary["metrics"]["closing_distance"]["value"] < 0.005
    pictures = (tmp_path / "r" / "pictures").glob("*.jpg")
    assert {p.stem.rsplit("_", 1)[-1] for p in pictures} == {"left", "right", "third"}
    record = Record(tmp_path / "r" / "signals.parquet")
    assert len(HelixHandover().replay(Parameters(cameras=CameraPlaces.THREE), record).fixed) == 3


@pytest.mark.slow
def test_the_arm_comes_nearer_to_a_ball_that_it_has_seen(tmp_path: Path):
    status, summary = run(tmp_path / "r", "--seed", "3", "--stop", "5", "--no-report")
    assert status == 1
    assert "ended at 5 s, as asked" in summary["reason"]
    record = Record(tmp_path / "r" / "signals.parquet")
    apart = np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
    assert apart[-1] < 0.6 * apart[0]
    seen = record["vision.seen_O"] & (record.time > 1.0)
    assert np.median(np.linalg.norm(record["vision.p_WO_meas"] - record["hand.p_WO"], axis=1)[seen]) < 0.005


@pytest.fixture(scope="module")
def handover(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, dict[str, Any]]:
    out = tmp_path_factory.mktemp("runs") / "r"
    return out, *run(out, "--seed", "3")


@pytest.mark.slow
def test_the_ball_changes_hands(handover: tuple[Path, int, dict[str, Any]]):
    out, status, summary = handover
    assert status == 0
    assert summary["success"] is True
    metrics = summary["metrics"]
    assert metrics["final_distance"] == {**metrics["final_distance"], "unit": "m"}
    assert metrics["final_distance"]["value"] <= 0.006
    assert 5 <= metrics["steps"]["value"] <= 60
    assert metrics["cpu_per_cycle"]["value"] > 0
    record = Record(out / "signals.parquet")
    end = np.linalg.norm(record["arm.p_WG"][-1] - record["hand.p_WO"][-1])
    assert end == pytest.approx(metrics["final_distance"]["value"])
    assert record["hand.holder"][0] == 0
    assert record["hand.holder"][-1] == 1


@pytest.mark.slow
def test_the_run_stays_within_its_memory(handover: tuple[Path, int, dict[str, Any]]):
    assert handover[2]["metrics"]["peak_memory"]["value"] < 0.8e9


@pytest.mark.slow
def test_a_run_leaves_its_whole_folder(handover: tuple[Path, int, dict[str, Any]]):
    out = handover[0]
    assert sorted(p.name for p in out.iterdir()) == [
        "figures",
        "pictures",
        "report.html",
        "run.json",
        "signals.parquet",
        "summary.json",
    ]
    figures = {p.name for p in (out / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("error", "grasp", "paths", "pictures", "tendons") for s in ("png", "svg")}
    assert (out / "report.html").stat().st_size < 8e6
    content = json.loads((out / "run.json").read_text())
    assert set(content["units"]) == {"arm", "hand", "camera", "vision", "servo"}
    assert all(len(u["sha256"]) == 64 for u in content["units"].values())


@pytest.mark.slow
def test_the_controller_sees_the_ball_and_the_arm_well(handover: tuple[Path, int, dict[str, Any]]):
    record = Record(handover[0] / "signals.parquet")
    late = record.time > 1.0  # when the arm hangs before the ball, half of it is hidden
    errors = np.linalg.norm(record["vision.p_WG_meas"] - record["arm.p_WG"], axis=1)[late & record["vision.seen_R"]]
    assert np.median(errors) < 0.005
    errors = np.linalg.norm(record["vision.p_WO_meas"] - record["hand.p_WO"], axis=1)[late & record["vision.seen_O"]]
    assert np.median(errors) < 0.005


@pytest.mark.slow
def test_the_same_seed_gives_the_same_signals_bit_for_bit(handover: tuple[Path, int, dict[str, Any]], tmp_path: Path):
    run(tmp_path / "again", "--seed", "3")
    first, second = (
        hashlib.sha256((p / "signals.parquet").read_bytes()).hexdigest() for p in (handover[0], tmp_path / "again")
    )
    assert first == second


@pytest.mark.slow
def test_covering_a_camera_for_two_seconds_does_not_lose_the_handover(tmp_path: Path):
    status, summary = run(tmp_path / "r", "-p", "cover=left", "-p", "cover_from=3", "-p", "cover_for=2")
    assert status == 0, summary["reason"]
    record = Record(tmp_path / "r" / "signals.parquet")
    covered = (record.time > 3.1) & (record.time < 4.9)
    assert np.trace(record["vision.cov_R"][covered].mean(axis=0)) > np.trace(
        record["vision.cov_R"][(record.time > 2.0) & (record.time < 2.9)].mean(axis=0)
    )


@pytest.mark.slow
def test_a_ball_out_of_reach_ends_with_status_1_and_says_why(tmp_path: Path):
    status, summary = run(tmp_path / "r", "-p", "radius=0.8", "-p", "patience=8")
    assert status == 1
    assert summary["success"] is False
    assert "out of reach" in summary["reason"] or "did not see" in summary["reason"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_and_keeps_its_record(tmp_path: Path, number: signal.Signals):
    out = tmp_path / "r"
    going = subprocess.Popen(command("run", "helix_handover", "--out", out), stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not (out / "signals.arrows").exists():
        assert going.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.1)
    os.kill(going.pid, number)
    printed, _ = going.communicate(timeout=120)
    assert going.returncode == 1
    assert "interrupted" in printed
    record = Record(out / "signals.parquet")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["success"] is False
    assert record.time[-1] == pytest.approx(summary["simulated_seconds"])
    assert (out / "report.html").is_file()
