"""Every scenario can be seen in space: its replay is complete, finite and small."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.kept_runs import kept_run

from handover.cosim.record.reader import Record
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.experiment.replay import Body, Line
from handover.scenarios.runs.reporting.replay_section import phase_changes, replay_section

MUST_SHOW: dict[str, set[str]] = {
    "helix_handover": {"arm", "gripper", "hand", "ball", "cameras"},
    "helix_reflex_grasp": {"arm", "gripper", "hand", "ball", "cameras"},
    "vsl_model_based": {"arm", "gripper", "load", "desired path", "path of the tip"},
    "vsl_hybrid": {"arm", "gripper", "load", "desired path", "path of the tip", "tip, by the hybrid model"},
    "flyer_impedance": {"robot", "gripper", "push", "place of rest"},
    "flyer_arm_impedance": {"robot", "link 1", "link 2", "gripper", "push", "place of rest"},
    **{
        f"flyer_{task}": {"robot", "arm", "gripper", "signal light", "object", "hand"}
        for task in ("robot_to_human", "human_to_robot", "failed_reception", "collaborative")
    },
    "flyer_two_robots": {f"{part} {r}" for part in ("robot", "arm", "gripper") for r in (1, 2)}
    | {"object", "handles", "hand"},
    "ir_grasp": {"palm", "thumb", "index", "ring", "object", "beams"},
    "ir_sensor": {"palm", "thumb", "index", "ring", "object", "beams"},
}
FIRST = ("vsl_hybrid", "flyer_impedance")
BRIEF = ("helix_handover", "helix_reflex_grasp", "helix_reach", "vsl_model_based", "flyer_handover")
"""Scenarios of which no other test has a whole run by its own parameters."""
LARGEST = 400_000


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in FIRST else (pytest.mark.slow,)) for n in SCENARIOS])
def test_a_scenario_is_shown_in_space(name: str):
    begins = ("--stop", "0.5") if name in BRIEF else ()
    record = Record(kept_run("run", name, "--no-report", *begins) / "signals.parquet")
    scenario, parameters = SCENARIOS[name](), parse_parameters(SCENARIOS[name], ())
    replay = scenario.replay(parameters, record)
    assert replay is not None
    drawn = [*replay.bodies, *replay.lines, *replay.fixed]
    assert {d.label for d in drawn} >= MUST_SHOW.get(name, set())
    assert all(d.label for d in drawn)
    assert any(len(np.unique(positions(d), axis=0)) > 1 for d in (*replay.bodies, *replay.lines)), "nothing moves"
    for d in drawn:
        check(d, len(record.time))
    for k in (0, len(record.time) // 2, -1):
        one = scenario.replay(parameters, record.row(k))
        assert one is not None
        alone = [*one.bodies, *one.lines, *one.fixed]
        assert [d.label for d in alone] == [d.label for d in drawn]
        for whole, row in zip(drawn, alone, strict=True):
            np.testing.assert_allclose(placed(row, -1), placed(whole, k), atol=1e-6, err_msg=f"{whole.label}, row {k}")
    assert any(phase for _, phase in phase_changes(record, replay.phases)), "no phase is shown beside the time"
    assert len(replay_section(replay, record).html) < LARGEST


def positions(drawn: Line | Body) -> NDArray[np.float64]:
    return drawn.points if isinstance(drawn, Line) else drawn.p_WB


def placed(drawn: Line | Body, k: int) -> NDArray[np.float64]:
    """Return where the points of a line or a body's corners are at a row, which may be the only one it has."""
    if isinstance(drawn, Line):
        return drawn.points[k if len(drawn.points) > 1 else 0]
    moves, turns = len(drawn.p_WB) > 1, drawn.q_WB is not None and len(drawn.q_WB) > 1
    p = drawn.p_WB[k if moves else 0]
    if drawn.q_WB is None:
        return p + drawn.mesh.vertices
    return p + Rotation.from_quat(drawn.q_WB[k if turns else 0], scalar_first=True).apply(drawn.mesh.vertices)


def check(drawn: Line | Body, rows: int) -> None:
    if isinstance(drawn, Line):
        assert len(drawn.points) in (1, rows)
        assert drawn.points.ndim == 3
        gone = np.isnan(drawn.points).any(axis=(1, 2))
        assert np.isfinite(drawn.points[~gone]).all()
        assert drawn.radii is None or drawn.radii.shape == drawn.points.shape[1:2]
        return
    assert len(drawn.p_WB) in (1, rows)
    assert np.isfinite(drawn.mesh.vertices).all()
    assert np.isfinite(drawn.p_WB).all()
    assert 0 <= drawn.mesh.triangles.min() <= drawn.mesh.triangles.max() < len(drawn.mesh.vertices)
    if drawn.q_WB is not None:
        assert len(drawn.q_WB) == len(drawn.p_WB)
        np.testing.assert_allclose(np.linalg.norm(drawn.q_WB, axis=1), 1.0, atol=1e-9)
