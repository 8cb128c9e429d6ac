"""References from samples: the piecewise polynomial through positions at given times, and velocities and accelerations.

    q                quintic spline, not-a-knot: four continuous derivatives, error O(Δ⁶) of smooth motions
    q, v             Hermite's cubics: acceleration jumps at the samples, error O(Δ⁴)
    q, v, a          Hermite's quintics: acceleration is continuous, error O(Δ⁶)

[de Boor 2001, ch. IV, XIII]
"""

from __future__ import annotations

from math import factorial
from typing import Any, final

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial, hermite, increasing, numbers
from robot_dyn.foundations.errors import ControlError

_MISSED = 1e-6  # of the largest sample: rounding of a spline is far below, and one that fails is far off


@final
class Samples(PiecewisePolynomial):
    """The motion through samples; it rests before the first and after the last.

    Between samples it is a spline of degree 5 with four continuous derivatives (not-a-knot; through fewer than six
    samples the one polynomial of least degree) where positions alone are given; Hermite's polynomial of degree 3 with
    velocities, and of degree 5 with velocities and accelerations. Steps of integration end at its breaks, so that no
    method loses its order there; they are no longer than the samples lie apart. It begins as fast as the spline does:
    for a few way points from rest take `via_points`; for files, and for rest at both ends, `rd.control.from_samples`.

    Args:
        t: Increasing times, shape (m,), m at least 2, in [s].
        q: Positions, shape (m, n), in [rad] or [m]; unwrapped, since a jump by a whole turn is a motion here.
        v: Velocities, shape (m, n), in [rad/s] or [m/s].
        a: Accelerations, shape (m, n), in [rad/s²] or [m/s²]; with v.

    Raises:
        ControlError: If times do not increase, shapes do not match or accelerations are given without velocities; if
            no spline passes through the samples in floating point, because times nearly coincide.
    """

    @np.errstate(all="ignore")  # what overflows is refused
    def __init__(self, t: Any, q: Any, v: Any = None, a: Any = None) -> None:
        q = numbers("q", q, ("m", "n"))
        if len(q) < 2:
            raise ControlError(f"q must be 2 samples at least, got {len(q)}; to rest at one, hold(q)")
        t = increasing("t", t, len(q))
        if v is None:
            if a is not None:
                raise ControlError("a is given without v; give both, or positions alone")
            super().__init__(*spline(t, q))
            return
        data = [q, numbers("v", v, q.shape)] + ([] if a is None else [numbers("a", a, q.shape)])
        ends = np.stack(data, axis=1)
        super().__init__(t, hermite(np.diff(t), np.concatenate([ends[:-1], ends[1:]], axis=1)))


@np.errstate(all="ignore")  # what overflows is refused
def spline(t: np.ndarray, q: np.ndarray, *, at_rest: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Breaks and coefficients of the spline of degree 5 through samples, or of degree m − 1 if there are fewer.

    Not-a-knot at the ends; or at rest there, with no velocity and no acceleration, which takes 2 samples.

    Raises:
        ControlError: If it does not pass through the samples in floating point.
    """
    from scipy.interpolate import make_interp_spline

    unit = (t[-1] - t[0]) / (len(t) - 1)  # of time: derivatives of one size keep the solve well conditioned
    s, degree = (t - t[0]) / unit, 5 if at_rest else min(5, len(t) - 1)
    end = [(order, np.zeros(q.shape[1])) for order in (1, 2)]
    try:
        curve = make_interp_spline(s, q, k=degree, bc_type=(end, end) if at_rest else None)
        inside = np.isin(s, curve.t)  # not-a-knot leaves out two samples next to each end; of even degree it is one
        inside[[0, -1]] = True
        starts = s[inside][:-1]
        terms = [curve.derivative(r)(starts) / factorial(r) if r else curve(starts) for r in range(degree + 1)]
        coefficients = np.stack(terms, axis=1) / unit ** np.arange(degree + 1)[:, None]
        missed = float(np.abs(curve(s) - q).max())
    except (ValueError, np.linalg.LinAlgError):  # steps or samples that overflow, or vanish next to others
        raise _without_spline(t, q, degree) from None
    if not (np.isfinite(coefficients).all() and missed <= _MISSED * float(np.abs(q).max())):
        raise _without_spline(t, q, degree)
    return t[inside], coefficients


def _without_spline(t: np.ndarray, q: np.ndarray, degree: int) -> ControlError:
    """The error of samples that no spline passes through in floating point."""
    steps = np.diff(t)
    return ControlError(
        f"no spline of degree {degree} passes through the samples in floating point: times are {steps.min():.3g} to"
        f" {steps.max():.3g} s apart, and positions up to {np.abs(q).max():.3g}; leave out samples that nearly"
        " coincide, and check the units"
    )
