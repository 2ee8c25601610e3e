"""The arm in Exudyn: where it rests, how it swings, and the tangent of its tendons."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_arm import TendonArm
from handover.plants.helix.arm.tendon_chain import TendonTangent
from handover.plants.helix.arm.tendon_design import TendonDesign
from handover.plants.helix.arm.tendon_parameters import Params
from handover.plants.helix.arm.tendon_ports import Inputs, Outputs

CALIBRATED = np.repeat([0.12, 0.24, 0.24], 3)
ANGLES = np.deg2rad([0.0, 120.0, 240.0])
R_WB = np.diag([1.0, -1.0, -1.0])
Q_SYS = np.array([0.45, 0.1, 0.11, 0.25, 0.0, 0.25, -0.5, 0.0, 0.22])  # reaches far forward
BENT = Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3)


def tendon_lengths(q: Floats) -> Floats:
    """g(q) of the constant-curvature model, with tendons at 120 degrees."""
    return np.concatenate([l - 0.035 * (Dx * np.cos(ANGLES) + Dy * np.sin(ANGLES)) for Dx, Dy, l in q.reshape(3, 3)])


def constant_curvature_tip(q: Floats) -> Floats:
    """p_BG of the constant-curvature model."""
    p, turned = np.zeros(3), np.eye(3)
    for Dx, Dy, l in q.reshape(3, 3):
        D = math.hypot(Dx, Dy)
        A, S = (1 - math.cos(D)) / D**2, math.sin(D) / D
        p = p + turned @ (l * np.array([A * Dx, A * Dy, S]))
        turn = [[1 - A * Dx**2, -A * Dx * Dy, S * Dx], [-A * Dx * Dy, 1 - A * Dy**2, S * Dy]]
        turned = turned @ np.array([*turn, [-S * Dx, -S * Dy, math.cos(D)]])
    return p + 0.1 * turned[:, 2]


def settled(u: Inputs, discs: tuple[int, int, int] = (4, 8, 8), seconds: float = 4.0) -> Outputs:
    """Where the arm comes to rest: strongly damped, so it does so within 0.01 mm."""
    n_1, n_2, n_3 = discs
    arm = TendonArm(Params(discs_1=n_1, discs_2=n_2, discs_3=n_3, damping=0.3, internal_step=0.01))
    return run(arm, u, round(seconds / 0.04), dt=0.04)


def run(arm: TendonArm, u: Inputs, steps: int, dt: float = 0.02) -> Outputs:
    y = arm.outputs(0.0, u)
    for i in range(steps):
        y = arm.step(i * dt, dt, u)
    return y


def test_upper_tendons_carry_more_and_together_balance_weight_and_prestress():
    p = Params()
    tension = TendonArm(p).outputs(0.0, Inputs()).tension.reshape(3, 3)
    np.testing.assert_allclose(tension, tension[:, :1] * np.ones(3), rtol=1e-9)
    # Last segment: spring force of its compression, plus what hangs below, plus half of its own weight (on average).
    pressed = p.EA * (0.262 - 0.24) / 0.262
    weight = 9.81 * (p.gripper_mass + p.plate_mass[2] + p.segment_mass[2] / 2)
    assert tension[2].sum() == pytest.approx(pressed + weight, rel=1e-9)


def test_motors_do_not_yield_and_tendons_hold_the_length_against_a_downward_pull():
    p = Params()
    sunk = settled(Inputs(f_G=np.array([0.0, 0.0, -1.0]))).p_WG[2]
    stiffness = p.EA / p.natural_length + 3 * p.tendon_stiffness
    assert -0.7 - sunk == pytest.approx(np.sum(1.0 / stiffness), rel=0.06)


def test_a_shortened_tendon_bends_the_arm_towards_its_own_angle_in_the_base_frame():
    tendon, dl_t = 4, np.zeros(9)
    dl_t[tendon] = -0.004
    p_BG = R_WB @ settled(Inputs(dl_t=dl_t), seconds=2.0).p_WG
    assert np.hypot(*p_BG[:2]) > 0.01
    angle = math.atan2(p_BG[1], p_BG[0])
    assert math.remainder(angle - ANGLES[tendon % 3], 2 * math.pi) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(("Dx", "Dy", "where"), [(0.3, 0.0, [1.0, 0.0]), (0.0, 0.3, [0.0, -1.0])])
def test_positive_Dx_bends_to_front_and_positive_Dy_to_the_right_in_the_world(Dx: float, Dy: float, where: list[float]):
    q = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, Dx, Dy, 0.24])
    p_WG = settled(Inputs(dl_t=tendon_lengths(q) - CALIBRATED), seconds=2.0).p_WG
    np.testing.assert_allclose(p_WG[:2] / np.linalg.norm(p_WG[:2]), where, atol=0.02)


def test_sags_away_from_constant_curvature_with_a_slack_tendon_as_the_paper_shows():
    y = settled(Inputs(dl_t=tendon_lengths(Q_SYS) - CALIBRATED), seconds=6.0)
    hanging = np.array([0.0, 0.0, 0.7])
    p_BG, model = R_WB @ y.p_WG, constant_curvature_tip(Q_SYS)
    assert np.linalg.norm(model - hanging) == pytest.approx(0.29, abs=0.01)
    assert np.linalg.norm(p_BG - hanging) == pytest.approx(0.16, abs=0.01)
    assert np.linalg.norm(p_BG - model) == pytest.approx(0.14, abs=0.01)
    assert np.count_nonzero(y.tension < 0.01) == 1


@pytest.mark.slow
def test_discs_converge_quadratically_to_a_tip_error_below_a_millimetre():
    u = Inputs(dl_t=tendon_lengths(Q_SYS) - CALIBRATED, f_G=np.array([0.05, 0.2, 0.1]))
    coarse, usual, fine = (settled(u, discs).p_WG for discs in [(2, 4, 4), (4, 8, 8), (8, 16, 16)])
    assert np.linalg.norm(usual - fine) < 0.7e-3
    assert np.linalg.norm(coarse - usual) > 3.0 * np.linalg.norm(usual - fine)


def test_a_small_force_moves_the_gripper_its_way_in_proportion():
    one, two = (settled(Inputs(f_G=np.array([0.0, f, 0.0])), seconds=2.0).p_WG for f in (0.05, 0.1))
    assert one[1] > 1e-3
    assert abs(one[0]) < 1e-6
    assert two[1] == pytest.approx(2.0 * one[1], rel=0.02)


def test_a_persons_push_adds_to_what_else_pulls_at_the_gripper():
    both = Inputs(f_G=np.array([0.0, 0.03, 0.01]), f_P=np.array([0.02, 0.02, -0.01]))
    one = Inputs(f_G=np.array([0.02, 0.05, 0.0]))
    np.testing.assert_allclose(settled(both, seconds=0.2).p_WG, settled(one, seconds=0.2).p_WG, atol=1e-12)


@pytest.mark.slow
def test_swinging_dies_out_and_faster_with_more_damping():
    rests: list[float] = []
    for damping in (0.01, 0.06):
        arm = TendonArm(Params(damping=damping))
        run(arm, Inputs(f_G=np.array([0.0, 0.5, 0.0])), 10)
        y = [abs(float(arm.step(i * 0.02, 0.02, Inputs()).p_WG[1])) for i in range(100)]
        rests.append(max(y[50:]) / max(y[:50]))
    assert rests[1] < rests[0] < 1.0


def test_motors_follow_as_critically_damped_systems():
    w, y = 2 * math.pi * 4.0, run(TendonArm(Params(gravity=0.0)), Inputs(dl_t=np.full(9, -0.002)), 4)
    assert (0.7 + y.p_WG[2]) / 0.006 == pytest.approx(1 - (1 + w * 0.08) * math.exp(-w * 0.08), abs=0.03)


def test_backbone_has_25_points_whatever_the_disc_counts():
    for n_1, n_2, n_3 in ((1, 1, 1), (3, 5, 6)):
        y = TendonArm(Params(discs_1=n_1, discs_2=n_2, discs_3=n_3)).outputs(0.0, Inputs())
        np.testing.assert_allclose(y.backbone, np.linspace([0, 0, 0], [0, 0, -0.6], 25), atol=1e-12)


def test_one_long_step_is_the_same_as_short_ones():
    long, short = run(TendonArm(Params()), BENT, 1, dt=0.2), run(TendonArm(Params()), BENT, 10)
    np.testing.assert_allclose(long.p_WG, short.p_WG, atol=1e-4)


def energy(design: TendonDesign, p: Floats, R: Floats, L0: Floats) -> float:
    """Elastic energy of the nine tendons, with their holes' positions taken one by one."""
    total = 0.0
    for tendon in range(9):
        i, k = divmod(tendon, 3)
        nodes = range(design.ends[i], design.ends[i + 1] + 1)
        holes = np.array([p[b] + R[b] @ design.holes[k] for b in nodes])
        L = np.linalg.norm(np.diff(holes, axis=0), axis=1).sum()
        total += design.tendon_EA[tendon] * (L - L0[tendon]) ** 2 / (2.0 * L0[tendon])
    return total


def test_tangent_is_the_second_derivative_of_the_tendons_energy():
    design = TendonDesign(Params(discs_1=2, discs_2=3, discs_3=2, tendon_damping=0.0), "TendonArm")
    rng = np.random.default_rng(3)
    q = np.concatenate([rng.normal(scale=[1e-4] * 3 + [0.05] * 3, size=(7, 6)).ravel(), rng.uniform(-0.02, -0.015, 9)])
    L0 = design.reference_length + q[42:]
    p, rotations = design.poses(q)

    K = np.zeros((51, 51))
    TendonTangent(design).add(K, q, np.zeros(51), scale=1.0, rate=0.0)

    def moved(w: Floats) -> float:
        change = np.vstack([np.zeros(6), w.reshape(7, 6)])
        R = (rotations * Rotation.from_rotvec(change[:, 3:])).as_matrix()
        return energy(design, p + change[:, :3], R, L0)

    for _ in range(5):
        w = rng.normal(scale=[1e-5] * 3 + [1e-4] * 3, size=(7, 6)).ravel()
        second = moved(w) - 2.0 * moved(0.0 * w) + moved(-w)
        np.testing.assert_allclose(w @ K[:42, :42] @ w, second, rtol=1e-4)


def test_a_slack_tendon_has_next_to_no_tangent():
    design = TendonDesign(Params(discs_1=1, discs_2=1, discs_3=1), "TendonArm")
    q = np.zeros(27)
    q[18:] = 0.01
    K = np.zeros((27, 27))
    TendonTangent(design).add(K, q, np.zeros(27), scale=1.0, rate=0.0)
    assert np.abs(K).max() < 1.0
