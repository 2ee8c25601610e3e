"""The handover itself, through the command, on the built FMUs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.commands import run_command
from support.cosim.terminal_units import described_unit, terminal_xml
from support.kept_runs import kept_run

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


def summary_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "summary.json").read_text())


@pytest.fixture(scope="module")
def handover() -> Path:
    """A whole run with its figures and page; that of the README."""
    return kept_run("run", "helix_handover", "--seed", "3")


@pytest.mark.slow
def test_the_ball_changes_hands(handover: Path):
    summary, record = summary_of(handover), Record(handover / "signals.parquet")
    assert summary["success"] is True
    metrics = summary["metrics"]
    assert metrics["final_distance"] == {**metrics["final_distance"], "unit": "m"}
    assert metrics["final_distance"]["value"] <= 0.006
    assert 5 <= metrics["steps"]["value"] <= 60
    assert metrics["cpu_per_cycle"]["value"] > 0
    assert metrics["peak_memory"]["value"] < 0.8e9
    apart = np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
    assert apart[-1] == pytest.approx(metrics["final_distance"]["value"])
    assert apart[np.searchsorted(record.time, 5.0)] < 0.6 * apart[0]
    assert record["hand.holder"][0] == 0
    assert record["hand.holder"][-1] == 1


@pytest.mark.slow
def test_a_run_leaves_its_whole_folder(handover: Path):
    assert sorted(p.name for p in handover.iterdir()) == [
        "figures",
        "pictures",
        "report.html",
        "run.json",
        "signals.parquet",
        "summary.json",
    ]
    figures = {p.name for p in (handover / "figures").iterdir()}
    assert figures == {f"{n}.{s}" for n in ("error", "grasp", "paths", "pictures", "tendons") for s in ("png", "svg")}
    assert (handover / "report.html").stat().st_size < 8e6
    content = json.loads((handover / "run.json").read_text())
    assert set(content["units"]) == {"arm", "hand", "camera", "vision", "servo"}
    assert all(len(u["sha256"]) == 64 for u in content["units"].values())


@pytest.mark.slow
def test_the_controller_sees_the_ball_and_the_arm_well(handover: Path):
    record = Record(handover / "signals.parquet")
    late = record.time > 1.0  # when the arm hangs before the ball, half of it is hidden
    errors = np.linalg.norm(record["vision.p_WG_meas"] - record["arm.p_WG"], axis=1)[late & record["vision.seen_R"]]
    assert np.median(errors) < 0.005
    errors = np.linalg.norm(record["vision.p_WO_meas"] - record["hand.p_WO"], axis=1)[late & record["vision.seen_O"]]
    assert np.median(errors) < 0.005


@pytest.mark.slow
def test_the_same_seed_gives_the_same_signals_bit_for_bit(handover: Path, tmp_path: Path):
    run_command("run", "helix_handover", "--seed", "3", "--stop", "3", "--no-report", "--out", tmp_path / "again")
    first, again = (pq.read_table(folder / "signals.parquet") for folder in (handover, tmp_path / "again"))
    assert again.num_rows > 100
    assert again.equals(first.slice(0, again.num_rows))


@pytest.mark.slow
def test_three_cameras_take_the_ball_though_one_is_covered_for_a_while():
    options = ("cameras=three", "cover=left", "cover_from=3", "cover_for=2")
    given = [text for option in options for text in ("-p", option)]
    out = kept_run("run", "helix_handover", *given, "--unit", "arm=TendonArmFast", "--seed", "3")
    assert summary_of(out)["success"]
    assert summary_of(out)["metrics"]["closing_distance"]["value"] < 0.005
    assert {p.stem.rsplit("_", 1)[-1] for p in (out / "pictures").glob("*.jpg")} == {"left", "right", "third"}
    record = Record(out / "signals.parquet")
    assert len(HelixHandover().replay(Parameters(cameras=CameraPlaces.THREE), record).fixed) == 3
    covered, before = ((record.time > a) & (record.time < b) for a, b in ((3.1, 4.9), (2.0, 2.9)))
    cov_R = record["vision.cov_R"]
    assert np.trace(cov_R[covered].mean(axis=0)) > np.trace(cov_R[before].mean(axis=0))
