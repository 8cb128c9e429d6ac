"""Learning environments of Gymnasium over a stepper; reward, end and observation are functions of the user.

This module needs the extra `gym`. [Towers et al. 2024, Gymnasium: A Standard Interface for Reinforcement Learning
Environments]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations import QueryError, duration, instance, integer, needs, numbers, shaped, shown
from robot_dyn.tools.step.stepper import State, Stepper

if TYPE_CHECKING:
    import gymnasium
    from gymnasium import spaces, vector
else:
    gymnasium = needs("gymnasium", extra="gym")
    spaces, vector = gymnasium.spaces, gymnasium.vector

Start = Callable[[np.random.Generator], tuple[ArrayLike, ArrayLike]]
Infos = dict[str, np.ndarray]
Step = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, Infos]
_STEPPER = "give a rd.tools.step.Stepper(…)"


@final
class VectorEnv(vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """The lanes of a stepper as environments of Gymnasium.

    An action −1 is `low` and 1 is `high`; actions beyond are clipped. An episode is truncated at the time limit. A lane
    that diverges is terminated: functions receive its last finite state, with `diverged` True. The autoreset mode is
    NEXT_STEP: the step after the end of an episode ignores the action and returns the start of the next one, with
    reward 0. The start of a lane is a function of seed, lane and number of the episode since the seed.

    Args:
        stepper: The lanes; the environment resets and steps them.
        start: Function (rng) → (q, v) of a lane, (joints,) each.
        reward: Function (state, action, goal) → reward of each lane, (n,), after a step with `action` in units of the
            stepper, (n, k).
        low: Action of the stepper for −1, a scalar or (k,).
        high: Action of the stepper for 1, a scalar or (k,).
        time_limit_s: Longest episode, in [s].
        terminated: Function (state, goal) → True for lanes whose episode ends, (n,); None for no end but the time.
        goal: Function (rng) → goal of an episode, (g,), called after `start`; None for goals of shape (n, 0).
        observe: Function (state, goal) → observations, (n, m); q, v and goal by default.

    Raises:
        MissingExtraError: If Gymnasium is not installed.
        QueryError: If an argument is not allowed, or a function returns another shape.

    Example:
        >>> arms = rd.tools.step.Stepper(rd.load("planar_2r"), 100)
        >>> start = lambda rng: (rng.uniform(-1.0, 1.0, 2), np.zeros(2))
        >>> cost = lambda state, action, goal: -np.square(state.q).sum(axis=1)
        >>> env = rd.tools.step.VectorEnv(arms, start=start, reward=cost, low=-9.0, high=9.0, time_limit_s=4.0)
        >>> observations, infos = env.reset(seed=0)
    """

    metadata: dict[str, Any] = {"autoreset_mode": vector.AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self, stepper: Stepper, *, start: Start, reward: Callable[[State, np.ndarray, np.ndarray], ArrayLike],
        low: ArrayLike, high: ArrayLike, time_limit_s: float,
        terminated: Callable[[State, np.ndarray], ArrayLike] | None = None,
        goal: Callable[[np.random.Generator], ArrayLike] | None = None,
        observe: Callable[[State, np.ndarray], ArrayLike] | None = None,
    ) -> None:  # fmt: skip
        self._stepper = instance("stepper", stepper, Stepper, _STEPPER)
        self.num_envs, k = stepper.n, len(stepper.action_names)
        named = {"start": start, "reward": reward, "terminated": terminated, "goal": goal, "observe": observe}
        for name, x in named.items():
            if not (callable(x) or (x is None and name not in ("start", "reward"))):
                raise QueryError(f"{name} must be a function, got {shown(x)}")
        self._start, self._reward, self._terminated, self._draw, self._observe = named.values()
        self._low, self._high = (numbers(name, x, (), (k,)) for name, x in (("low", low), ("high", high)))
        if not (self._low < self._high).all():
            raise QueryError(f"low must be less than high, got {shown(low)} and {shown(high)}")
        self._limit_s = duration("time_limit_s", time_limit_s)
        self._seed, self._episode = 0, np.zeros(self.num_envs, np.int64)
        self._done = np.zeros(self.num_envs, bool)
        q, v, goals = self._drawn(0)
        self._goals = np.tile(goals, (self.num_envs, 1))
        size = self._seen(stepper.reset(q, v)).shape[1]
        self._episode[:] = -1  # until the first reset
        self.single_observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.single_action_space = spaces.Box(-1.0, 1.0, (k,), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (self.num_envs, size), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (self.num_envs, k), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, object] | None = None) -> tuple[np.ndarray, Infos]:
        """Start an episode in all lanes; a seed makes it the first one.

        Args:
            seed: Seed of the starts and goals; None to continue with the next episodes.
            options: Ignored.

        Returns:
            Observations, (n, m), and an empty dictionary.

        Raises:
            QueryError: If the seed is not a whole number from 0 on.
        """
        super().reset(seed=checked_seed(seed), options=options)
        if seed is not None or (self._episode < 0).all():
            self._seed = cast(int, self.np_random_seed)
            self._episode[:] = -1
        return self._seen(self._begin(np.ones(self.num_envs, bool))), {}

    def step(self, actions: ArrayLike) -> Step:
        """Advance all lanes by a period of the stepper.

        Args:
            actions: Numbers from −1 to 1, (n, k).

        Returns:
            Observations (n, m), rewards, terminations and truncations (n,), and a dictionary with "diverged", (n,), and
            "energy_residual" in [J], (n,), of a stepper with a ledger.

        Raises:
            QueryError: If the actions have another shape or are not finite, or before the first reset.
        """
        if (self._episode < 0).any():
            raise QueryError("step: the environments have not been reset; call reset first")
        names, done, before = self._stepper.action_names, self._done, self._stepper.state
        scaled = np.clip(shaped("actions", actions, names), -1.0, 1.0)
        action = self._low + (scaled + 1.0) / 2.0 * (self._high - self._low)
        state = self._stepper.step(action)
        info: Infos = {"diverged": state.diverged & ~done}
        if self._stepper.has_ledger:
            info["energy_residual"] = self._stepper.energy_residual
        if done.any():
            state = self._begin(done)
        lost = state.diverged[:, None]
        state = replace(state, **{x: np.where(lost, getattr(before, x), getattr(state, x)) for x in ("q", "v", "z")})
        rewards = np.where(done, 0.0, self._of_lanes("reward", self._reward(state, action, self._goals)))
        terminated = state.diverged
        if self._terminated is not None:
            terminated = terminated | self._of_lanes("terminated", self._terminated(state, self._goals), bool)
        terminated = terminated & ~done
        truncated = ~done & (state.t > self._limit_s - self._stepper.period_s / 2)
        self._done = terminated | truncated
        return self._seen(state), rewards, terminated, truncated, info

    def render(self) -> None:
        """Return None; `rd.replay` shows a run."""

    def _begin(self, lanes: np.ndarray) -> State:
        """Start the next episode of some lanes, (n,)."""
        self._episode[lanes] += 1
        joints = len(self._stepper.joint_names)
        q, v = np.zeros((2, self.num_envs, joints))
        for lane in np.flatnonzero(lanes).tolist():
            q[lane], v[lane], self._goals[lane] = self._drawn(lane)
        self._done = np.where(lanes, False, self._done)
        return self._stepper.reset(q, v, lanes)

    def _drawn(self, lane: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return start and goal of the episode of a lane."""
        rng, joints = np.random.default_rng([self._seed, lane, self._episode[lane]]), (len(self._stepper.joint_names),)
        pair: Any = self._start(rng)
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise QueryError(f"start must return (q, v), got {shown(pair)}")
        q, v = (numbers(f"{name} of start", x, joints) for name, x in zip("qv", pair, strict=True))
        return q, v, np.zeros(0) if self._draw is None else numbers("goal", self._draw(rng), ("g",))

    def _seen(self, state: State) -> np.ndarray:
        """Return the observations of a state, (n, m)."""
        if self._observe is None:
            return np.hstack([state.q, state.v, self._goals])
        seen = np.array(self._observe(state, self._goals), float)
        if seen.ndim != 2 or len(seen) != self.num_envs:
            raise QueryError(f"observe must return one row for each of the {self.num_envs} lanes, got {seen.shape}")
        return seen

    def _of_lanes(self, name: str, values: ArrayLike, kind: type = float) -> np.ndarray:
        """Return the values that a function returned for each lane, (n,)."""
        array = np.array(values, kind)
        if array.shape != (self.num_envs,):
            raise QueryError(f"{name} must return one value for each of the {self.num_envs} lanes, got {array.shape}")
        if not np.isfinite(array).all():
            lane = int(np.argmin(np.isfinite(array)))
            raise QueryError(f"{name} of lane {lane} is {array[lane]}; return finite numbers")
        return array


@final
class Env(gymnasium.Env[np.ndarray, np.ndarray]):
    """A single lane as an environment of Gymnasium, which is reset by its user; see `VectorEnv` for the arguments.

    Args:
        stepper: A stepper of one lane.
        **options: Arguments of `VectorEnv`.

    Raises:
        MissingExtraError: If Gymnasium is not installed.
        QueryError: If the stepper has several lanes, or an argument of `VectorEnv` is not allowed.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, stepper: Stepper, **options: object) -> None:
        if instance("stepper", stepper, Stepper, _STEPPER).n != 1:
            raise QueryError(f"stepper must have one lane, got {stepper.n}; use VectorEnv")
        self._stepper, self._lanes = stepper, VectorEnv(stepper, **cast(dict[str, Any], options))
        self.observation_space = self._lanes.single_observation_space
        self.action_space = self._lanes.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, object] | None = None) -> tuple[np.ndarray, Infos]:
        """Start an episode; see `VectorEnv.reset`."""
        super().reset(seed=checked_seed(seed))
        observations, info = self._lanes.reset(seed=seed)
        return observations[0], info

    def step(self, action: ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        """Advance by a period; see `VectorEnv.step`."""
        observations, rewards, terminated, truncated, info = self._lanes.step(
            shaped("action", action, self._stepper.action_names)[None]
        )
        of_lane: dict[str, object] = {name: x[0] for name, x in info.items()}
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), of_lane

    def render(self) -> None:
        """Return None; `rd.replay` shows a run."""


def checked_seed(seed: int | None) -> int | None:
    """Return a seed as an integer, or None; raise a QueryError for other values."""
    return None if seed is None else integer("seed", seed, most=2**128 - 1)
