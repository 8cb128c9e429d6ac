"""The state at which an error is largest: random ones first, then a search around the worst of these.

    (μ + λ) evolution strategy: children of the worst states, each moved in some coordinates by steps of many sizes

Rounding makes the error jump from state to state, so that there is no slope to follow. States are numbers of float32,
so that no arithmetic rounds them; a search stays within the range of the random ones. [Beyer and Schwefel, Evolution
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
    """States as of `compare`, in numbers of float32."""
    states = [random_state(robot, rng) for _ in range(count)]
    return {name: _in_float32(np.array([each[name] for each in states])) for name in states[0]}


def row(states: Batch, k: int) -> dict[str, np.ndarray]:
    """One of the states."""
    return {name: x[k] for name, x in states.items()}


def worst_state(
    among: Batch,
    rng: np.random.Generator,
    errors: Errors,
    known: np.ndarray,
    arguments: tuple[str, ...],
    parents: int = 8,
    children: int = 12,
    generations: int = 8,
) -> tuple[Batch, float]:
    """The worst state that was found, (1, n) each, and its error.

    Args:
        among: The random states.
        rng: Of the steps.
        errors: What is made large.
        known: Errors of the random states.
        arguments: Names of those coordinates that matter.
        parents: Number of states that survive a generation.
        children: Number of children of each.
        generations: How many there are; five times as many while nothing worse than the random states is found.
    """
    least, most = ({name: end(x, axis=0) for name, x in among.items()} for end in (np.min, np.max))

    def born(best: Batch) -> Batch:
        """The children of a generation."""
        count = children * len(best["q"])
        steps = np.exp(rng.uniform(*np.log(_STEPS), size=(count, 1)))
        young = {name: np.repeat(x, children, axis=0) for name, x in best.items()}
        for name in [name for name in young if name in arguments]:
            x = young[name]
            moves, wide = rng.random(x.shape) < 0.5, most[name] - least[name]
            moved = x + moves * steps * wide * rng.normal(size=x.shape)
            young[name] = _in_float32(np.clip(moved, least[name], most[name]))
        return young

    known = np.where(np.isfinite(known), known, -np.inf)
    order = np.argsort(known)[::-1][:parents]
    best, size = {name: x[order] for name, x in among.items()}, known[order]
    for generation in range(5 * generations):
        if generation >= generations and size[0] > known[order[0]]:
            break
        young = born(best)
        found = errors(young)
        size = np.concatenate([size, np.where(np.isfinite(found), found, -np.inf)])
        survivors = np.argsort(-size, kind="stable")[:parents]
        best = {name: np.concatenate([x, young[name]])[survivors] for name, x in best.items()}
        size = size[survivors]
    return {name: x[:1] for name, x in best.items()}, float(size[0])


def _in_float32(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float32).astype(np.float64)
