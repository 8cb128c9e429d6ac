"""References from samples: piecewise polynomials through positions, and optionally velocities and accelerations.

    q                quintic spline, not-a-knot: four continuous derivatives, error O(Δ⁶) for smooth motions
    q, v             Hermite's cubics: acceleration jumps at the samples, error O(Δ⁴)
    q, v, a          Hermite's quintics: acceleration is continuous, error O(Δ⁶)

[de Boor 2001, ch. IV, XIII]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial, hermite, increasing, numbers, spline
from robot_dyn.foundations.errors import ControlError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@final
class Samples(PiecewisePolynomial):
    """The motion through samples; it rests before the first sample and after the last.

    From positions alone it is a spline of degree 5 with four continuous derivatives (not-a-knot; for fewer than six
    samples, the single polynomial of lowest degree). With velocities it consists of Hermite polynomials of degree 3,
    with velocities and accelerations of degree 5. Integration steps end at the breaks, so methods keep their order;
    steps are therefore never longer than the time between samples. The velocity at the ends is not zero in general: for
    a few way points from rest use `via_points`; for files, or rest at both ends, `rd.control.from_samples`.

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
            raise ControlError(f"q: at least 2 samples are needed, got {len(q)}; use hold(q) to rest at one position")
        t = increasing("t", t, len(q))
        if v is None:
            if a is not None:
                raise ControlError("a is given without v; give both, or only positions")
            super().__init__(*spline(t, q))
            return
        data = [q, numbers("v", v, q.shape)] + ([] if a is None else [numbers("a", a, q.shape)])
        ends = np.stack(data, axis=1)
        super().__init__(t, hermite(np.diff(t), np.concatenate([ends[:-1], ends[1:]], axis=1)))
