"""What the visual servo does beyond algorithm 3: it follows, goes back, searches, refuses, and says why it gives up."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from support.controllers.sagging_arm import W_FROM_B, SaggingArm, ball_at

from handover.controllers.helix.servo import estimation
from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.visual_servo import Inputs, Outputs, Params, Phase, Verdict, VisualServo
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import Floats

PICTURE = 0.1
COVARIANCE = 1e-7 * np.eye(3)
Edit = Callable[[float, Inputs], Inputs]


@dataclass
class Loop:
    """Servo and arm, a picture each 0.1 s; `history` holds the servo's outputs."""

    servo: VisualServo = field(default_factory=lambda: VisualServo(Params()))
    arm: SaggingArm = field(default_factory=SaggingArm)
    history: list[Outputs] = field(default_factory=list[Outputs])

    @property
    def t(self) -> float:
        return len(self.history) * PICTURE

    def step(self, p_WO: Floats, edit: Edit = lambda _t, u: u) -> Outputs:
        u = replace(self.arm.measured(p_WO, noise=0.0003), cov_O=COVARIANCE, cov_R=COVARIANCE, cov_G=COVARIANCE)
        y = self.servo.step(self.t, PICTURE, edit(self.t, u))
        self.arm.follow(self.q_of(y), PICTURE)
        self.history.append(y)
        return y

    def run(self, until: Phase, p_WO: Floats, seconds: float = 80.0, edit: Edit = lambda _t, u: u) -> Outputs:
        for _ in range(round(seconds / PICTURE)):
            if self.step(p_WO, edit).phase is until:
                break
        return self.history[-1]

    def q_of(self, y: Outputs) -> Floats:
        """Return the state that the tendons command, which is the average of q_sys."""
        l = y.dl_t.reshape(3, 3) + np.array([[0.12], [0.24], [0.24]])
        angles = np.radians([0.0, 120.0, 240.0])
        Dx, Dy = (-2 / (3 * 0.035) * l @ f(angles) for f in (np.cos, np.sin))
        return np.column_stack([Dx, Dy, l.mean(axis=1)]).reshape(9)

    def miss(self, p_WO: Floats) -> float:
        return float(np.linalg.norm(self.arm.pose()[3:] - p_WO))


def own(**values: Any) -> Loop:
    return Loop(VisualServo(Params(**values)))


@pytest.mark.parametrize("degrees", [135.0, *(pytest.param(d, marks=pytest.mark.slow) for d in (0.0, -100.0))])
def test_the_gripper_comes_to_the_ball_within_what_the_cameras_know(degrees: float):
    p_WO, run = ball_at(degrees), Loop()
    assert run.run(Phase.GRASP, p_WO).phase is Phase.GRASP
    assert run.miss(p_WO) < 0.004
    assert run.run(Phase.HOLD, p_WO).phase is Phase.HOLD
    assert run.miss(p_WO) < 0.002


def test_a_ball_that_moves_while_the_gripper_closes_is_followed():
    p_WO, moved = ball_at(0.0), ball_at(0.0) + np.array([0.0, 0.015, 0.01])
    for follow_until, near in ((0.95, True), (0.0, False)):
        run = own(follow_until=follow_until)
        run.run(Phase.GRASP, p_WO)
        assert run.run(Phase.HOLD, moved).phase is Phase.HOLD
        assert (run.miss(moved) < 0.003) is near


def test_a_ball_that_is_taken_away_while_the_gripper_closes_is_approached_again_with_open_fingers():
    run = Loop()
    run.run(Phase.GRASP, ball_at(0.0))
    y = run.run(Phase.APPROACH, ball_at(60.0), seconds=2.0)
    assert (y.phase, y.closure) == (Phase.APPROACH, 0.0)
    assert run.run(Phase.GRASP, ball_at(60.0)).phase is Phase.GRASP


def unseen(name: str, since: float, until: float = np.inf) -> Edit:
    change: dict[str, Any] = {name: False}
    return lambda t, u: replace(u, **change) if since <= t < until else u


def test_a_lost_ring_is_found_where_it_was_seen_last():
    p_WO, run, hidden = ball_at(0.0), Loop(), 0.1

    def behind(_t: float, u: Inputs) -> Inputs:
        return replace(u, seen_R=u.p_WG_meas[0] < hidden)  # as if something stood there

    y = run.run(Phase.RECOVER, p_WO, edit=behind)
    assert y.phase is Phase.RECOVER
    assert run.arm.pose()[3] > hidden
    y = run.run(Phase.APPROACH, p_WO, edit=behind)
    assert y.phase is Phase.APPROACH
    assert run.arm.pose()[3] < hidden
    assert run.run(Phase.GRASP, p_WO).phase is Phase.GRASP  # what stood there is gone


@pytest.mark.parametrize(("name", "verdict"), [("seen_R", Verdict.LOST_RING), ("seen_O", Verdict.LOST_BALL)])
def test_what_is_not_found_again_is_told(name: str, verdict: Verdict):
    run = Loop()
    y = run.run(Phase.GIVEN_UP, ball_at(0.0), edit=unseen(name, since=2.0))
    assert (y.phase, y.verdict, y.closure) == (Phase.GIVEN_UP, verdict, 0.0)
    assert Phase.RECOVER in {y.phase for y in run.history}
    assert np.linalg.norm(run.arm.pose()[3:5]) < 0.15  # it went back to hang, and searched from there


def test_what_comes_back_in_time_is_no_loss():
    run = Loop()
    y = run.run(Phase.GRASP, ball_at(0.0), edit=unseen("seen_R", since=2.0, until=4.0))
    assert y.phase is Phase.GRASP
    assert Phase.RECOVER not in {y.phase for y in run.history}


def test_a_measurement_far_off_is_refused_and_many_are_believed():
    p_WO, run = ball_at(0.0), Loop()
    run.run(Phase.DESCEND, p_WO)
    off = np.array([0.1, 0.0, 0.0])

    def wrong(_t: float, u: Inputs) -> Inputs:
        return replace(u, p_WR_meas=u.p_WR_meas + off, p_WG_meas=u.p_WG_meas + off)

    for n in range(5):
        y = run.step(p_WO, wrong)
        refused = np.linalg.norm(y.p_WR_est - run.arm.pose()[:3]) < 0.02
        assert refused == (n < 3), n


def test_a_ball_out_of_the_models_reach_is_told_from_one_that_a_sagging_arm_cannot_reach():
    far = own(patience=25).run(Phase.GIVEN_UP, np.array([0.8, 0.0, -0.6]), seconds=200)
    assert (far.phase, far.verdict) == (Phase.GIVEN_UP, Verdict.OUT_OF_REACH)
    run = own(patience=25)
    sagging = run.run(Phase.GIVEN_UP, np.array([0.5, 0.0, -0.3]), seconds=200)
    assert (sagging.phase, sagging.verdict) == (Phase.GIVEN_UP, Verdict.LIMITS)


def test_a_command_does_not_run_away_from_an_arm_that_is_held():
    for windup, most in ((0.2, 0.2), (0.0, np.inf)):
        run = own(windup=windup, patience=60)
        ahead: list[float] = []
        for _ in range(300):
            u = SaggingArm().measured(ball_at(0.0), noise=0.0)  # it does not move
            y = run.servo.step(run.t, PICTURE, replace(u, cov_O=COVARIANCE, cov_R=COVARIANCE, cov_G=COVARIANCE))
            run.history.append(y)
            model = W_FROM_B * forward_kinematics(y.q_sys, 0.10)
            ahead.append(float(np.linalg.norm(model[3:] - y.p_WG_est)))
        assert max(ahead) < most + 1e-3
        last = run.history[-1]
        assert last.phase is Phase.APPROACH or last.verdict is Verdict.LIMITS
        assert windup or max(ahead) > 0.25


def everything(y: Outputs) -> list[Any]:
    return [np.asarray(getattr(y, v.name)).tolist() for v in describe(VisualServo).outputs]


Course = tuple[list[Inputs], list[Outputs]]


@pytest.fixture(scope="module")
def course() -> Course:
    """What a servo reads and commands that loses the ring on its way, and closes its gripper."""
    run, inputs = own(closing_time=4.0), list[Inputs]()

    def keep(t: float, u: Inputs) -> Inputs:
        inputs.append(replace(u, seen_R=not 3.0 < t < 7.0))
        return inputs[-1]

    for _ in range(320):
        run.step(ball_at(45.0), keep)
    assert {y.phase for y in run.history} >= {Phase.APPROACH, Phase.RECOVER, Phase.DESCEND, Phase.GRASP}
    return inputs, run.history


@pytest.mark.parametrize("after", [7, 43, 120, *(pytest.param(n, marks=pytest.mark.slow) for n in (0, 180))])
def test_another_servo_goes_on_from_the_state_bit_for_bit(after: int, course: Course):
    inputs, history = course
    begun, other = (VisualServo(Params(closing_time=4.0)) for _ in range(2))
    for n, u in enumerate(inputs[:after]):
        begun.step(n * PICTURE, PICTURE, u)
    other.step(0.0, PICTURE, inputs[20])
    other.set_state(begun.get_state())
    for n, u in enumerate(inputs[after : after + 150], after):
        assert everything(other.step(n * PICTURE, PICTURE, u)) == everything(history[n])


def update_times(loop: Loop, seconds: float) -> Floats:
    """Return the times at which the commanded state changed, s."""
    for _ in range(round(seconds / PICTURE)):
        loop.step(ball_at(0.0))
    q = np.array([y.q_sys for y in loop.history])
    return PICTURE * (np.flatnonzero(np.any(np.diff(q, axis=0) != 0.0, axis=1)) + 1).astype(np.float64)


def test_jitter_draws_each_control_period_evenly_about_the_nominal_one():
    steady, jittered = (np.diff(update_times(own(jitter=jitter, seed=1), 12.0)) for jitter in (0.0, 0.8))
    np.testing.assert_allclose(steady, 0.5)
    assert jittered.min() < 0.3
    assert jittered.max() > 0.7
    assert jittered.mean() == pytest.approx(0.5, abs=0.12)


@pytest.mark.parametrize("most", [60, 1])
def test_a_state_optimisation_that_fails_is_told(most: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(estimation, "_MAX_ITERATIONS", most)
    y = own().run(Phase.DESCEND, ball_at(0.0))
    assert y.estimate_converged is (most > 1)


@pytest.mark.parametrize("epsilon_control", [0.05, 1e-9])
def test_a_control_loop_that_does_not_come_to_its_goal_is_told(epsilon_control: float):
    y = own(epsilon_control=epsilon_control).run(Phase.DESCEND, ball_at(0.0))
    assert y.step_converged is (epsilon_control > 1e-3)
