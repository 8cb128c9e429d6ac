"""The options of a run: the attributes of a `Setup`, as keyword arguments of `simulate` and `rollouts`.

Names and defaults stand once, in `Setup`; `inspect.signature` and `help` of both functions show them.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import MISSING, fields, replace
from inspect import Parameter, signature
from typing import Any, NamedTuple, TypedDict

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.errors import QueryError, nearest
from robot_dyn.foundations.signatures import takes
from robot_dyn.foundations.values import Caching, cached
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import as_method
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.setup.setup import Setup, no_step, segments

_MAX_SEGMENTS = 1000  # building more takes little of the time of their run, and keeping them takes memory


class Options(TypedDict, total=False):
    """Attributes of a `Setup` without plant and start, and the tolerances of its method; for type checkers."""

    duration_s: float
    controller: Any
    method: Any
    rtol: float | None
    atol: float | None
    step_s: float | None
    record_every_s: float
    estimate_error: bool
    about: dict[str, str]
    engine: str
    events: Any
    accuracy: Any


_BUILT = {each.name: each.default_factory() for each in fields(Setup) if each.default_factory is not MISSING}
_TOLERANCES = {name: Parameter(name, Parameter.KEYWORD_ONLY, default=None) for name in ("rtol", "atol")}
_STATED = {name: (signature(Setup).parameters | _TOLERANCES)[name] for name in Options.__annotations__}
takes_options = takes([x.replace(default=_BUILT.get(name, x.default)) for name, x in _STATED.items()])
"""A decorator: the signature shows each option with its default, in place of `**options`."""


def starts(q0: Any, v0: Any) -> dict[str, Any]:
    """The start, as far as it was given, as options."""
    return {name: x for name, x in (("q0", q0), ("v0", v0)) if x is not None}


def setup_of(caller: str, what: Setup | Plant | Dynamics, options: Mapping[str, Any]) -> Setup:
    """Return the setup of a plant or robot with options, or a setup with some of its attributes changed.

    Args:
        caller: Name of the function that takes the options.
        what: What to run.
        options: The options that were given, q0 and v0 among them.

    Raises:
        QueryError: If an option is unknown, q0 is missing, or a method of fixed step is given a tolerance.
    """
    if isinstance(what, Setup) and not options:
        return what if what.is_value else copy(what)  # parts may have changed since: nothing cached is used
    attributes = {field.name for field in fields(Setup)} if isinstance(what, Setup) else {"q0", "v0"}
    known = attributes | Options.__annotations__.keys()
    for name in options.keys() - known:
        raise QueryError(f"{caller}: no option {name!r}; {nearest(name, known)}")
    if "method" in options and (method := as_method(options["method"])).controls_error:
        if "step_s" in options:
            raise QueryError(no_step(method.name))
        options = {"step_s": None, **options}  # that of the setup was given for another method
    if isinstance(what, Setup):
        return replace(what, **_with_tolerances(options, what.method))
    plant = what if isinstance(what, Plant) else _plant(what)
    if "q0" not in options:
        raise QueryError(f"{caller}: give q0, the position at the start, ({plant.dynamics.n},)")
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
    """Return the plant of rigid bodies without effects, which a robot keeps."""
    return cached(dynamics, Plant) if isinstance(dynamics, Caching) else Plant(dynamics)


class _Latest(NamedTuple):
    """The latest setup built from options: the options, which keeps objects in `content` alive, and their content."""

    options: Mapping[str, Any]
    content: Any
    setup: Setup


def _latest_or_new(plant: Plant, options: Mapping[str, Any]) -> Setup:
    """Return the setup of a plant with options.

    The plant keeps its latest setup, which is returned again for equal options. A setup is not kept if one of its parts
    or options may change, or if it has events, whose functions may change.
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
    """Internal: an option may be changed in place without a trace in its content."""


def _content(value: Any) -> Any:
    """Return the types and bits of a value as a value to compare; a controller or a method by identity.

    Raises:
        _MayChangeError: If the value is of another type.
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
