"""A scenario as an environment: Gymnasium's own check, the declared spaces, and the trajectories of the unit itself."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from support.kept_runs import kept_run
from support.wording import Wording

import handover
from handover.cosim.fmu.file.description import describe_fmu
from handover.scenarios.api.environment import ScenarioEnvironment, space_of
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters

COMMANDS = ("p_WH_cmd", "yaw_cmd", "sigma_cmd")


@pytest.mark.filterwarnings("ignore:.*Box (action|observation) space.*")
@pytest.mark.parametrize(
    ("scenario", "place"), [("ir_grasp", "reflex"), pytest.param("vsl_hybrid", "kinematics", marks=pytest.mark.slow)]
)
def test_gymnasium_accepts_it(scenario: str, place: str):
    env = handover.environment(scenario, place=place)
    try:
        check_env(env, skip_render_check=True)
    finally:
        env.close()


def test_its_spaces_are_what_the_unit_declares():
    env = handover.environment("ir_grasp", place="reflex", actions=["sigma_cmd", "phase"])
    assert env.action_space == spaces.Dict(
        {"phase": spaces.Discrete(12), "sigma_cmd": spaces.Box(0.0, 1.0, (), np.float64)}
    )
    inputs = describe_fmu(handover.unit("IrReflex")).inputs
    assert env.observation_space == spaces.Dict({name: space_of(inputs[name]) for name in inputs})


@pytest.fixture(scope="module")
def run() -> handover.Run:
    found = handover.load(kept_run("run", "ir_grasp", "--seed", "3", "-p", "strategy=blind", "--no-report"))
    assert isinstance(found, handover.Run)
    return found


def driven(env: ScenarioEnvironment, run: handover.Run, steps: int = 100_000) -> tuple[list[float], dict[str, object]]:
    """Act as the unit did in a run, for so many steps or to its end; return the rewards and the last information."""
    observed, info = env.reset(seed=3)
    rewards: list[float] = []
    seen = {name: run.signals[f"scene.{name}"] for name in ("p_WH", "yaw", "sigma", "ticks")}
    done = {name: run.signals[f"reflex.{name}"] for name in (*COMMANDS, "phase")}
    for k in range(len(run.signals.time)):
        for name, values in seen.items():
            assert np.array_equal(observed[name], values[k]), (name, k)
        action = {name: values[k] for name, values in done.items()}
        observed, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        assert not truncated
        if terminated or k == steps - 1:
            return rewards, info
    raise AssertionError("the episode has not ended")


def test_who_acts_as_the_unit_does_moves_the_world_as_it_did_and_a_reward_of_ones_own_sees_all_signals(
    run: handover.Run,
):
    env = handover.environment("ir_grasp", place="reflex", actions=[*COMMANDS, "phase"], strategy="blind")
    rewards, info = driven(env, run)
    assert info["success"] == run.success
    assert sum(rewards) == float(run.success)
    env.close()
    away = np.linalg.norm(run.signals["scene.p_WO"] - run.signals["scene.p_WH"], axis=1)
    env = handover.environment(
        "ir_grasp",
        place="reflex",
        actions=[*COMMANDS, "phase"],
        reward=lambda s: -float(np.linalg.norm(s["scene.p_WO"] - s["scene.p_WH"])),
        strategy="blind",
    )
    rewards, _ = driven(env, run, steps=30)
    assert rewards == pytest.approx(-away[1:31])
    env.close()


class Brief(IrGrasp):
    """A grasp that is given up after 0.3 s."""

    def stop_time(self, parameters: Parameters) -> Fraction:  # noqa: ARG002
        return Fraction(3, 10)


def test_an_episode_is_truncated_at_the_scenarios_end():
    env = handover.environment(Brief, place="reflex", actions=["sigma_cmd"], period=0.18)
    env.reset(seed=1)
    first, second = (env.step({"sigma_cmd": np.float64(0.0)}) for _ in range(2))
    assert first[2:] == (False, False, {"time": 0.18})
    _, reward, terminated, truncated, info = second
    assert (reward, terminated, truncated) == (0.0, False, True)
    assert (info["time"], info["success"]) == (0.3, False)
    env.close()


def test_episodes_without_a_seed_differ_and_follow_from_the_first():
    with pytest.raises(handover.InvalidInput, match=r"reset\(seed=3\)"):
        handover.environment("ir_grasp", place="reflex", seed=1)
    env = handover.environment("ir_grasp", place="reflex")
    first = [env.reset(seed=1)[1]["seed"], env.reset()[1]["seed"], env.reset()[1]["seed"]]
    assert first[0] == 1
    assert len({*first}) == 3
    assert [env.reset(seed=1)[1]["seed"], env.reset()[1]["seed"]] == first[:2]
    env.close()


def test_a_bad_action_is_refused(wording: Wording):
    env = handover.environment("ir_grasp", place="reflex")
    with pytest.raises(RuntimeError, match="call reset first"):
        env.step({})
    with pytest.raises(handover.InvalidInput, match="an episode has none"):
        env.reset(options={"strategy": "blind"})
    env.reset(seed=0)
    actions: list[Any] = [3, {"yaw_cmd": 0.0}, {"p_WH_cmd": np.zeros(2), "yaw_cmd": 0.0, "sigma_cmd": 2.0}]
    for action in actions:
        with pytest.raises(handover.InvalidInput) as e:
            env.step(action)
        wording.check(e.value)
    env.close()


def test_what_nobody_gives_is_no_metric():
    poles = ("pole_radius", "damping_ratio", "pole_frequency")
    with handover.open("flyer_impedance", place="impedance") as session:
        session.step(0.02)
        assert not [name for name in session.outcome.metrics if name.endswith("_impedance")]
    with handover.open("flyer_impedance", place="impedance") as session:
        for name, value in zip(poles, (0.99, 0.7, 0.4), strict=True):
            session[f"impedance.{name}"] = value
        session.step(0.1)
        saved, metrics = session.save(), session.outcome.metrics
    assert metrics["pole_margin_impedance"].value == pytest.approx(0.01)
    with handover.open("flyer_impedance", place="impedance") as session:
        session.restore(saved)
        assert session.outcome.metrics["damping_ratio_impedance"].value == pytest.approx(0.7)
