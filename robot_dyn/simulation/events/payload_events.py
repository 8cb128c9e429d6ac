"""Payloads that are picked up and dropped in a run, and the state after such a time.

    v⁺ = (M + ΔM)⁻¹ M v⁻  for bodies picked up at rest, else v⁺ = v⁻;   W_k⁺ = W_k⁻ + energy gained or lost with it

M includes the bodies carried before and after; of several bodies at one time, those that are dropped are first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from robot_dyn.effects.plant import carrying
from robot_dyn.queries.dynamics import acceleration
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.state_equation import PICK_UP, StateEquation

Carried = tuple[bool, ...]


@final
class PayloadEvents:
    """The payloads of a run.

    Args:
        equation: The state equation, whose payloads are picked up and dropped.

    Attributes:
        equation: The state equation with the carried payloads in its bodies; unchanged if no payload changes.
    """

    def __init__(self, equation: StateEquation) -> None:
        self._whole = equation
        self._carried = self._at(0.0)
        self.equation = _carrying(equation, self._carried)

    def _at(self, t: float) -> Carried:
        payloads = self._whole.equation_of_motion.payloads
        return tuple(bool(payload.acts(t)) for payload in payloads if payload.carried is None)

    @property
    def any(self) -> bool:
        """True if payloads are picked up or dropped."""
        return bool(self._carried)

    def over(self, t: float, y: np.ndarray) -> tuple[np.ndarray, list[Occurrence]]:
        """Return the state after a time in [s] at which payloads are picked up or dropped, and these events."""
        now = self._at(t)
        y, happened = _transferred(self._whole, self._carried, now, t, y)
        self._carried, self.equation = now, _carrying(self._whole, now)
        return y, happened


def _carrying(equation: StateEquation, carried: Carried) -> StateEquation:
    return replace(equation, plant=carrying(equation.plant, carried)) if carried else equation


def _transferred(
    equation: StateEquation, was: Carried, now: Carried, t: float, y: np.ndarray
) -> tuple[np.ndarray, list[Occurrence]]:
    """Return the state after a time at which payloads are picked up or dropped, and these events.

    Args:
        equation: The state equation, whose payloads are picked up and dropped.
        was: True for each payload that is carried before.
        now: True for each that is carried after.
        t: Time, in [s].
        y: The state before.
    """
    y, n, payloads = y.copy(), equation.plant.dynamics.n, equation.equation_of_motion.payloads
    names, first = equation.plant.dynamics.joint_names, equation.size - len(equation.sources)
    q, v = y[:n], y[n : 2 * n]
    place = {name: first + k for k, name in enumerate(equation.sources)}
    works = [first + k for k in equation.of_payloads]
    carried, happened = list(was), []

    def energies(v: np.ndarray) -> np.ndarray:
        motion = _carrying(equation, tuple(carried)).equation_of_motion
        return np.array(motion.energies(np.array([t]), q[None], v[None]))[:, 0]

    def momentum() -> np.ndarray:
        return carrying(equation.plant, tuple(carried)).dynamics.momentum(q, v)

    def report(k: int, event: str, direction: int) -> None:
        name = f"payload on {payloads[k].payload.frame} {event}"
        happened.append(Occurrence(t, name, direction, tuple(q.tolist()), tuple(v.tolist())))

    changes = [k for k in range(len(was)) if was[k] != now[k]]
    dropped = [k for k in changes if was[k]]
    caught = [k for k in changes if now[k] and payloads[k].at_rest]
    for k in dropped:
        before, carried[k] = energies(v).sum(), False
        y[works[k]] += energies(v).sum() - before
        report(k, "dropped", -1)
    if caught:
        (kinetic, potential), p = energies(v), momentum()
        for k in caught:
            carried[k] = True
            after = energies(v)[1]
            y[works[k]] += after - potential
            potential = after
        v[:] = acceleration(carrying(equation.plant, tuple(carried)).dynamics.M(q), p, names)
        y[place[PICK_UP]] += energies(v)[0] - kinetic
        for k in caught:
            report(k, "picked up at rest", 1)
    for k in changes:
        if now[k] and not carried[k]:
            before, carried[k] = energies(v).sum(), True
            y[works[k]] += energies(v).sum() - before
            report(k, "picked up at the speed of the link", 1)
    return y, happened
