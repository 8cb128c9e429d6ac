"""Distributions of parameters, which take numbers u in [0, 1) to values by the inverse of F: x = F⁻¹(u).

A distribution takes one column of a design, or n of them where its parameters are arrays of shape (n,).

base         what all have in common: `Distribution`
bounded      `uniform`, `triangular`
gaussian     `normal`, `lognormal`
choices      `choice`: one of several values
of_scipy     frozen distributions of scipy.stats, by name and numbers
by_name      these functions; `distribution` of any object, `from_dict` of stored ones
"""

from robot_dyn.tools.sweeps.distributions.base import Distribution
from robot_dyn.tools.sweeps.distributions.by_name import (
    choice,
    distribution,
    from_dict,
    lognormal,
    normal,
    triangular,
    uniform,
)

__all__ = ["Distribution", "choice", "distribution", "from_dict", "lognormal", "normal", "triangular", "uniform"]
