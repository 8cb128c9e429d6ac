"""The options of a run: the attributes of a `Setup`, as keyword arguments of `simulate` and `rollouts`.

`Setup` defines names and defaults; `inspect.signature` and `help` of both functions show them.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import MISSING, fields, replace
from inspect import Parameter, signature
from typing import Any, NamedTuple

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import QueryError, nearest
from robot_dyn.foundations.signatures import takes
from robot_dyn.foundations.validate import JointValues
from robot_dyn.foundations.values import Caching, cached
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import as_method
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.setup.setup import Options, Setup, no_step, segments

_MAX_SEGMENTS = 1000  # in a cached setup: more take memory, and are built fast compared with the run


_BUILT = {field.name: field.default_factory() for field in fields(Setup) if field.default_factory is not MISSING}
_TOLERANCES = {name: Parameter(name, Parameter.KEYWORD_ONLY, default=None) for name in ("rtol", "atol")}
_STATED = {name: (signature(Setup).parameters | _TOLERANCES)[name] for name in Options.__annotations__}
takes_options = takes(
    [
        x.replace(default=_BUILT.get(name, x.default), annotation=Options.__annotations__[name].__forward_arg__)
        for name, x in _STATED.items()
    ]
)
"""A decorator: the signature then shows each option with its default instead of `**options`."""


def starts(q0: JointValues | None, v0: JointValues | None) -> dict[str, JointValues]:
    """Return q0 and v0 as options, without those that are None."""
    return {name: x for name, x in (("q0", q0), ("v0", v0)) if x is not None}


def setup_of(caller: str, source: Setup | Plant | Dynamics, options: Mapping[str, object]) -> Setup:
    """Return the setup of a plant or robot with options, or a setup with some of its attributes changed.

    Args:
        caller: Name of the function that takes the options.
        source: A setup, a plant, or the dynamics of an arm without effects.
        options: Attributes of a `Setup` by name, q0 and v0 among them.

    Raises:
        QueryError: If an option is unknown, q0 is missing, or a method of fixed step is given a tolerance.
    """
    if isinstance(source, Setup) and not options:
        return source if source.is_value else copy(source)  # parts may have changed: the copy has an empty cache
    attributes = {field.name for field in fields(Setup)} if isinstance(source, Setup) else {"q0", "v0"}
    names = attributes | Options.__annotations__.keys()
    for name in options.keys() - names:
        raise QueryError(f"{caller}: no option {name!r}; {nearest(name, names)}")
    if "method" in options and (method := as_method(options["method"])).controls_error:
        if "step_s" in options:
            raise QueryError(no_step(method.name))
        options = {"step_s": None, **options}  # the step of the setup belongs to its own method
    if isinstance(source, Setup):
        return replace(source, **_with_tolerances(options, source.method))
    plant = source if isinstance(source, Plant) else _plant(source)
    if "q0" not in options:
        raise QueryError(f"{caller}: give q0, the position at the start, of shape ({plant.dynamics.n},)")
    return _latest_or_new(plant, options)


def _with_tolerances(options: Mapping[str, Any], default: Any = Setup.method) -> dict[str, Any]:
    """Return the options with `rtol` and `atol` as tolerances of the method, or of `default` if no method is given.

    Raises:
        QueryError: If a tolerance is given for a method of fixed step.
    """
    attributes = {name: value for name, value in options.items() if name not in _TOLERANCES}
    tolerances = {name: options[name] for name in _TOLERANCES if options.get(name) is not None}
    if not tolerances:
        return attributes
    method = as_method(attributes.get("method", default))
    if not isinstance(method, Adaptive):
        raise QueryError(
            f"{' and '.join(tolerances)}: no effect on {method.name}, which has a fixed step; use step_s, or an"
            " adaptive method, for example method='DOP853'"
        )
    return attributes | {"method": replace(method, **tolerances)}


def _plant(dynamics: Dynamics) -> Plant:
    """Return the plant without effects of an arm, which is cached with it."""
    return cached(dynamics, Plant) if isinstance(dynamics, Caching) else Plant(dynamics)


class _Latest(NamedTuple):
    """The latest setup built from options.

    Attributes:
        options: The options, so that the objects whose ids are in `content` stay alive.
        content: The options as a value to compare, see `_content`.
        setup: The setup.
    """

    options: Mapping[str, Any]
    content: Any
    setup: Setup


def _latest_or_new(plant: Plant, options: Mapping[str, Any]) -> Setup:
    """Return the setup of a plant with options.

    The plant caches its latest setup, which is returned again for equal options. A setup is not cached if one of its
    parts or options may change, or if it has events, whose functions may change.
    """
    try:
        content = _content(dict(sorted(options.items())))
    except _MayChangeError:
        return Setup(plant, **_with_tolerances(options))
    latest = plant.cache.get(Setup)
    if latest is not None and latest.content == content:
        return latest.setup
    setup = Setup(plant, **_with_tolerances(options))
    if setup.is_value and not setup.events and segments(setup) <= _MAX_SEGMENTS:
        plant.cache[Setup] = _Latest(options, content, setup)
    return setup


class _MayChangeError(Exception):
    """Internal: an option may be changed in place without a change of its content."""


def _content(value: Any) -> Any:
    """Return the types and bits of an option as a value to compare; controllers and methods count by identity.

    Raises:
        _MayChangeError: If the option is of any other type.
    """
    kind: Any = type(value)
    if (kind is np.ndarray or issubclass(kind, np.generic)) and not value.dtype.hasobject:
        return kind, value.dtype.str, value.shape, value.tobytes()
    if kind in (tuple, list):
        return kind, tuple(map(_content, value))
    if kind is dict:
        return tuple((_content(key), _content(entry)) for key, entry in value.items())
    if kind in (bool, int, float, str, type(None)):
        return kind, repr(value)  # -0.0 is another number than 0.0
    if isinstance(value, Controller | Integrator | Adaptive):  # it may change unless `Setup.is_value`
        return kind, id(value)
    raise _MayChangeError
