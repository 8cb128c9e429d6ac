"""The fixed-step methods by the names of a scene file.

    y⁺ = method(name).step(system, t, y, h)

Each names its source where it is defined: Hairer, Nørsett, Wanner (two volumes), or Hairer, Lubich, Wanner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from robot_dyn.errors import QueryError
from robot_dyn.integrate.explicit import EXPLICIT_EULER, MIDPOINT, RK4, SemiImplicitEuler, order_8
from robot_dyn.integrate.gauss import Gauss
from robot_dyn.integrate.implicit import SDIRK_3, LinearlyImplicitEuler
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.validate import choice

_READY = (
    EXPLICIT_EULER,
    SemiImplicitEuler(),
    MIDPOINT,
    RK4,
    Gauss(2),
    Gauss(4),
    Gauss(6),
    LinearlyImplicitEuler(),
    SDIRK_3,
)

# How to get each; order_8 takes its coefficients from SciPy when asked for, so that this module stays light.
METHODS: Mapping[str, Callable[[], Integrator]] = MappingProxyType(
    {**{each.name: lambda each=each: each for each in _READY}, "order_8": order_8}
)


def method(name: str) -> Integrator:
    """The fixed-step method of that name.

    Raises:
        QueryError: If the name is unknown; gives the nearest names.
    """
    if isinstance(name, str) and name in ("DOP853", "Radau"):
        raise QueryError(f"no integration method {name!r} of fixed step; rd.Adaptive({name!r}) is an adaptive one")
    return METHODS[choice("integration method", name, METHODS)]()
