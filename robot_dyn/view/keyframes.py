"""Keyframes: times between which a straight line replaces a run, |q(t) − q_line(t)| ≤ tolerance.

Between samples a run is the Hermite polynomial of q, v and a. The viewer interpolates the rotation of a joint about its
axis, so it draws a line in q between keyframes. [Ramer 1972; Douglas, Peucker 1973]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import NamedTuple, final

import numpy as np

from robot_dyn.control.reference import hermite, polynomial
from robot_dyn.simulation.results.run_data import TrajectoryData

TOLERANCE = 5e-4  # [rad] or [m]; half a millimetre at a reach of one metre, below a pixel of the screen
CHORD = TOLERANCE / 10  # largest error of lines between the times of a `Motion`
_LARGEST_TURN = pi / 2  # between keyframes; a viewer would take the shorter way round for more than π
_MAX_PARTS = 64  # parts of the time between two samples
_LOOKS = (0.25, 0.5, 0.75)  # fractions of that time at which polynomials are compared
_CHUNK = 20_000  # samples processed at a time


class Motion(NamedTuple):
    """The samples of a run and points between them.

    Attributes:
        t: Times, (k,), in [s].
        q: Positions, (k, n).
        open: Largest difference of the polynomials of q and v from those of q, v and a, for each joint, (n,). It is
            large if samples are too far apart to determine the motion between them.
    """

    t: np.ndarray
    q: np.ndarray
    open: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class Keyframes:
    """Keyframes of N joints.

    Attributes:
        t: Times, (k,), in [s]; rounded to single precision, as in the viewer.
        q: Positions, (k, N).
        samples: Number of samples that they replace.
        error: Largest deviation from a sample, for each joint, (N,), in [rad] or [m].
    """

    t: np.ndarray
    q: np.ndarray
    samples: int
    error: np.ndarray


def motion_of(run: TrajectoryData) -> Motion:
    """Return the samples of a run, with intermediate points so that straight lines are accurate."""
    data = [run.q, run.v] + ([run.a] if np.isfinite(run.a).all() else [])
    columns = np.stack(data, axis=1)
    times, points, left = [], [], [np.zeros(run.q.shape[1])]
    for i in range(0, len(run.t) - 1, _CHUNK):
        h = np.diff(run.t[i : i + _CHUNK + 1])
        ends = np.concatenate([columns[i : i + len(h)], columns[i + 1 : i + 1 + len(h)]], axis=1)[h > 0]
        t, q, off = _between(run.t[i : i + len(h)][h > 0], h[h > 0], ends)
        times, points, left = [*times, t], [*points, q], [*left, off]
    return Motion(np.concatenate([*times, run.t[-1:]]), np.concatenate([*points, run.q[-1:]]), np.max(left, axis=0))


def _between(t: np.ndarray, h: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times and positions between samples at t and t + h, from derivatives at both ends, (k, 2m, n)."""
    m = ends.shape[1] // 2
    c, q0, q1 = hermite(h, ends), ends[:, 0], ends[:, m]
    lower = hermite(h, ends[:, [0, 1, 3, 4]]) if m == 3 else np.stack([q0, (q1 - q0) / h[:, None]], axis=1)
    off, away = np.zeros(q0.shape[1]), np.zeros(len(h))
    for part in _LOOKS:
        s = (part * h)[:, None]
        q = polynomial(c, s)[0]
        off = np.maximum(off, np.abs(q - polynomial(lower, s)[0]).max(axis=0, initial=0.0))
        away = np.maximum(away, np.abs(q - (q0 + part * (q1 - q0))).max(axis=1, initial=0.0))
    parts = np.clip(np.ceil(np.sqrt(away / CHORD)), 1, _MAX_PARTS).astype(int)  # a chord errs as 1/parts²
    of = np.repeat(np.arange(len(h)), parts)
    s = h[of] * (np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[of]
    return t[of] + s, polynomial(c[of], s[:, None])[0], off


def keyframes(t: np.ndarray, q: np.ndarray, tolerance: float = TOLERANCE) -> Keyframes:
    """Return keyframes of samples t (m,), q (m, N)."""
    index = np.flatnonzero(corners(t, q, tolerance))
    times, positions = _short_turns(t[index], q[index])
    drawn = times.astype(np.float32).astype(float)
    apart = np.concatenate([[True], np.diff(drawn) > 0])
    drawn, positions = drawn[apart], positions[apart]
    error = np.array([np.abs(q[:, i] - np.interp(t, drawn, positions[:, i])).max() for i in range(q.shape[1])])
    return Keyframes(drawn, positions, len(t), error)


def stated_error(run: TrajectoryData, motion: Motion, keys: Keyframes, units: Mapping[str, str]) -> str:
    """Return a note on the errors of keyframes and of the recorded motion; `units` of the joints by name."""
    worst = int(keys.error.argmax())
    name, unit = list(units.items())[worst]
    text = (
        f"{len(run.t)} samples, interpolated by q, v and a, are drawn by {len(keys.t)} keyframes: joint positions are"
        f" off by at most {keys.error[worst] + CHORD:.1e} {unit} ({name})"
    )
    if (doubt := float(motion.open.max())) > TOLERANCE:
        unsure = run.joint_names[int(motion.open.argmax())]
        text += f"; samples are so far apart that positions between them are accurate only to {doubt:.1g} ({unsure})"
    return text


def corners(t: np.ndarray, q: np.ndarray, tolerance: float) -> np.ndarray:
    """Return True for keyframes, (m,): split each span at its sample farthest from the chord until all are near."""
    chosen = np.zeros(len(t), dtype=bool)
    chosen[[0, -1]] = True
    spans = [(0, len(t) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2 or t[b] == t[a]:
            continue
        part = ((t[a + 1 : b] - t[a]) / (t[b] - t[a]))[:, None]
        away = np.abs(q[a + 1 : b] - (q[a] + part * (q[b] - q[a]))).max(axis=1)
        if away.max() > tolerance:
            middle = a + 1 + int(away.argmax())
            chosen[middle] = True
            spans += [(a, middle), (middle, b)]
    return chosen


def _short_turns(t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add keyframes where a joint rotates too far between two of them."""
    parts = np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) / _LARGEST_TURN).astype(int)
    parts = np.maximum(parts, 1)
    at = np.concatenate([k + np.arange(n) / n for k, n in enumerate(parts)] + [[len(t) - 1.0]])
    index = np.arange(len(t))
    return np.interp(at, index, t), np.stack([np.interp(at, index, column) for column in q.T], axis=1)
