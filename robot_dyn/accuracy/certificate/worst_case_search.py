"""Search for the state of largest error: random states first, then an evolution strategy that starts at the worst.

    (μ + λ) evolution strategy: children of the worst states, each moved in some coordinates by steps of many sizes

Rounding errors jump from state to state, so there is no gradient to follow. States are float32 numbers, so that no
arithmetic rounds them. The search stays within the range of the random states. [Beyer and Schwefel, Evolution
strategies, Natural Computing 1, 2002]
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_dyn.cross_check.compare import random_state
from robot_dyn.model.robot import Robot

Batch = dict[str, np.ndarray]  # q, v, a, tau, each (S, n)
Errors = Callable[[Batch], np.ndarray]  # at each of S states, (S,)

_STEPS = (1e-7, 0.3)  # of the range of a coordinate


def random_states(robot: Robot, count: int, rng: np.random.Generator) -> Batch:
    """Return random states sampled as in `compare`, rounded to float32."""
    states = [random_state(robot, rng) for _ in range(count)]
    return {name: _in_float32(np.array([state[name] for state in states])) for name in states[0]}


def row(states: Batch, k: int) -> dict[str, np.ndarray]:
    """Return state k of a batch."""
    return {name: x[k] for name, x in states.items()}


def worst_state(
    among: Batch,
    rng: np.random.Generator,
    errors: Errors,
    sampled: np.ndarray,
    arguments: tuple[str, ...],
    parents: int = 8,
    children: int = 12,
    generations: int = 8,
) -> tuple[Batch, float]:
    """Return the worst state of the search, each part of shape (1, n), and its error.

    Args:
        among: The random states.
        rng: Generator of the steps.
        errors: Function to maximise.
        sampled: Errors of the random states.
        arguments: Names of the coordinates on which the error depends.
        parents: Number of states that survive a generation.
        children: Number of children of each parent.
        generations: Number of generations; up to five times as many while no state exceeds the random ones.
    """
    lowest, highest = ({name: end(x, axis=0) for name, x in among.items()} for end in (np.min, np.max))

    def offspring(best: Batch) -> Batch:
        """Return the children of a generation."""
        count = children * len(best["q"])
        steps = np.exp(rng.uniform(*np.log(_STEPS), size=(count, 1)))
        young = {name: np.repeat(x, children, axis=0) for name, x in best.items()}
        for name in [name for name in young if name in arguments]:
            x = young[name]
            moves, width = rng.random(x.shape) < 0.5, highest[name] - lowest[name]
            moved = x + moves * steps * width * rng.normal(size=x.shape)
            young[name] = _in_float32(np.clip(moved, lowest[name], highest[name]))
        return young

    sampled = np.where(np.isfinite(sampled), sampled, -np.inf)
    order = np.argsort(sampled)[::-1][:parents]
    best, size = {name: x[order] for name, x in among.items()}, sampled[order]
    for generation in range(5 * generations):
        if generation >= generations and size[0] > sampled[order[0]]:
            break
        young = offspring(best)
        new_size = errors(young)
        size = np.concatenate([size, np.where(np.isfinite(new_size), new_size, -np.inf)])
        survivors = np.argsort(-size, kind="stable")[:parents]
        best = {name: np.concatenate([x, young[name]])[survivors] for name, x in best.items()}
        size = size[survivors]
    return {name: x[:1] for name, x in best.items()}, float(size[0])


def _in_float32(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float32).astype(np.float64)
