"""Integration methods by name, as used by scenes and by every function that takes a method.

    y⁺ = method("RK4").step(system, t, y, h)

The module that defines a method cites its source.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import choice
from robot_dyn.integrate.adaptive import ADAPTIVE, Adaptive
from robot_dyn.integrate.explicit import EULER, MIDPOINT, RK4, SemiImplicitEuler, dp8
from robot_dyn.integrate.gauss import GaussLegendre
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.rosenbrock import RODAS5P_FIXED
from robot_dyn.integrate.time_stepping import MoreauJean

_READY = (
    EULER,
    SemiImplicitEuler(),
    MIDPOINT,
    RK4,
    GaussLegendre(2),
    GaussLegendre(4),
    GaussLegendre(6),
    RODAS5P_FIXED,
    MoreauJean(),
)

# Factories for the methods; DP8 builds its tableau only when it is used.
METHODS: Mapping[str, Callable[[], Integrator | Adaptive]] = MappingProxyType(
    {
        **{ready.name: lambda ready=ready: ready for ready in _READY},
        "DP8": dp8,
        **{name: lambda name=name: Adaptive(name) for name in ADAPTIVE},
    }
)
FIXED_STEP = tuple(name for name in METHODS if name not in ADAPTIVE)


def method(name: str) -> Any:
    """Return a method by name: an `Integrator` with a fixed step, or an `Adaptive` method with default tolerances.

    Raises:
        QueryError: If the name is unknown; the message suggests the closest names.
    """
    return METHODS[choice("integration method", name, METHODS)]()


def as_method(value: object) -> Integrator | Adaptive:
    """Return the method for a name; a method is returned unchanged.

    Raises:
        QueryError: If `value` is neither a name nor a method.
    """
    if isinstance(value, str):
        return method(value)
    if not isinstance(value, Integrator | Adaptive):
        raise QueryError(
            f"method: got {shown(value)}; give a name, such as 'RK4' or 'DOP853', or an rd.integrate.Adaptive(…)"
        )
    return value
