"""What the arm in Exudyn and the fast one have in common."""

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.restored_states import flat
from support.wording import Wording

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.geometry import rotation_of
from handover.plants.helix.arm.tendon_arm import TendonArm
from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import InvalidArmParameters, Params
from handover.plants.helix.arm.tendon_ports import Inputs, Outputs, SolverFailure, StepSizeError

BENT = Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3)
PULLED = Inputs(f_G=np.array([0.1, 0.2, 0.0]), closure=1.0)

Arm = TendonArm | TendonArmFast
both = pytest.mark.parametrize("kind", [TendonArm, TendonArmFast])


def run(arm: Arm, u: Inputs, steps: int, dt: float = 0.02) -> Outputs:
    y = arm.outputs(0.0, u)
    for i in range(steps):
        y = arm.step(i * dt, dt, u)
    return y


def test_they_have_the_same_ports_and_parameters():
    fast, arm = describe(TendonArmFast), describe(TendonArm)
    for what in ("inputs", "outputs", "parameters"):
        assert repr(getattr(fast, what)) == repr(getattr(arm, what))


@both
def test_hangs_straight_as_calibrated_and_stays(kind: type[Arm]):
    arm = kind(Params())
    start = arm.outputs(0.0, Inputs())
    np.testing.assert_allclose([start.p_WR, start.p_WG], [[0.0, 0.0, -0.6], [0.0, 0.0, -0.7]], atol=1e-12)
    np.testing.assert_allclose(start.q_WR, [0.0, 1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(start.backbone, np.linspace([0, 0, 0], [0, 0, -0.6], 25), atol=1e-12)
    np.testing.assert_allclose(flat(run(arm, Inputs(), 50)), flat(start), atol=1e-9)


@both
def test_gripper_rigid_beyond_the_ring_and_backbone_evenly_spaced(kind: type[Arm]):
    y = run(kind(Params()), BENT, 40)
    np.testing.assert_allclose(y.p_WG, y.p_WR + 0.1 * rotation_of(y.q_WR)[:, 2], atol=1e-12)
    np.testing.assert_allclose(y.q_WG, y.q_WR)
    np.testing.assert_allclose(y.backbone[[0, -1]], [np.zeros(3), y.p_WR], atol=1e-12)
    spacing = np.linalg.norm(np.diff(y.backbone, axis=0), axis=1)
    np.testing.assert_allclose(spacing, spacing.mean(), rtol=0.01)
    assert np.linalg.norm(y.q_WR) == pytest.approx(1.0)


@both
def test_gripper_closes_at_a_limited_rate_and_opens_again(kind: type[Arm]):
    arm = kind(Params(closing_time=0.2))
    assert run(arm, Inputs(closure=1.0), 5).grip == pytest.approx(0.5)
    assert run(arm, Inputs(closure=1.0), 6).grip == 1.0
    assert run(arm, Inputs(closure=0.25), 2).grip == pytest.approx(0.8)
    assert run(arm, Inputs(closure=0.25), 9).grip == 0.25


@both
def test_continues_bit_for_bit_from_a_state_here_and_in_another_arm_at_another_time(kind: type[Arm]):
    arm, other = kind(Params()), kind(Params())
    run(arm, BENT, 7)
    state, there = arm.get_state(), flat(arm.outputs(0.0, BENT))
    np.testing.assert_array_equal(flat(arm.outputs(0.06, Inputs())), there)  # outputs take no time
    assert arm.get_state() == state
    run(other, Inputs(dl_t=np.full(9, 0.001)), 3)
    first = [flat(arm.step(i * 0.02, 0.02, PULLED)) for i in range(8)]
    arm.set_state(state)
    other.set_state(state)
    assert other.get_state() == state
    for i in range(8):
        for one, begin in ((arm, 0.0), (other, 100.0)):
            np.testing.assert_array_equal(flat(one.step(begin + i * 0.02, 0.02, PULLED)), first[i])


SCRIPT = """
import hashlib, numpy as np
from handover.plants.helix.arm.{module} import {kind}
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import Inputs
arm = {kind}(Params())
for i in range(5):
    y = arm.step(i * 0.02, 0.02, Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3))
print(*y.p_WG, hashlib.sha256(arm.get_state()).hexdigest())
"""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "compiled"), [(TendonArm, True), (TendonArmFast, False)])
def test_says_nothing_leaves_no_file_and_gives_the_same_in_another_process(
    kind: type[Arm], compiled: bool, tmp_path: Path
):
    script = SCRIPT.format(module=kind.__module__.rpartition(".")[2], kind=kind.__name__)
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3]), "HANDOVER_COMPILE": "1" if compiled else "0"}
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.stderr == ""
    arm = kind(Params())
    y = run(arm, BENT, 5)
    *p_WG, digest = done.stdout.split()
    np.testing.assert_allclose([float(x) for x in p_WG], y.p_WG, atol=1e-9)  # plain Python has the same motion
    assert not compiled or digest == hashlib.sha256(arm.get_state()).hexdigest()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kind", "force"), [(TendonArm, 1e9), *((TendonArmFast, force) for force in (1e9, math.inf, math.nan))]
)
def test_failure_names_the_time_and_leaves_the_arm_where_it_was(kind: type[Arm], force: float):
    arm = kind(Params())
    before = arm.get_state()
    with pytest.raises(SolverFailure) as caught:
        arm.step(3.0, 0.02, Inputs(f_G=np.array([force, 0.0, 0.0])))
    assert str(caught.value).startswith(kind.__name__)
    assert 3.0 <= caught.value.time <= 3.02
    assert arm.get_state() == before
    np.testing.assert_array_equal(flat(arm.step(3.0, 0.02, BENT)), flat(kind(Params()).step(3.0, 0.02, BENT)))


@both
def test_bad_parameters_are_refused_all_at_once_and_a_step_with_those_that_would_fit(kind: type[Arm], wording: Wording):
    with pytest.raises(InvalidArmParameters) as caught:
        kind(Params(discs_1=0, EA=-1.0, natural_length=np.array([0.14, math.nan, 0.262])))
    assert len(caught.value.faults) == 3
    wording.check(caught.value)
    with pytest.raises(InvalidArmParameters) as caught:
        kind(Params(natural_length=np.array([0.14, 0.20, 0.262])))  # slack tendons at rest
    wording.check(caught.value)
    with pytest.raises(StepSizeError) as refused:
        kind(Params()).step(0.0, 0.012, Inputs())
    assert (refused.value.dt, refused.value.internal_step) == (0.012, 0.005)
    wording.check(refused.value)


@both
def test_motors_stop_at_their_ends(kind: type[Arm]):
    far, end = kind(Params()), kind(Params())
    run(far, Inputs(dl_t=np.full(9, -1000.0)), 30)
    run(end, Inputs(dl_t=-0.6 * np.repeat(Params().tendon_length, 3)), 30)
    assert far.get_state() == end.get_state()
    assert far.outputs(1.0, Inputs()).p_WG[2] > -0.55
