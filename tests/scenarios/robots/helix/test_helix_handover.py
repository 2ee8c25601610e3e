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
from handover.scenarios.robots.helix.cameras import CameraPlaces
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.helix.helix_reflex_grasp import HelixReflexGrasp
from handover.scenarios.robots.helix.parameters import Parameters

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


@pytest.mark.parametrize(
    ("scenario", "parameters", "wanted"),
    [
        (HelixHandover(), {}, HANDOVER),
        (HelixHandover(), {"cameras": CameraPlaces.THREE}, HANDOVER | {"vision.third": "camera.third"}),
        (HelixReflexGrasp(), {}, WITH_REFLEX),
    ],
    ids=["handover", "three", "reflex"],
)
def test_whole_units_are_wired_to_what_they_are_to_be(
    scenario: Experiment[Any], parameters: dict[str, Any], wanted: dict[str, str]
):
    system = scenario.build(scenario.parameters_type(**parameters), 0, lambda name: cached(scenario.units[name], 3))
    system.check()
    assert sorted((str(c.target), str(c.source)) for c in system.connections) == sorted(wanted.items())
    if wanted is HANDOVER:  # a command acts in the step that follows its picture
        schedule = Schedule(system)
        assert [s.unit for s in schedule.sampled] == ["camera", "vision", "servo"]
        assert [s.unit for s in schedule.continuous] == ["arm", "hand"]


def wired_with(hand: Path, **others: Path) -> tuple[System, list[str]]:
    """Return the handover with other units in the place of hand and ball and in others, and what its check finds."""
    fmus = {name: cached(unit, 3) for name, unit in HelixHandover.units.items()} | {"hand": hand, **others}
    system = HelixHandover().wire(Parameters(), 0, lambda name: fmus[name])
    with pytest.raises(WiringError) as lacks:
        system.check()
    return system, list(lacks.value.faults)


def test_more_outputs_of_a_unit_in_a_place_leave_the_scenarios_connections_as_they_are(tmp_path: Path):
    given = {"p_WO": "m 3", "p_WH": "m 3", "f_G": "N 3"}
    more = {"p_WR": "m 3", "q_WR": "1 4", "p_WG": "m 3", "dl_t": "m 9"}
    palm = terminal_xml("palm", "plug", "_handover_pose", p_WR="p_WR", q_WR="q_WR")
    plain, _ = wired_with(described_unit(tmp_path / "plain.fmu", {}, given))
    system, faults = wired_with(described_unit(tmp_path / "more.fmu", {}, given | more, palm))
    assert all("needs the" in fault for fault in faults)  # such as the ball's place, which it does not have
    assert system.connections == plain.connections
    assert ("camera.p_WR", "arm.p_WR") in {(str(c.target), str(c.source)) for c in system.connections}


def test_an_input_that_more_outputs_of_two_units_match_is_left_and_noted(tmp_path: Path):
    pushes = [described_unit(tmp_path / f"{name}.fmu", {}, {"f_P": "N 3"}) for name in ("hand", "servo")]
    system, faults = wired_with(pushes[0], servo=pushes[1])
    assert not any("match" in fault for fault in faults)
    assert "f_P" not in system.fed_inputs("arm")
    assert any(note.startswith("arm.f_P: servo.f_P and hand.f_P match it") for note in system.notes)


def test_a_unit_in_a_place_need_not_match_what_is_optional_and_differs_nowhere(tmp_path: Path):
    given = {"p_WO": "m 3", "p_WH": "m 3"}
    without, faults = wired_with(described_unit(tmp_path / "a.fmu", {}, given))
    assert all("needs the" in fault for fault in faults)  # the required ones alone
    assert any("no inputs p_WG, q_WG, grip" in note for note in without.notes)
    _, faults = wired_with(described_unit(tmp_path / "b.fmu", {"p_WG": "m 2"}, given))
    assert any(fault.startswith("hand.p_WG (real [2] m): it must be real [3] m") for fault in faults)


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
    assert metrics["final_distance"]["value"] <= 0.006
    assert 5 <= metrics["steps"]["value"] <= 60
    assert metrics["peak_memory"]["value"] < 0.8e9
    apart = np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
    assert apart[-1] == pytest.approx(metrics["final_distance"]["value"])
    assert apart[np.searchsorted(record.time, 5.0)] < 0.6 * apart[0]
    assert (record["hand.holder"][0], record["hand.holder"][-1]) == (0, 1)
    late = record.time > 1.0  # when the arm hangs before the ball, half of it is hidden
    for measured, true, seen in (("p_WG_meas", "arm.p_WG", "seen_R"), ("p_WO_meas", "hand.p_WO", "seen_O")):
        errors = np.linalg.norm(record[f"vision.{measured}"] - record[true], axis=1)
        assert np.median(errors[late & record[f"vision.{seen}"]]) < 0.005


@pytest.mark.slow
def test_the_same_seed_gives_the_same_signals_bit_for_bit(handover: Path, tmp_path: Path):
    run_command("run", "helix_handover", "--seed", "3", "--stop", "3", "--no-report", "--out", tmp_path / "again")
    first, again = (pq.read_table(folder / "signals.parquet") for folder in (handover, tmp_path / "again"))
    assert again.num_rows > 100
    assert again.equals(first.slice(0, again.num_rows))


@pytest.mark.slow
def test_three_cameras_see_the_ball_though_one_is_covered_for_a_while():
    options = ("cameras=three", "cover=left", "cover_from=3", "cover_for=2")
    given = [text for option in options for text in ("-p", option)]
    out = kept_run(
        "run", "helix_handover", *given, "--unit", "arm=TendonArmFast", "--seed", "3", "--stop", "5", "--no-report"
    )
    record = Record(out / "signals.parquet")
    assert len(HelixHandover().replay(Parameters(cameras=CameraPlaces.THREE), record).fixed) == 3
    covered, before = ((record.time > a) & (record.time < b) for a, b in ((3.1, 4.9), (2.0, 2.9)))
    cov_R = record["vision.cov_R"]
    assert np.trace(cov_R[covered].mean(axis=0)) > np.trace(cov_R[before].mean(axis=0))
