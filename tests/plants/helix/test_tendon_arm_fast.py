import numpy as np
import pytest
from support.plants.beams import elastica

from handover.cosim.blocks.block import InvalidState
from handover.fmus.sources import closure
from handover.plants.helix.arm.tendon_arm import TendonArm
from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import Inputs, Outputs

ANGLES = np.deg2rad([0.0, 120.0, 240.0])
LENGTH = np.array([0.12, 0.24, 0.24])
BENT = Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3)


def run(arm: TendonArm | TendonArmFast, u: Inputs, steps: int, dt: float = 0.02) -> Outputs:
    y = arm.outputs(0.0, u)
    for i in range(steps):
        y = arm.step(i * dt, dt, u)
    return y


def commands(rng: np.random.Generator) -> Inputs:
    """Bends of up to 0.6 rad a segment, lengths by a tenth up or down, every other time with a loosened tendon."""
    bend, length = rng.uniform(-0.6, 0.6, (3, 2)), rng.uniform(-0.1, 0.1, 3) * LENGTH
    dl_t = length[:, None] - 0.035 * (bend[:, :1] * np.cos(ANGLES) + bend[:, 1:] * np.sin(ANGLES))
    dl_t = dl_t.ravel()
    if rng.random() < 0.5:
        dl_t[rng.integers(9)] += rng.uniform(0.005, 0.03)
    return Inputs(dl_t=dl_t, f_G=rng.normal(size=3) * 0.1 * (rng.random() < 0.3))


def differences(seed: int, seconds: float, every: float = 1.0, settle: float = 0.0) -> tuple[float, int]:
    """Return the arms' largest distance, in m, and how many tendons were slack at once."""
    rng = np.random.default_rng(seed)
    fast, arm, u = TendonArmFast(Params()), TendonArm(Params()), Inputs()
    apart, slack = 0.0, 0
    for i in range(round((seconds + settle) / 0.02)):
        if i % round(every / 0.02) == 0 and i * 0.02 < seconds:
            u = commands(rng)
        y, z = fast.step(i * 0.02, 0.02, u), arm.step(i * 0.02, 0.02, u)
        apart = max(apart, float(np.linalg.norm(y.p_WR - z.p_WR)), float(np.linalg.norm(y.p_WG - z.p_WG)))
        slack = max(slack, int(np.count_nonzero(z.tension < 0.01)))
        assert np.all(y.tension >= 0.0)
    return apart, slack


def test_an_fmu_carries_its_kernels_and_needs_neither_exudyn_nor_numba():
    carried = closure("handover.plants.helix.arm.tendon_arm_fast:TendonArmFast")
    assert "handover/plants/helix/arm/fast_motion.py" in carried.files
    assert not {"exudyn", "numba"} & {*carried.modules}


def test_moves_as_the_arm_in_exudyn_with_tendons_slack():
    largest, slack = differences(seed=7, seconds=1.0, every=0.5)
    assert largest < 0.1e-3
    assert slack > 0


@pytest.mark.slow
def test_moves_and_settles_as_the_arm_in_exudyn_in_other_sequences():
    found = [differences(seed, seconds=2.0, settle=1.0) for seed in range(3)]
    assert max(largest for largest, _ in found) < 0.1e-3
    assert sum(slack > 0 for _, slack in found) > 1


@pytest.mark.slow
def test_bends_as_the_planar_elastica():
    # nearly without tendons, gravity and stretch: all tendons let go, a stiff axis, and force at the wrist
    stiff = Params(
        EA=1e5,
        natural_length=LENGTH * (1.0 + 1e-5),
        gravity=0.0,
        damping=2.0,  # a slow swing without gravity, which dies out within seconds
        internal_step=0.01,
        d_gripper=0.0,
        discs_1=12,
        discs_2=24,
        discs_3=24,
        slack_force=1e-4,
    )
    force = 0.05
    y = run(TendonArmFast(stiff), Inputs(dl_t=np.full(9, 0.2), f_G=np.array([force, 0.0, 0.0])), 400, dt=0.04)
    along, across = elastica(force, stiff.EI, 0.6)
    assert across > 0.1
    np.testing.assert_allclose(y.p_WR, [across, 0.0, -along], atol=1e-3)


def test_swings_freely_without_gaining_energy():
    p = Params(damping=0.0, tendon_damping=0.0)
    arm = TendonArmFast(p)
    run(arm, Inputs(f_G=np.array([0.0, 0.5, 0.0])), 25)
    swings = [abs(float(arm.step(i * 0.02, 0.02, Inputs()).p_WG[1])) for i in range(250)]
    assert max(swings[:60]) > 0.02
    assert max(swings[190:]) < 1.05 * max(swings[:60])


def test_a_state_of_another_arm_is_refused_and_changes_nothing():
    arm = TendonArmFast(Params())
    run(arm, BENT, 3)
    before = arm.get_state()
    with pytest.raises(InvalidState):
        arm.set_state(TendonArmFast(Params(discs_1=2)).get_state())
    assert arm.get_state() == before
