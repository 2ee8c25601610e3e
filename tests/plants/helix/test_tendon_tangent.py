import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_chain import TendonTangent
from handover.plants.helix.arm.tendon_design import TendonDesign
from handover.plants.helix.arm.tendon_parameters import Params


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
