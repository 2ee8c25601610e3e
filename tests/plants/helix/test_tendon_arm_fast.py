import hashlib
import importlib
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.block import InvalidState
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.fmus.sources import closure
from handover.plants.helix.arm.tendon_arm import TendonArm
from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import InvalidArmParameters, Params
from handover.plants.helix.arm.tendon_ports import Inputs, Outputs, SolverFailure, StepSizeError

ANGLES = np.deg2rad([0.0, 120.0, 240.0])
LENGTH = np.array([0.12, 0.24, 0.24])
BENT = Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3)
PULLED = Inputs(f_G=np.array([0.1, 0.2, 0.0]), closure=1.0)


def run(arm: TendonArm | TendonArmFast, u: Inputs, steps: int, dt: float = 0.02) -> Outputs:
    y = arm.outputs(0.0, u)
    for i in range(steps):
        y = arm.step(i * dt, dt, u)
    return y


def flat(y: Outputs) -> Floats:
    return np.concatenate([np.ravel(getattr(y, v.name)) for v in describe(TendonArmFast).outputs])


def commands(rng: np.random.Generator) -> Inputs:
    """Bends of up to 0.6 rad a segment, lengths by a tenth up or down, every other time with a loosened tendon."""
    bend, length = rng.uniform(-0.6, 0.6, (3, 2)), rng.uniform(-0.1, 0.1, 3) * LENGTH
    dl_t = length[:, None] - 0.035 * (bend[:, :1] * np.cos(ANGLES) + bend[:, 1:] * np.sin(ANGLES))
    dl_t = dl_t.ravel()
    if rng.random() < 0.5:
        dl_t[rng.integers(9)] += rng.uniform(0.005, 0.03)
    return Inputs(dl_t=dl_t, f_G=rng.normal(size=3) * 0.1 * (rng.random() < 0.3))


def differences(seed: int, seconds: float, every: float = 1.0, settle: float = 0.0) -> tuple[float, float, int]:
    """Return the arms' largest distance, their last, in m, and how many tendons were slack at once."""
    rng = np.random.default_rng(seed)
    fast, arm, u = TendonArmFast(Params()), TendonArm(Params()), Inputs()
    apart, slack = [0.0], 0
    for i in range(round((seconds + settle) / 0.02)):
        if i % round(every / 0.02) == 0 and i * 0.02 < seconds:
            u = commands(rng)
        y, z = fast.step(i * 0.02, 0.02, u), arm.step(i * 0.02, 0.02, u)
        apart.append(float(max(np.linalg.norm(y.p_WR - z.p_WR), np.linalg.norm(y.p_WG - z.p_WG))))
        slack = max(slack, int(np.count_nonzero(z.tension < 0.01)))
        assert np.all(y.tension >= 0.0)
    return max(apart), apart[-1], slack


def test_has_the_ports_and_parameters_of_the_arm_in_exudyn():
    fast, arm = describe(TendonArmFast), describe(TendonArm)
    assert repr(fast.inputs) == repr(arm.inputs)
    assert repr(fast.outputs) == repr(arm.outputs)
    assert repr(fast.parameters) == repr(arm.parameters)


def test_an_fmu_carries_its_kernels_and_needs_neither_exudyn_nor_numba():
    carried = closure("handover.plants.helix.arm.tendon_arm_fast:TendonArmFast")
    assert "handover/plants/helix/arm/fast_motion.py" in carried.files
    assert not {"exudyn", "numba"} & {*carried.modules}


def test_hangs_straight_as_calibrated_and_stays():
    arm = TendonArmFast(Params())
    start = arm.outputs(0.0, Inputs())
    np.testing.assert_allclose(start.p_WG, [0.0, 0.0, -0.7], atol=1e-12)
    np.testing.assert_allclose(start.q_WR, [0.0, 1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(flat(start), flat(TendonArm(Params()).outputs(0.0, Inputs())), atol=1e-12)
    np.testing.assert_allclose(flat(run(arm, Inputs(), 50)), flat(start), atol=1e-9)


def test_moves_as_the_arm_in_exudyn_with_tendons_slack():
    largest, _, slack = differences(seed=7, seconds=1.0, every=0.5)
    assert largest < 0.1e-3
    assert slack > 0


@pytest.mark.slow
def test_moves_and_settles_as_the_arm_in_exudyn_in_fifty_sequences():
    found = [differences(seed, seconds=3.0, settle=1.0) for seed in range(50)]
    assert max(largest for largest, _, _ in found) < 0.1e-3
    assert max(last for _, last, _ in found) < 0.1e-3
    assert sum(slack > 0 for _, _, slack in found) > 25


def elastica(force: float, EI: float, l: float) -> tuple[float, float]:
    """Return how far the tip of an inextensible cantilever goes along and across under a transverse force at its tip.

    EI theta'' = -F cos(theta), theta(0) = theta'(l) = 0, by shooting over the curvature at the mount.
    """

    def shoot(curvature: float, n: int = 2000) -> tuple[float, float, float]:
        state, h = np.array([0.0, curvature, 0.0, 0.0]), l / n

        def slope(s: Floats) -> Floats:
            return np.array([s[1], -force / EI * math.cos(s[0]), math.cos(s[0]), math.sin(s[0])])

        for _ in range(n):
            a = slope(state)
            b = slope(state + 0.5 * h * a)
            c = slope(state + 0.5 * h * b)
            d = slope(state + h * c)
            state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return float(state[1]), float(state[2]), float(state[3])

    low, high = 0.0, 2.0 * force * l / EI
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shoot(middle)[0] < 0.0 else (low, middle)
    return shoot(low)[1:]


def exudyn_beam(force: float, EI: float, l: float, elements: int = 20) -> tuple[float, float]:
    """Return the like of Exudyn's beam by absolute nodal coordinates, in its static solution."""
    TendonArm(Params())  # loads Exudyn also where OpenGL is missing
    exudyn, beams = (importlib.import_module(name) for name in ("exudyn", "exudyn.beams"))
    items: Any = importlib.import_module("exudyn.itemInterface")
    system: Any = exudyn.SystemContainer().AddSystem()
    cable = items.Cable2D(massPerLength=1.0, bendingStiffness=EI, axialStiffness=1e5)
    clamped = [1, 1, 0, 1]
    line = (system, [0, 0, 0], [l, 0, 0], elements, cable)
    tip = beams.GenerateBeamElementsAlongLine(*line, groundConstraintsStart=clamped)["nodes"][-1]
    marker = system.AddMarker(items.MarkerNodePosition(nodeNumber=tip))
    system.AddLoad(items.Force(markerNumber=marker, loadVector=[0, force, 0]))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.numberOfLoadSteps, settings.staticSolver.verboseMode = 10, 0
    system.SolveStatic(settings)
    along, across, _ = system.GetNodeOutput(tip, exudyn.OutputVariableType.Position)
    return float(along), float(across)


@pytest.mark.slow
def test_bends_as_the_planar_elastica_and_exudyns_beam():
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
    assert exudyn_beam(force, stiff.EI, 0.6) == pytest.approx((along, across), abs=1e-5)
    np.testing.assert_allclose(y.p_WR, [across, 0.0, -along], atol=1e-3)


def test_swings_freely_without_gaining_energy():
    p = Params(damping=0.0, tendon_damping=0.0)
    arm = TendonArmFast(p)
    run(arm, Inputs(f_G=np.array([0.0, 0.5, 0.0])), 25)
    swings = [abs(float(arm.step(i * 0.02, 0.02, Inputs()).p_WG[1])) for i in range(400)]
    assert max(swings[:100]) > 0.02
    assert max(swings[300:]) < 1.05 * max(swings[:100])


def test_gripper_rigid_beyond_the_ring_and_backbone_evenly_spaced():
    y = run(TendonArmFast(Params()), BENT, 40)
    np.testing.assert_allclose(y.p_WG, y.p_WR + 0.1 * rotation_of(y.q_WR)[:, 2], atol=1e-12)
    np.testing.assert_allclose(y.backbone[[0, -1]], [np.zeros(3), y.p_WR], atol=1e-12)
    assert np.linalg.norm(y.q_WR) == pytest.approx(1.0)


def test_gripper_closes_at_a_limited_rate():
    arm = TendonArmFast(Params(closing_time=0.2))
    assert run(arm, Inputs(closure=1.0), 5).grip == pytest.approx(0.5)
    assert run(arm, Inputs(closure=0.25), 9).grip == 0.25


def test_continues_bit_for_bit_from_a_state_here_and_in_another_arm():
    arm = TendonArmFast(Params())
    run(arm, BENT, 7)
    state, there = arm.get_state(), flat(arm.outputs(0.0, BENT))
    first = flat(run(arm, PULLED, 12))
    other = TendonArmFast(Params())
    run(other, Inputs(dl_t=np.full(9, 0.001)), 3)
    for one in (arm, other, TendonArmFast(Params())):
        one.set_state(state)
        assert one.get_state() == state
        np.testing.assert_array_equal(flat(one.outputs(0.0, BENT)), there)
        np.testing.assert_array_equal(flat(run(one, PULLED, 12)), first)


def test_a_state_of_another_arm_is_refused_and_changes_nothing():
    arm = TendonArmFast(Params())
    run(arm, BENT, 3)
    before = arm.get_state()
    with pytest.raises(InvalidState, match="other disc counts"):
        arm.set_state(TendonArmFast(Params(discs_1=2)).get_state())
    assert arm.get_state() == before


@pytest.mark.parametrize("compiled", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_another_process_gives_the_same_bits_and_plain_python_the_same_motion(tmp_path: Path, *, compiled: bool):
    script = (
        "import numpy as np\n"
        "from handover.plants.helix.arm.tendon_arm_fast import Inputs, Params, TendonArmFast\n"
        "arm = TendonArmFast(Params())\n"
        "for i in range(5):\n"
        "    y = arm.step(i * 0.02, 0.02, Inputs(dl_t=np.array([-6, 3, 2, -4, 0, 4, 3, -6, 2]) * 1e-3))\n"
        "import hashlib\n"
        "print(*y.p_WG, hashlib.sha256(arm.get_state()).hexdigest())\n"
    )
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3]), "HANDOVER_COMPILE": "1" if compiled else "0"}
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.stderr == ""
    arm = TendonArmFast(Params())
    y = run(arm, BENT, 5)
    *p_WG, digest = done.stdout.split()
    np.testing.assert_allclose([float(x) for x in p_WG], y.p_WG, atol=1e-9)
    assert not compiled or digest == hashlib.sha256(arm.get_state()).hexdigest()
    assert list(tmp_path.iterdir()) == []


def test_a_step_that_does_not_fit_is_refused_with_those_that_would():
    with pytest.raises(StepSizeError, match=r"TendonArmFast: .* 0\.01 s or 0\.015 s would fit"):
        TendonArmFast(Params()).step(0.0, 0.012, Inputs())


@pytest.mark.parametrize("force", [1e9, math.inf, math.nan])
def test_failure_names_the_time_and_leaves_the_arm_where_it_was(force: float):
    arm = TendonArmFast(Params())
    before = arm.get_state()
    with pytest.raises(SolverFailure, match=r"^TendonArmFast: no solution at t = 3[.\d]* s") as caught:
        arm.step(3.0, 0.02, Inputs(f_G=np.array([force, 0.0, 0.0])))
    assert 3.0 <= caught.value.time <= 3.02
    assert arm.get_state() == before
    np.testing.assert_array_equal(flat(arm.step(3.0, 0.02, BENT)), flat(TendonArmFast(Params()).step(3.0, 0.02, BENT)))


def test_bad_parameters_are_refused_all_at_once():
    with pytest.raises(InvalidArmParameters, match=r"^TendonArmFast: ") as caught:
        TendonArmFast(Params(discs_1=0, EA=-1.0))
    assert len(caught.value.faults) == 2


def test_motors_stop_at_their_ends():
    far, end = TendonArmFast(Params()), TendonArmFast(Params())
    run(far, Inputs(dl_t=np.full(9, -1000.0)), 20)
    run(end, Inputs(dl_t=-0.6 * np.repeat(LENGTH, 3)), 20)
    assert far.get_state() == end.get_state()
    assert far.outputs(1.0, Inputs()).p_WG[2] > -0.55
