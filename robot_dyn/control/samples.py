"""References from samples: the piecewise polynomial through positions at given times, and velocities and accelerations.

    q                quintic spline, not-a-knot: four continuous derivatives, error O(Δ⁶) of smooth motions
    q, v             Hermite's cubics: acceleration jumps at the samples, error O(Δ⁴)
    q, v, a          Hermite's quintics: acceleration is continuous, error O(Δ⁶)

[de Boor 2001, ch. IV, XIII]
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from math import factorial
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial, hermite, increasing, numbers
from robot_dyn.errors import ControlError, nearest, shorten
from robot_dyn.files import read
from robot_dyn.validate import instance

MAX_BYTES = 2**28  # of a table
_HEAD = re.compile(r"\s*(t|[qvau]|power|energy|residual)(?:\s+(.*?))?(?:\s*\[[^]]*\])?\s*")
_GIVEN = "t", "q", "v", "a"
_NAMES = "give names of joints, such as robot.joint_names"


@final
class Samples(PiecewisePolynomial):
    """The motion through samples; it rests before the first and after the last.

    Between samples it is a spline of degree 5 with four continuous derivatives (not-a-knot; through fewer than six
    samples the one polynomial of least degree) where positions alone are given; Hermite's polynomial of degree 3 with
    velocities, and of degree 5 with velocities and accelerations. Steps of integration end at its breaks, so that no
    method loses its order there; they are no longer than the samples lie apart. It begins as fast as the spline does:
    for a few way points from rest take `via_points`.

    Args:
        t: Increasing times, shape (m,), m at least 2, in [s].
        q: Positions, shape (m, n), in [rad] or [m].
        v: Velocities, shape (m, n), in [rad/s] or [m/s].
        a: Accelerations, shape (m, n), in [rad/s²] or [m/s²]; with v.

    Raises:
        ControlError: If times do not increase, shapes do not match or accelerations are given without velocities.
    """

    @np.errstate(all="ignore")  # what overflows is refused as not finite
    def __init__(self, t: Any, q: Any, v: Any = None, a: Any = None) -> None:
        q = numbers("q", q, ("m", "n"))
        if len(q) < 2:
            raise ControlError(f"q must be 2 samples at least, got {len(q)}; to rest at one, hold(q)")
        t = increasing("t", t, len(q))
        if v is None:
            if a is not None:
                raise ControlError("a is given without v; give both, or positions alone")
            super().__init__(*_spline(t, q))
            return
        data = [q, numbers("v", v, q.shape)] + ([] if a is None else [numbers("a", a, q.shape)])
        ends = np.stack(data, axis=1)
        super().__init__(t, hermite(np.diff(t), np.concatenate([ends[:-1], ends[1:]], axis=1)))

    @classmethod
    def from_csv(cls, path: str | Path, joint_names: Sequence[str] | None = None) -> Samples:
        """The samples of a CSV file, such as `robot-dyn simulate --csv` writes.

        Its first line names the columns: t, and of each joint q, and if given v and a, with the joint's name, as
        "t [s], q elbow [rad], v elbow [rad/s]". Brackets are ignored: times are in [s], angles in
        [rad], lengths in [m]. Columns of u, power, energy and residual are left out.

        Args:
            path: Of the file, at most 256 MiB.
            joint_names: The joints in the order of q; that of the columns unless given.

        Raises:
            ControlError: If it cannot be read, a column or a joint is unknown or missing, or an entry is not a number.
        """
        table = read_table(path, joint_names)
        try:
            return cls(**table)
        except ControlError as error:
            raise ControlError(f"{path}: {shorten(error, 200)}") from None


def read_table(path: str | Path, joint_names: Sequence[str] | None) -> dict[str, np.ndarray]:
    """The columns of a CSV file as of `Samples.from_csv`: t (m,), and q, and if given v and a, (m, n).

    Raises:
        ControlError: If it cannot be read, a column or a joint is unknown or missing, or an entry is not a number.
    """
    if joint_names is not None:
        for name in instance("joint_names", joint_names, list | tuple, _NAMES, error=ControlError):
            instance("joint_names", name, str, _NAMES, error=ControlError)
    data = read(path, MAX_BYTES, ControlError, "give a CSV file with columns t, q …")
    try:
        lines = csv.reader(data.decode("utf-8-sig").splitlines(), strict=True)
        heads = next(lines, [])
        rows = [(lines.line_num, line) for line in lines if line]
    except (UnicodeDecodeError, csv.Error) as error:
        raise ControlError(f"{path}: is not a CSV file in UTF-8 ({error}); write it again") from None
    columns = _columns(path, heads, joint_names)
    try:
        table = np.array([list(map(float, line)) for _, line in rows]).reshape(-1, len(heads))
    except ValueError:  # no number, or a ragged list
        raise ControlError(f"{path}: {_wrong(heads, rows)}; correct it") from None
    given = {name: table[:, at] for name, at in columns.items()}
    return given | {"t": given["t"][:, 0]}


def _spline(t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Breaks and coefficients of the spline of degree 5 through samples, or of degree m − 1 if there are fewer."""
    from scipy.interpolate import make_interp_spline

    unit = (t[-1] - t[0]) / (len(t) - 1)  # of time: derivatives of one size keep the solve well conditioned
    s, degree = (t - t[0]) / unit, min(5, len(t) - 1)
    spline = make_interp_spline(s, q, k=degree)
    inside = np.isin(s, spline.t)  # not-a-knot leaves out two samples next to each end; a spline of even degree is one
    inside[[0, -1]] = True
    starts = s[inside][:-1]
    terms = [spline.derivative(r)(starts) / factorial(r) if r else spline(starts) for r in range(degree + 1)]
    return t[inside], np.stack(terms, axis=1) / unit ** np.arange(degree + 1)[:, None]


def _columns(path: str | Path, heads: list[str], joint_names: Sequence[str] | None) -> dict[str, list[int]]:
    """The columns of t, q, v, a, those of the joints in their order."""
    found: dict[str, dict[str, int]] = {}
    for i, head in enumerate(heads):
        match = _HEAD.fullmatch(head)
        if match is None or (match[2] or "") in found.get(match[1], {}):
            what = f"column {shorten(head)!r} is unknown or there twice"
            raise ControlError(f"{path}: {what}; name columns t, q …, v …, a …")
        found.setdefault(match[1], {})[match[2] or ""] = i
    if missing := [name for name in ("t", "q") if name not in found]:
        raise ControlError(f"{path}: there is no column {missing[0]}; name the columns in the first line: t, q …")
    names = list(found["q"] if joint_names is None else joint_names)
    for name in names:
        if name not in found["q"]:
            raise ControlError(f"{path}: there is no column 'q {name}'; {nearest(name, found['q'])}")
    for kind in _GIVEN[1:]:
        if kind in found and found[kind].keys() != set(names):
            raise ControlError(f"{path}: the columns of {kind} are not those of the joints {', '.join(names)}")
    return {
        kind: [*found[kind].values()][:1] if kind == "t" else [found[kind][name] for name in names]
        for kind in _GIVEN
        if kind in found
    }


def _wrong(heads: list[str], rows: list[tuple[int, list[str]]]) -> str:
    """The first line that is not a number for each column."""
    for number, line in rows:
        if len(line) != len(heads):
            return f"line {number} has {len(line)} entries for {len(heads)} columns"
        for head, text in zip(heads, line, strict=True):
            try:
                float(text)
            except ValueError:
                return f"line {number}: column {shorten(head)!r} holds {shorten(text)!r}, not a number"
    return "its lines have different numbers of entries"
