"""The state at which an error is largest: random ones first, then a search around the worst of these.

    (μ + λ) evolution strategy: children of the worst states, each moved in some coordinates by steps of many sizes

Rounding makes the error jump from state to state, so that there is no slope to follow. States are numbers of float32,
so that no arithmetic rounds them; a search stays within the range of the random ones. [Beyer and Schwefel, Evolution
strategies, Natural Computing 1, 2002]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import final

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


@final
class Search:
    """A search among states.

    Args:
        among: The random states.
        rng: Of the steps.
        parents, children: Number of states that survive a generation, and of children of each.
        generations: How many there are; five times as many while nothing worse than the random states is found.
    """

    def __init__(
        self, among: Batch, rng: np.random.Generator, parents: int = 8, children: int = 12, generations: int = 8
    ) -> None:
        self.among, self._rng = among, rng
        self._parents, self._children, self._generations = parents, children, generations
        self._least = {name: x.min(axis=0) for name, x in among.items()}
        self._most = {name: x.max(axis=0) for name, x in among.items()}

    def worst(self, errors: Errors, known: np.ndarray, arguments: tuple[str, ...]) -> tuple[Batch, float]:
        """The worst state that was found, (1, n) each, and its error.

        Args:
            errors: What is made large.
            known: Of the random states.
            arguments: Names of those coordinates that matter.
        """
        known = np.where(np.isfinite(known), known, -np.inf)
        order = np.argsort(known)[::-1][: self._parents]
        best, size = {name: x[order] for name, x in self.among.items()}, known[order]
        for generation in range(5 * self._generations):
            if generation >= self._generations and size[0] > known[order[0]]:
                break
            young = self._born(best, arguments)
            found = errors(young)
            size = np.concatenate([size, np.where(np.isfinite(found), found, -np.inf)])
            best_of_all = np.argsort(-size, kind="stable")[: self._parents]
            best = {name: np.concatenate([x, young[name]])[best_of_all] for name, x in best.items()}
            size = size[best_of_all]
        return {name: x[:1] for name, x in best.items()}, float(size[0])

    def _born(self, parents: Batch, arguments: tuple[str, ...]) -> Batch:
        """The children of a generation."""
        count = self._children * len(parents["q"])
        steps = np.exp(self._rng.uniform(*np.log(_STEPS), size=(count, 1)))
        young = {}
        for name, x in parents.items():
            x = np.repeat(x, self._children, axis=0)
            if name in arguments:
                moves = self._rng.random(x.shape) < 0.5
                wide = self._most[name] - self._least[name]
                x = x + moves * steps * wide * self._rng.normal(size=x.shape)
            young[name] = _in_float32(np.clip(x, self._least[name], self._most[name]))
        return young


def _in_float32(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float32).astype(np.float64)
