"""Environments of Gymnasium: its own checks, and the laws of episodes, seeds and ends."""

from __future__ import annotations

import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import robot_dyn as rd
from robot_dyn.foundations import MissingExtraError, QueryError
from robot_dyn.tools.step import Env, State, Stepper, VectorEnv

ARM = rd.load("planar_2r")
PLANT = rd.Plant(ARM, [rd.effects.EffortLimit(20.0), rd.effects.ViscousFriction(0.3)])
PD = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=60.0, kd=9.0, period_s=5e-3)
STEPS = 5  # of an episode


def start(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    return rng.uniform(-1.0, 1.0, 2), np.zeros(2)


def goal(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-0.5, 0.5, 2)


def reward(state: State, action: np.ndarray, goals: np.ndarray) -> np.ndarray:
    return -np.square(state.q - goals).sum(axis=1)


def options(**changes: Any) -> dict[str, Any]:
    usual = {"start": start, "reward": reward, "goal": goal, "low": -1.0, "high": [1.0, 2.0], "time_limit_s": 0.1}
    return usual | changes


def env(n: int = 3, controller: Any = PD, **changes: Any) -> VectorEnv:
    return VectorEnv(Stepper(PLANT, n, controller=controller, step_s=2e-3, ledger=True), **options(**changes))


@pytest.mark.filterwarnings("ignore:.*Box observation space", "ignore:.*not having a spec")
def test_check_env_of_gymnasium_passes() -> None:
    """It advises bounded observations; positions and velocities have no bounds."""
    check_env(Env(Stepper(PLANT, 1, controller=PD), **options()))


def test_spaces_and_modes_are_stated_and_wrappers_of_gymnasium_fit() -> None:
    lanes = RecordEpisodeStatistics(env())
    assert isinstance(lanes.unwrapped, gymnasium.vector.VectorEnv)
    assert lanes.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, _ = lanes.reset(seed=1)
    assert seen in lanes.observation_space and seen.shape == (3, 6)
    for k in range(2 * STEPS + 2):
        seen, rewards, terminated, truncated, infos = lanes.step(lanes.action_space.sample())
        assert seen in lanes.observation_space and rewards.shape == terminated.shape == truncated.shape == (3,)
        assert truncated.tolist() == [k % (STEPS + 1) == STEPS - 1] * 3 and not terminated.any()
        if truncated.any():
            assert infos["episode"]["l"].tolist() == [STEPS] * 3


def test_a_step_is_that_of_the_stepper_and_the_next_one_after_an_end_is_a_start() -> None:
    """Actions −1 and 1 are low and high, further ones are clipped; after an end the action and the reward are void."""
    lanes, arms, rng = env(), Stepper(PLANT, 3, controller=PD, step_s=2e-3), np.random.default_rng(0)
    seen, _ = lanes.reset(seed=7)
    arms.reset(seen[:, :2], seen[:, 2:4])
    goals, truncated = seen[:, 4:], np.zeros(3, bool)
    for _ in range(STEPS):
        actions = rng.uniform(-1.5, 1.5, (3, 2)).astype(np.float32)
        seen, rewards, _, truncated, info = lanes.step(actions)
        inside = (np.clip(actions, -1.0, 1.0) + 1.0) / 2.0
        state = arms.step(np.array([-1.0, -1.0]) + inside * np.array([2.0, 3.0]))
        np.testing.assert_allclose(seen, np.hstack([state.q, state.v, goals]), atol=1e-12)
        np.testing.assert_allclose(rewards, reward(state, actions, goals), atol=1e-12)
        assert np.abs(info["energy_residual"]).max() < 1e-5
    assert truncated.all()
    seen, rewards, terminated, truncated, _ = lanes.step(np.ones((3, 2)))
    assert not (rewards.any() or terminated.any() or truncated.any())
    assert not seen[:, 2:4].any() and not np.array_equal(seen[:, 4:], goals)


def test_a_start_is_a_function_of_seed_lane_and_episode() -> None:
    """Whatever the number of lanes, and whenever the earlier episodes ended."""

    def at_goal(state: State, goals: np.ndarray) -> np.ndarray:
        return np.arange(len(goals)) % 2 == 0

    few, many, ending = env(2), env(5), env(5, terminated=at_goal)
    for lanes in (few, many, ending):
        assert not np.array_equal(lanes.reset(seed=3)[0][0], lanes.reset(seed=4)[0][0])
    firsts = [lanes.reset(seed=3)[0] for lanes in (few, many, ending)]
    assert np.array_equal(firsts[0], firsts[1][:2]) and np.array_equal(firsts[1], firsts[2])
    assert len(np.unique(firsts[1][:, 0])) == 5
    seconds = many.reset()[0]
    assert not np.isin(seconds[:, 0], firsts[1][:, 0]).any()
    ends = ending.step(np.zeros((5, 2)))[2]
    assert ends.tolist() == [True, False, True, False, True]
    seen = ending.step(np.zeros((5, 2)))[0]
    assert np.array_equal(seen[ends], seconds[ends]) and not np.array_equal(seen[1], seconds[1])


def test_a_lane_that_diverges_is_terminated_at_its_last_finite_state() -> None:
    def fast(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        q, v = start(rng)
        return q, v + 1e9 * (rng.uniform() < 0.3)

    lanes = env(20, start=fast)
    before, _ = lanes.reset(seed=1)
    diverging = before[:, 2] > 1e8
    seen, rewards, terminated, truncated, info = lanes.step(np.zeros((20, 2)))
    assert 0 < diverging.sum() < 20
    assert np.array_equal(terminated, diverging) and np.array_equal(info["diverged"], diverging)
    assert np.array_equal(seen[diverging], before[diverging]) and not truncated.any()
    assert np.isfinite(seen).all() and np.isfinite(rewards).all()
    seen, _, terminated, _, info = lanes.step(np.zeros((20, 2)))
    assert np.isfinite(seen).all() and not info["diverged"][diverging].any()


def test_actions_may_be_torques_and_observations_a_function() -> None:
    lanes = env(controller=None, goal=None, reward=lambda *_: np.ones(3), observe=lambda state, goals: np.sin(state.q))
    assert lanes.reset(seed=0)[0].shape == (3, 2)
    assert lanes.step(np.zeros((3, 2)))[0].shape == (3, 2)


def test_bad_input_is_one_error_with_its_remedy() -> None:
    lanes, arms = env(), Stepper(PLANT, 3)
    lanes.reset(seed=0)
    wrong: list[tuple[str, Any]] = [
        ("actions", lambda: lanes.step(np.zeros((3, 3)))),
        (r"\(3, 2\)", lambda: lanes.step(np.zeros((2, 2)))),
        ("lane 1", lambda: lanes.step([[0.0, 0.0], [np.nan, 0.0], [0.0, 0.0]])),
        ("seed", lambda: lanes.reset(seed=-1)),
        ("seed", lambda: lanes.reset(seed="one")),  # pyright: ignore[reportArgumentType]
        ("start must be a function", lambda: env(start=None)),
        ("goal must be a function", lambda: env(goal=[0.0])),
        ("start must return", lambda: env(start=lambda rng: np.zeros(2))),
        ("q of start", lambda: env(start=lambda rng: (np.zeros(3), np.zeros(2)))),
        ("goal", lambda: env(goal=lambda rng: [np.nan])),
        ("low must be less", lambda: env(low=2.0)),
        ("high", lambda: env(high=[1.0, 2.0, 3.0])),
        ("time_limit_s", lambda: env(time_limit_s=0.0)),
        ("observe", lambda: env(observe=lambda state, goals: state.q[0])),
        ("reward", lambda: (bad := env(reward=lambda *_: 0.0)).reset(seed=0) and bad.step(np.zeros((3, 2)))),
        (
            "reward of lane 0",
            lambda: (bad := env(reward=lambda *_: np.full(3, np.nan))).reset() and bad.step(np.zeros((3, 2))),
        ),
        ("reset first", lambda: env().step(np.zeros((3, 2)))),
        ("terminated", lambda: (bad := env(terminated=lambda *_: [True])).reset() and bad.step(np.zeros((3, 2)))),
        ("stepper", lambda: VectorEnv(ARM, **options())),  # pyright: ignore[reportArgumentType]
        ("one lane", lambda: Env(arms, **options())),
    ]
    for words, call in wrong:
        with pytest.raises(QueryError, match=words):
            call()


def test_without_gymnasium_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "robot_dyn.tools.step.vector_env")
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'robot-dyn\[gym\]'"):
        _ = rd.tools.step.VectorEnv
    assert rd.tools.step.Stepper is Stepper
