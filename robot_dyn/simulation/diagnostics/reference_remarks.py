"""Remarks on references that a run cannot follow: a jump at the start, or motion of a joint that friction holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.effects.set_valued import SetValued
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.setup.setup import Setup

_JUMP = 0.01  # smallest jump remarked on, relative to the range of a reference or its largest velocity
_ROUNDING = 1e-9  # relative rounding of a position
_TIMES = 2000  # number of times at which a reference is evaluated

Units = list[tuple[str, str, str]]


def jumps(setup: Setup, q0: np.ndarray, v0: np.ndarray, units: Units) -> Iterator[tuple[Remark, np.ndarray]]:
    """Yield a remark on each joint that starts at another position or velocity than its reference.

    A reference rests before its first break. A reference that always rests is a set point, which may be anywhere. Each
    remark concerns the run with the largest jump; it comes with the jumps of all runs, (B,), 0 for none.

    Args:
        setup: The setup of the runs.
        q0: Positions at the start of each run, (B, n).
        v0: Velocities there, (B, n).
        units: Units of q, v and u of each joint.
    """
    reference = _joint_reference(setup)
    if reference is None or reference.start_s >= setup.duration_s:
        return
    q, v = _along(setup, reference)
    t, names = max(0.0, reference.start_s), setup.plant.dynamics.joint_names
    before = (q0, v0) if t == 0 else (np.broadcast_to(reference.at(0.0)[0], q0.shape), np.zeros_like(v0))
    sizes = np.ptp(q, axis=0), np.abs(v).max(axis=0)
    for row, (quantity, begin, there, size) in enumerate(zip("qv", reference.at(t), before, sizes, strict=False)):
        gaps = np.abs(begin - there)
        gaps[:, ~_moves(q)] = 0.0
        gaps[gaps <= _JUMP * size] = 0.0
        for i in np.flatnonzero(gaps.any(axis=0)):
            begins, at_start = float(begin[i]), float(there[gaps[:, i].argmax(), i])
            facts: dict[str, float | str] = {"unit": units[i][row]}
            yield Remark(RemarkKind.JUMPS, names[i], quantity, t, 0.0, t, begins, at_start, facts=facts), gaps[:, i]


def held_by_friction(setup: Setup, extremes: np.ndarray, t: np.ndarray, units: Units) -> Iterator[Remark]:
    """Yield a remark on each joint that dry friction holds at every step while its reference moves.

    Args:
        setup: The setup of the run.
        extremes: Extremes of q, v and u over all steps, (3, 2, n).
        t: Times of its samples, (m,), in [s].
        units: Units of q, v and u of each joint.
    """
    reference = _joint_reference(setup)
    if reference is None or not len(t):
        return
    rubs = np.zeros(setup.plant.dynamics.n, dtype=bool)
    for effect in setup.plant.effects:
        if isinstance(effect, SetValued):
            least, most = effect.at_rest(setup.q0)
            rubs |= (least < 0) & (most > 0)
    path = reference.at(t)[0]
    span, moves = np.ptp(path, axis=0), _moves(path)
    for i in np.flatnonzero(rubs & at_rest(extremes) & moves):
        name, (unit, _, of_u) = setup.plant.dynamics.joint_names[i], units[i]
        most = float(np.nan_to_num(np.abs(extremes[2, :, i])).max())
        facts: dict[str, float | str] = {"unit": unit, "unit_of_u": of_u, "most": most}
        start, limit = float(setup.q0[i]), float(span[i])
        yield Remark(RemarkKind.HELD, name, "q", 0.0, float(t[-1]), 0.0, start, limit, facts=facts)


def at_rest(extremes: np.ndarray) -> np.ndarray:
    """Return True for joints that did not move, (…, n), from extremes over all steps (…, 3, 2, n)."""
    return (extremes[..., 0, 0, :] == extremes[..., 0, 1, :]) & (extremes[..., 1, :, :] == 0).all(axis=-2)


def _joint_reference(setup: Setup) -> PiecewisePolynomial | None:
    desired = None if setup.controller is None else setup.controller.desired
    return desired if isinstance(desired, PiecewisePolynomial) and desired.n == setup.plant.dynamics.n else None


def _moves(q: np.ndarray) -> np.ndarray:
    """Return True for joints whose positions (k, n) differ by more than rounding, (n,)."""
    return np.ptp(q, axis=0) > _ROUNDING * np.maximum(1.0, np.abs(q).max(axis=0))


def _along(setup: Setup, reference: PiecewisePolynomial) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity of a reference during a run, at equidistant times and its first breaks, (k, n)."""
    breaks = reference.breaks[(reference.breaks >= 0) & (reference.breaks <= setup.duration_s)][:_TIMES]
    q, v, _ = reference.at(np.concatenate([np.linspace(0.0, setup.duration_s, _TIMES), breaks]))
    return q, v
