"""References from samples: piecewise polynomials through positions, and optionally velocities and accelerations.

    q                quintic spline, not-a-knot: four continuous derivatives, error O(Δ⁶) for smooth motions
    q, v             Hermite's cubics: acceleration jumps at the samples, error O(Δ⁴)
    q, v, a          Hermite's quintics: acceleration is continuous, error O(Δ⁶)

[de Boor 2001, ch. IV, XIII]
"""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial, hermite, increasing, numbers
from robot_dyn.foundations.errors import ControlError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


_MISSED = 1e-6  # relative to the largest sample: far above rounding, far below the error of a failed spline


@final
class Samples(PiecewisePolynomial):
    """The motion through samples; it rests before the first sample and after the last.

    From positions alone it is a spline of degree 5 with four continuous derivatives (not-a-knot; for fewer than six
    samples, the single polynomial of lowest degree). With velocities it consists of Hermite polynomials of degree 3,
    with velocities and accelerations of degree 5. Integration steps end at the breaks, so methods keep their order;
    steps are therefore at most as long as the time between samples. The velocity at the ends is not zero in general:
    for a few way points from rest use `via_points`; for files, or rest at both ends, `rd.control.from_samples`.

    Args:
        t: Increasing times, shape (m,), m at least 2, in [s].
        q: Positions, shape (m, n), in [rad] or [m]; unwrapped, because a jump by a whole turn is treated as a motion.
        v: Velocities, shape (m, n), in [rad/s] or [m/s].
        a: Accelerations, shape (m, n), in [rad/s²] or [m/s²]; they need v.

    Raises:
        ControlError: If times do not increase, shapes do not match, a is passed without v, or times nearly coincide, so
            that no spline passes through the samples in floating point.
    """

    @np.errstate(all="ignore")  # overflow raises an error
    def __init__(self, t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None) -> None:
        q = numbers("q", q, ("m", "n"))
        if len(q) < 2:
            raise ControlError(f"q: at least 2 samples are needed, got {len(q)}; to rest at one position, use hold(q)")
        t = increasing("t", t, len(q))
        if v is None:
            if a is not None:
                raise ControlError("a is given without v; give both, or only positions")
            super().__init__(*spline(t, q))
            return
        data = [q, numbers("v", v, q.shape)] + ([] if a is None else [numbers("a", a, q.shape)])
        ends = np.stack(data, axis=1)
        super().__init__(t, hermite(np.diff(t), np.concatenate([ends[:-1], ends[1:]], axis=1)))


@np.errstate(all="ignore")  # overflow raises an error
def spline(t: np.ndarray, q: np.ndarray, *, at_rest: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return breaks and coefficients of the spline through m samples, of degree 5 or, if m < 6, of degree m − 1.

    The ends are not-a-knot; with `at_rest`, velocity and acceleration are 0 there, the degree is 5, and 2 samples
    suffice.

    Raises:
        ControlError: If the spline does not pass through the samples in floating point.
    """
    from scipy.interpolate import make_interp_spline

    unit = (t[-1] - t[0]) / (len(t) - 1)  # time unit: derivatives of similar size keep the solve well conditioned
    s, degree = (t - t[0]) / unit, 5 if at_rest else min(5, len(t) - 1)
    end = [(order, np.zeros(q.shape[1])) for order in (1, 2)]
    try:
        curve = make_interp_spline(s, q, k=degree, bc_type=(end, end) if at_rest else None)
        inside = np.isin(s, curve.t)  # not-a-knot omits two samples next to each end, for an even degree one
        inside[[0, -1]] = True
        starts = s[inside][:-1]
        terms = [curve.derivative(r)(starts) / factorial(r) if r else curve(starts) for r in range(degree + 1)]
        coefficients = np.stack(terms, axis=1) / unit ** np.arange(degree + 1)[:, None]
        missed = float(np.abs(curve(s) - q).max())
    except (ValueError, np.linalg.LinAlgError):  # steps or samples overflow, or vanish next to others
        raise _without_spline(t, q, degree) from None
    if not (np.isfinite(coefficients).all() and missed <= _MISSED * float(np.abs(q).max())):
        raise _without_spline(t, q, degree)
    return t[inside], coefficients


def _without_spline(t: np.ndarray, q: np.ndarray, degree: int) -> ControlError:
    """Return the error for samples that no spline passes through in floating point."""
    steps = np.diff(t)
    return ControlError(
        f"no spline of degree {degree} passes through the samples in floating point: times are {steps.min():.3g} to"
        f" {steps.max():.3g} s apart, and positions up to {np.abs(q).max():.3g}; remove samples that nearly coincide,"
        " and check the units"
    )
