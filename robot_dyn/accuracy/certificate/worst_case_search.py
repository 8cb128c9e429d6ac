"""Search for the state of largest error: random states first, then an evolution strategy that starts at the worst.

    (μ + λ) evolution strategy: children of the worst states, each moved in some coordinates by steps of many sizes

Rounding errors jump from state to state, so gradients are useless. States are exact in float32, so no
arithmetic rounds its inputs. The search stays within the range of the random states. [Beyer and Schwefel, Evolution
strategies, Natural Computing 1, 2002]
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_dyn.cross_check.compare import random_state
from robot_dyn.model.robot import Robot

Batch = dict[str, np.ndarray]  # q, v, a, tau, each (S, n)
Errors = Callable[[Batch], np.ndarray]  # batch of S states -> errors, (S,)

_STEPS = (1e-7, 0.3)  # smallest and largest step, as fractions of the range of a coordinate


def random_states(robot: Robot, count: int, rng: np.random.Generator) -> Batch:
    """Return random states sampled as in `compare`, rounded to float32."""
    states = [random_state(robot, rng) for _ in range(count)]
    return {name: _in_float32(np.array([state[name] for state in states])) for name in states[0]}


def row(states: Batch, k: int) -> dict[str, np.ndarray]:
    """Return state k of a batch."""
    return {name: x[k] for name, x in states.items()}


def worst_state(
    sampled_states: Batch,
    rng: np.random.Generator,
    errors: Errors,
    sampled_errors: np.ndarray,
    arguments: tuple[str, ...],
    parents: int = 8,
    children: int = 12,
    generations: int = 8,
) -> tuple[Batch, float]:
    """Return the worst state of the search, each part of shape (1, n), and its error.

    Args:
        sampled_states: The random states.
        rng: Generator of the steps.
        errors: Function to maximise.
        sampled_errors: Errors of the random states.
        arguments: Names of the coordinates on which the error depends.
        parents: Number of states that survive a generation.
        children: Number of children of each parent.
        generations: Number of generations; up to five times as many while no state exceeds the random ones.
    """
    lowest, highest = ({name: end(x, axis=0) for name, x in sampled_states.items()} for end in (np.min, np.max))

    def offspring(best: Batch) -> Batch:
        """Return the children of a generation."""
        count = children * len(best["q"])
        steps = np.exp(rng.uniform(*np.log(_STEPS), size=(count, 1)))
        descendants = {name: np.repeat(x, children, axis=0) for name, x in best.items()}
        for name in [name for name in descendants if name in arguments]:
            x = descendants[name]
            moves, width = rng.random(x.shape) < 0.5, highest[name] - lowest[name]
            moved = x + moves * steps * width * rng.normal(size=x.shape)
            descendants[name] = _in_float32(np.clip(moved, lowest[name], highest[name]))
        return descendants

    sampled_errors = np.where(np.isfinite(sampled_errors), sampled_errors, -np.inf)
    order = np.argsort(sampled_errors)[::-1][:parents]
    best, best_errors = {name: x[order] for name, x in sampled_states.items()}, sampled_errors[order]
    for generation in range(5 * generations):
        if generation >= generations and best_errors[0] > sampled_errors[order[0]]:
            break
        descendants = offspring(best)
        new_errors = errors(descendants)
        best_errors = np.concatenate([best_errors, np.where(np.isfinite(new_errors), new_errors, -np.inf)])
        survivors = np.argsort(-best_errors, kind="stable")[:parents]
        best = {name: np.concatenate([x, descendants[name]])[survivors] for name, x in best.items()}
        best_errors = best_errors[survivors]
    return {name: x[:1] for name, x in best.items()}, float(best_errors[0])


def _in_float32(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float32).astype(np.float64)
